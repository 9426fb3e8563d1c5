"""`wavesweep init`."""

import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from shlex import quote
from textwrap import wrap

import click

from wavesweep.engine.drawing import RATE, path_of
from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import Key, nearest, show
from wavesweep.haptics.controllers import CONTROLLERS
from wavesweep.program.bundled import bundled
from wavesweep.program.cli.file_places import write_whole
from wavesweep.program.cli.options import PATH, is_given, overwriting
from wavesweep.program.reading.keys import DEVICES, KEYS, STUDY_KEYS, SYMBOLS, VALUE_PATHS
from wavesweep.program.reading.reading import read_override, scan
from wavesweep.program.reading.tables import SpecTable, missing, tables
from wavesweep.program.reading.units import has_unit, number_in
from wavesweep.program.spec import load
from wavesweep.program.spec.describing import described, meaning_of
from wavesweep.program.spec.studies import DEFAULT_FREQUENCIES

DEFAULT = "pmw"
WIDTH = 110  # of a comment
# What a design begins with; every other key that the loop reads is a comment with its default,
# until a user decides.
CHOSEN = {
    "rates.fast_hz": 1000.0,
    "rates.slow_hz": 50.0,
    **{
        path: KEYS[path].default
        for path in ("device.mass", "device.damping", "controller.b", "local_model.K_LM")
    },
    "device.velocity": "difference",
    "environment.K_VE": 50.0,
    "environment.B_VE": 1.0,
    "environment.integration": "explicit",
    "environment.delay": "frame",
    "controller.Kp": 0.0,
    "controller.K_VC": 100.0,
    "controller.B_VC": KEYS["controller.B_VC"].default,
    "filters.lp1.order": 1,
    "filters.lp1.cutoff_hz": 10.0,
}
NOTES = {
    "rates.slow_hz": "or give ratio, see `wavesweep keys rates`",
    "device.velocity": "the default, exact, is kinder than an encoder",
    "environment.integration": "the default, implicit, is kinder than most engines",
    "environment.delay": "at another rate this stays true; the default, 0, is kinder than any engine",
    "controller.K_VC": "soft, since a slow avatar that is a frame late makes a stiff one unstable",
    "filters.lp1.order": "or give band edges, see `wavesweep keys filters.lp1`",
}
AXES = {
    "K_VE": "{ start = 0, stop = 5000 }",
    "B_VE": "{ start = 0, stop = 10, num = 41 }",
    "b": "[10, 25, 40, 80]",
}

# Folder of drawn loops -> its heading in --list. The named recipes are loops that one begins with,
# too.
DRAWN = {
    "templates": "Drawn loops of drives, robots and haptic devices:",
    "recipes": "Loops that somebody asked about in public, with question, answer and source:",
    "examples": "Examples of the documents:",
}
STARTING_RECIPES = ("admittance", "current-loop")


@click.command("init")
@click.argument("kind", required=False, default=DEFAULT)
@click.option(
    "--list", "listed", is_flag=True, help="List all names, each with a line that says what it is."
)
@click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="Put a value of your own in, e.g. J=0.01.",
)
@click.option(
    "--device",
    metavar="NAME",
    help=f"With a built-in controller, a device by name: {', '.join(DEVICES)}.",
)
@click.option(
    "--example",
    metavar="NAME",
    help="The same as KIND: an example of the documents, e.g. first-hour.",
)
@click.option(
    "--out",
    metavar="FILE",
    type=PATH,
    help="The file to write [default: KIND.toml]. With - it is written to stdout.",
)
@overwriting("Replace an existing file.")
def command(
    kind: str,
    listed: bool,
    settings: tuple[str, ...],
    device: str | None,
    example: str | None,
    out: str | None,
    overwrite: bool,
) -> None:
    """Write a commented spec to begin with.

    KIND names a drawn loop, e.g. drive, position-loop or haptic, or one of the built-in
    controllers; pmw is the default, and `wavesweep init --list` shows all names. Each number is in
    the file with its unit and meaning. The name of a log of the documents, e.g. pushed.csv, writes
    this log. With a controller, keys that have their defaults are comments. Integration, delay and
    velocity of the wall are those of an ordinary engine, since their defaults are the kindest ones.
    If the file exists, it is replaced only with --overwrite.

    \b
      wavesweep init drive --set J=0.01 --set kp=5
      wavesweep init pmw --device touch --set rates.slow_hz=30
    """
    if listed and any(map(is_given, ("kind", "example", "settings", "device", "out", "overwrite"))):
        raise click.UsageError("--list: expected nothing beside it, since it writes no spec")
    if listed:
        click.echo("\n".join(_listed()))
        return
    kind = example or kind
    names = [*CONTROLLERS, *drawn_loops(), *logs_of_documents()]
    _known(kind, names, "loop to begin with", "`wavesweep init --list` lists all")
    if out is not None and not out.strip():
        raise click.UsageError(
            "--out: expected the name of a file, found an empty text; leave the option out for the default"
        )
    own_name = kind if kind in logs_of_documents() else f"{kind}.toml"
    shown = f"{kind}.toml"
    if out not in (None, "-") and out.isprintable():
        shown = quote(out)
    text = _text_of(kind, device, shown, settings)
    if out == "-":
        click.echo(text, nl=False)
        return
    target = Path(out or own_name)
    expected = "another --out FILE, or --overwrite to replace it"
    write_whole((target, text), overwrite=overwrite, expected=expected)
    click.echo(str(target), err=True)


def _text_of(kind: str, device: str | None, shown: str, settings: tuple[str, ...]) -> str:
    """The file of a kind; shown: its name, as its comments have it."""
    if kind in CONTROLLERS:
        if device is not None:
            of_file = f"expected one of {', '.join(DEVICES)}, or of a file that identify wrote its [device] and [for_all] in the spec"
            _known(device, DEVICES, "device", of_file)
        return starter(kind, device, shown, settings)
    if device is not None:
        raise click.UsageError(
            f"--device: expected a built-in controller, found {kind}, a drawn loop; its numbers take --set"
        )
    logs = logs_of_documents()
    if kind not in logs:
        return _filled(drawn_loops()[kind], shown, settings)
    if settings:
        raise click.UsageError(
            f"--set: expected a loop to begin with, found {kind}, a log, which has no numbers to set"
        )
    return logs[kind].read_text(encoding="utf-8")


def drawn_loops() -> dict[str, Path]:
    """The files of drawn loops by name: templates first, and those recipes that one begins with."""
    loops = {}
    for folder in DRAWN:
        for path in sorted(bundled(f"sweeps/{folder}").glob("*.toml")):
            loops[path.stem] = path
    return dict(
        sorted(
            loops.items(),
            key=lambda item: item[1].parent.name != "templates" and item[0] not in STARTING_RECIPES,
        )
    )


def logs_of_documents() -> dict[str, Path]:
    """The files of logs and of time stamps that the documents read, by their names."""
    return {path.name: path for path in sorted(bundled("sweeps/examples").glob("*.csv"))}


def _listed() -> Iterator[str]:
    """Lines with every name and the first sentence about it, by folder."""
    drawn = drawn_loops()
    width = max(map(len, drawn))
    yield "A hand, a wall and one of the built-in controllers:"
    for kind, controller in CONTROLLERS.items():
        yield from _named(kind, controller.description, width)
    yield from (
        "",
        "Its device by name, with --device NAME, or as device.preset in a spec of your own:",
    )
    for name, device in DEVICES.items():
        unknown = " and ".join(path.removeprefix("device.") for path in device.unknown())
        open_ = f"; nobody publishes its {unknown}: put your own" if unknown else ""
        yield from _named(name, f"{device.title}{open_}", width)
    for folder, heading in DRAWN.items():
        yield from ("", heading)
        for name, path in drawn.items():
            if folder == ("templates" if name in STARTING_RECIPES else path.parent.name):
                yield from _named(name, _first_sentence(path), width)
    yield from ("", f"Logs and measurements of the documents: {', '.join(logs_of_documents())}")


def _named(name: str, meaning: str, width: int) -> list[str]:
    """A name and what it is, in lines as wide as a comment."""
    begun = f"  {name:{width}}  "
    return wrap(meaning, WIDTH, initial_indent=begun, subsequent_indent=" " * len(begun))


def _first_sentence(path: Path) -> str:
    """The first sentence of the comment at the head of a file."""
    comment = (
        path.read_text(encoding="utf-8")
        .partition("\n#\n")[0]
        .replace("\n# ", " ")
        .removeprefix("# ")
    )
    return re.split(r"(?<=[.?])\s", comment, maxsplit=1)[0]


def _known(name: str, names: Iterable[str], kind: str, instead: str = "") -> None:
    if name not in names:
        meant = nearest(name, names)
        hint = f"did you mean {meant}? " if meant else ""
        expected = instead or f"expected one of {', '.join(names)}"
        raise UsageError(f"{name} is no {kind}; {hint}{expected}")


def _places_of_numbers(text: str) -> dict[str, tuple[str, ...]]:
    """Return the paths of the numbers and words of a drawn loop that settings may replace, by the names that they go by."""
    places = {".".join(place): place for place in scan(text)}
    numbers = {
        path: place
        for path, place in places.items()
        if path in (RATE, *KEYS) or place[0] == "block"
    }
    numbers = {
        path: place for path, place in numbers.items() if text[scan(text)[place][1]] not in "[{"
    }  # a value of a block
    numbers |= {symbol: numbers[path] for symbol, path in SYMBOLS.items() if path in numbers}
    for place in [place for place in places.values() if place[0] == "numbers" and len(place) == 2]:
        numbers[place[1]] = places.get(f"numbers.{place[1]}.value", place)
    return numbers


def _filled(path: Path, shown: str, settings: Sequence[str]) -> str:
    """The text of a drawn loop with numbers of the user's own, and with the name of its file in the commands that it shows."""
    text = path.read_text(encoding="utf-8").replace(f"sweeps/{path.parent.name}/{path.name}", shown)
    for table in missing():
        text = re.sub(rf"(?ms)^\[{re.escape(table)}[].].*?(?=^\[|\Z)", "", text)
    numbers = _places_of_numbers(text)
    chosen = {typed.partition("=")[0].strip().removeprefix("numbers."): typed for typed in settings}
    for name in chosen:
        _known(name, numbers, f"number or word of {path.stem}")
    loaded = load(tomllib.loads(text), settings)  # refuses values that a spec refuses
    for name, typed in chosen.items():
        place = scan(text)[numbers[name]][1]
        number = read_override(typed)[1]
        value = json.dumps(loaded.own(path_of(name)) if has_unit(number) else number)
        rest = re.sub(r'^(?:"[^"]*"|[^,}\]\s]+)', "", text[place:], count=1)
        text = text[:place] + value + rest
    return text


def starter(kind: str, device: str | None, path: str, settings: Sequence[str] = ()) -> str:
    """The text of a spec with a controller of that kind; with a device, its numbers; settings: as for --set.

    path: the file's name in the commands that the text shows. Errors: KeyError if there is no such
    kind or device, UsageError for a setting of a key that the loop does not read, SpecError for a
    value that a spec refuses.
    """
    from wavesweep.haptics.controller_page import keys_of_page

    values = {path: KEYS[path].default for path in VALUE_PATHS}
    read = keys_of_page(
        values | {"controller.kind": kind, "controller.Kp": 1.0}
    )  # as if no gain were zero
    settings_by_path = {".".join(name): value for name, value, _ in map(read_override, settings)}
    for name in settings_by_path:
        _known(
            name, read | {"rates.slow_hz"}, f"key that {kind} reads", "`wavesweep keys` lists all"
        )
    for name, value in settings_by_path.items():
        if has_unit(value):  # one that cannot be converted is refused with the others
            settings_by_path[name] = number_in(value, KEYS[name].unit) or value
    text = (
        "\n".join(
            (
                *_head(kind, path),
                *_loop(kind, device, read, settings_by_path),
                *_studies(device, read),
            )
        )
        + "\n"
    )
    load(tomllib.loads(text))
    return text


def _head(kind: str, path: str) -> Iterator[str]:
    yield from _prose(
        "A spec to begin with. Controller " + f"{kind}: {CONTROLLERS[kind].description}" + "."
    )
    yield "#"
    yield f"#     wavesweep check {path}      what is stable, and how far each number may go"
    yield f"#     wavesweep zwidth {path}     all stable walls"
    yield f"#     wavesweep bode {path}       what the hand feels"
    yield "#"
    yield from _prose(
        "A line `#key = value` shows a default: take the # away to set it. `wavesweep keys KEY` says more about a key."
    )


def _loop(
    kind: str, device: str | None, read: frozenset[str], values: Mapping[str, object]
) -> Iterator[str]:
    """The tables of the loop: keys that a design begins with or that are given, and the others that it reads as comments."""
    numbers = DEVICES[device].numbers if device else {}
    active: dict[str, object] = {
        path: value for path, value in CHOSEN.items() if path not in numbers
    }
    active |= {"controller.kind": kind, **values}
    rate, twin = ("rates.ratio", "rates.slow_hz")[:: 1 if "rates.ratio" in values else -1]
    shown = read - {twin} | ({rate} if "rates.ratio" in read else set())
    notes = NOTES | _origins(device)
    if device:
        active["device.preset"], shown = device, shown | {"device.preset"}
        notes |= dict.fromkeys(
            DEVICES[device].unknown(), f"A GUESS, as nobody publishes it for {device}: put your own"
        )
    table = ""
    for path, key in KEYS.items():
        if path in shown:
            if path.rpartition(".")[0] != table:
                table = path.rpartition(".")[0]
                yield from ("", f"[{table}]")
            default = numbers[path].value if path in numbers else key.default
            yield from _entry(key, active.get(path), default, notes.get(path, ""))


def _origins(device: str | None) -> dict[str, str]:
    """Path -> a note on the number of the device."""
    numbers = DEVICES[device].numbers if device else {}
    return {
        path: "ASSUMED, put your own" if n.assumed else f"from the preset {device}"
        for path, n in numbers.items()
    }


def _studies(device: str | None, read: frozenset[str]) -> Iterator[str]:
    """The tables [sweep] and [bode], and those of capabilities that a spec begins with."""
    along, frequency = STUDY_KEYS["sweep.along"], STUDY_KEYS["bode.frequency_hz"]
    yield from (
        "",
        "[sweep]",
        *_entry(along, None, along.default, "for `wavesweep stability-region`"),
    )
    for symbol, axis in AXES.items():
        key = KEYS[SYMBOLS[symbol]]
        if key.path in read:
            yield from (*_prose(f"{key.unit}: {key.description}"), f"{symbol} = {axis}")
    decades = dict(DEFAULT_FREQUENCIES.written())
    span = ", ".join(f"{key} = {show(value)}" for key, value in decades.items())
    yield from (
        "",
        "[bode]",
        *_prose(f"{frequency.unit}: {frequency.description}"),
        f"#frequency_hz = {{ {span} }}",
    )
    for table in (started for started in tables().values() if started.starts):
        yield from ("", f"[{table.path}]", *_defaults(device, table))


def _defaults(device: str | None, table: SpecTable) -> Iterator[str]:
    """All keys of a table as comments; defaults are those of the device, if it has any."""
    numbers, notes = DEVICES[device].numbers if device else {}, _origins(device)
    defaults = {
        path: numbers[path].value if path in numbers else key.default
        for path, key in table.keys.items()
    }
    for path, default in defaults.items():
        if default is not None:
            yield from _entry(table.keys[path], None, default, notes.get(path, ""))
    absent = ", ".join(
        path.rpartition(".")[2] for path, default in defaults.items() if default is None
    )
    yield from _prose(f"Without a default: {absent}. See `wavesweep keys {table.path}`.")


def _entry(key: Key, value: object, default: object, note: str) -> Iterator[str]:
    """A comment with unit, meaning, choices and note; then the key, as a comment with its default if there is no value."""
    description, name = described(key), key.path.rpartition(".")[2]
    unit = f"{description['unit']}: " if description["unit"] else ""
    meaning = meaning_of(description) if key.choices else key.description
    yield from _prose(f"{unit}{meaning}{f'; {note}' if note else ''}")
    yield f"#{name} = {show(default)}" if value is None else f"{name} = {show(value)}"


def _prose(text: str) -> Iterator[str]:
    return (f"# {line}" for line in wrap(text, WIDTH))
