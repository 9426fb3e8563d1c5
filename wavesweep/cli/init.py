"""`wavesweep init`."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from textwrap import wrap

import click

from wavesweep.bundled import bundled
from wavesweep.cli.options import overwriting
from wavesweep.cli.output import refuse_no_folder, write_whole
from wavesweep.controllers import CONTROLLERS
from wavesweep.errors import UsageError
from wavesweep.spec.checking import nearest, show
from wavesweep.spec.devices import DEVICES
from wavesweep.spec.keys import KEYS, SIMULATE_KEYS, STUDY_KEYS, SYMBOLS, VALUE_PATHS, Key
from wavesweep.spec.studies import DEFAULT_FREQUENCIES

DEFAULT = "pmw"
WIDTH = 110  # of a comment
# What a design begins with; every other key that the loop reads is a comment with its default, until a user decides.
CHOSEN = {
    "rates.fast_hz": 1000.0,
    "rates.slow_hz": 50.0,
    **{path: KEYS[path].default for path in ("device.mass", "device.damping", "controller.b", "local_model.K_LM")},
    "device.velocity": "difference",
    "environment.K_VE": 50.0,
    "environment.B_VE": 1.0,
    "environment.integration": "explicit",
    "environment.delay": 20,
    "controller.Kp": 0.0,
    "filters.lp1.order": 1,
    "filters.lp1.cutoff_hz": 10.0,
}
NOTES = {
    "rates.slow_hz": "or give ratio, see `wavesweep keys rates`",
    "device.velocity": "the default, exact, is kinder than an encoder",
    "environment.integration": "the default, implicit, is kinder than most engines",
    "environment.delay": "a whole frame; the default, 0, is kinder than any engine",
    "filters.lp1.order": "or give band edges, see `wavesweep keys filters.lp1`",
}
AXES = {
    "K_VE": "{ start = 0, stop = 5000 }",
    "B_VE": "{ start = 0, stop = 10, num = 41 }",
    "b": "[10, 20, 40, 80]",
}

_KINDS = [f"{kind} (the default)" if kind == DEFAULT else kind for kind in CONTROLLERS]
HELP = f"""Write a commented spec to begin with.

KIND is the controller: {", ".join(_KINDS[:-1])} or {_KINDS[-1]}. Each key that its loop reads is in the file with
its unit and meaning; keys that have their defaults are comments. Integration, delay and velocity of the wall are those of
an ordinary engine, since their defaults are the kindest ones. If the file exists, it is replaced only with --overwrite.
"""


@click.command("init", help=HELP)
@click.argument("kind", required=False, default=DEFAULT)
@click.option("--device", metavar="NAME", help=f"A device by name: {', '.join(DEVICES)}.")
@click.option("--example", metavar="NAME", help="Write an example of the documents in place of KIND, e.g. first-hour.")
@click.option("--out", metavar="FILE", help="The file to write [default: KIND.toml]. With - it is written to stdout.")
@overwriting("Replace an existing file.")
def command(kind: str, device: str | None, example: str | None, out: str | None, overwrite: bool) -> None:
    """Write the spec to a file or to stdout."""
    if example is not None:
        kind, text = example, _example(example)
    else:
        _known(kind, CONTROLLERS, "controller")
    if device is not None:
        _known(device, DEVICES, "device")
    if out is not None and not out.strip():
        raise click.UsageError("--out: expected the name of a file, found an empty text; leave the option out for the default")
    target = Path(out or f"{kind}.toml")
    if example is None:
        text = starter(kind, device, out if out not in (None, "-") else f"{kind}.toml")
    if out == "-":
        click.echo(text, nl=False)
        return
    refuse_no_folder(target)
    if target.exists() and not overwrite:
        raise UsageError(f"{target}: the file exists; expected another --out FILE, or --overwrite to replace it")
    write_whole((target, text))
    click.echo(str(target), err=True)


def _example(name: str) -> str:
    """The text of an example."""
    found = {path.stem: path for path in sorted(bundled("sweeps/examples").glob("*.toml"))}
    _known(name, found, "example")
    return found[name].read_text(encoding="utf-8")


def _known(name: str, names: Iterable[str], what: str) -> None:
    if name not in names:
        meant = nearest(name, names)
        hint = f"; did you mean {meant}?" if meant else ""
        raise UsageError(f"{name} is no {what}; expected one of {', '.join(names)}{hint}")


def starter(kind: str, device: str | None, path: str) -> str:
    """The text of a spec with a controller of that kind; with a device, its numbers.

    path: the file's name in the commands that the text shows. Errors: KeyError if there is no such kind or device.
    """
    read = _read(kind)
    parts = (_head(kind, path), _loop(kind, device, read), _sweep(read), _bode(), _simulate(device))
    return "\n".join(line for part in parts for line in part) + "\n"


def _read(kind: str) -> frozenset[str]:
    """The keys that a loop of that kind reads if no gain is zero."""
    from wavesweep.loops.controllers import keys_of_page

    values = {path: KEYS[path].default for path in VALUE_PATHS}
    return keys_of_page(values | {"controller.kind": kind, "controller.Kp": 1.0})


def _head(kind: str, path: str) -> Iterator[str]:
    yield from _prose("A spec to begin with. Controller " + f"{kind}: {CONTROLLERS[kind].description}" + ".")
    yield "#"
    yield f"#     wavesweep check {path}      what is stable, and how far each number may go"
    yield f"#     wavesweep zwidth {path}     all stable walls"
    yield f"#     wavesweep bode {path}       what the hand feels"
    yield "#"
    yield from _prose(
        "A line `#key = value` shows a default: take the # away to set it. `wavesweep keys KEY` says more about a key."
    )


def _loop(kind: str, device: str | None, read: frozenset[str]) -> Iterator[str]:
    """The tables of the loop: keys that a design begins with, and the others that the loop reads as comments."""
    numbers = DEVICES[device].numbers if device else {}
    active = {path: value for path, value in CHOSEN.items() if path not in numbers} | {"controller.kind": kind}
    shown = read - {"rates.ratio"} | ({"rates.slow_hz"} if "rates.ratio" in read else set())
    notes = NOTES | _origins(device)
    if device:
        active["device.preset"], shown = device, shown | {"device.preset"}
        notes |= dict.fromkeys(DEVICES[device].unknown(), f"A GUESS, none is published for {device}: put your own")
    table = ""
    for path, key in KEYS.items():
        name, _, last = path.rpartition(".")
        if path in shown:
            if name != table:
                yield from ("", f"[{name}]")
                table = name
            default = numbers[path].value if path in numbers else key.default
            yield from _entry(last, key, active.get(path), default, notes.get(path, ""))


def _origins(device: str | None) -> dict[str, str]:
    """Path -> a note on the number of the device."""
    numbers = DEVICES[device].numbers if device else {}
    return {path: "ASSUMED, put your own" if n.assumed else f"from the preset {device}" for path, n in numbers.items()}


def _sweep(read: frozenset[str]) -> Iterator[str]:
    along = STUDY_KEYS["sweep.along"]
    yield from ("", "[sweep]", *_entry("along", along, None, along.default, "for `wavesweep stability-region`"))
    for symbol, axis in AXES.items():
        key = KEYS[SYMBOLS[symbol]]
        if key.path in read:
            yield from (*_prose(f"{key.unit}: {key.description}"), f"{symbol} = {axis}")


def _bode() -> Iterator[str]:
    span = ", ".join(f"{part} = {show(value)}" for part, value in DEFAULT_FREQUENCIES.written().items())
    key = STUDY_KEYS["bode.frequency_hz"]
    yield from ("", "[bode]", *_prose(f"{key.unit}: {key.description}"), f"#frequency_hz = {{ {span} }}")


def _simulate(device: str | None) -> Iterator[str]:
    numbers, notes = DEVICES[device].numbers if device else {}, _origins(device)
    defaults = {path: numbers[path].value if path in numbers else key.default for path, key in SIMULATE_KEYS.items()}
    yield from ("", "[simulate]")
    for path, default in defaults.items():
        if default is not None:
            yield from _entry(path.rpartition(".")[2], SIMULATE_KEYS[path], None, default, notes.get(path, ""))
    others = ", ".join(path.rpartition(".")[2] for path, default in defaults.items() if default is None)
    yield from _prose(f"Without a default: {others}. See `wavesweep keys simulate`.")


def _entry(name: str, key: Key, value: object, default: object, note: str) -> Iterator[str]:
    """A comment with unit, meaning, choices and note; then the key, as a comment with its default if there is no value."""
    unit = f"{key.unit}: " if key.unit not in ("", "1") else ""
    choices = f" ({', '.join(map(str, key.choices))})" if key.choices else ""
    yield from _prose(f"{unit}{key.description}{choices}{f'; {note}' if note else ''}")
    yield f"#{name} = {show(default)}" if value is None else f"{name} = {show(value)}"


def _prose(text: str) -> Iterator[str]:
    return (f"# {line}" for line in wrap(text, WIDTH))
