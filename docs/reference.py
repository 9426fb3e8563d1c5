"""What the site says of commands, keys, blocks, tables, doubts, summaries and the library, made from the program itself.

It stands in no file: as the site is built, it takes the place of lines such as `<!-- from the code: keys -->` of the pages.
`python docs/reference.py` draws the figures of the pages anew.
"""

from __future__ import annotations

import inspect
import io
import json
import re
import shlex
import tempfile
import tomllib
from collections import Counter
from contextlib import chdir, redirect_stdout
from dataclasses import replace
from importlib import import_module
from itertools import chain
from pathlib import Path

import click

import wavesweep
from wavesweep.capabilities import library_names, of_library
from wavesweep.program.cli import main
from wavesweep.program.cli.entry import COMMANDS, group
from wavesweep.program.spec import describing

HERE = Path(__file__).parent
README = HERE.parent / "README.md"
GALLERY = HERE / "gallery.md"
MARK = re.compile(r"^<!-- from the code: (\w+) -->$", re.MULTILINE)
# modules of the checker, in the order of reading
CHECKER = (
    "file coverage frame drifts reader.for_all reader.controllers reader.drawings reader.filters form contact gain port channel"
)
CHECKER += " factor"
SHARED = 3  # commands: an option that so many have is explained once, for all of them


def filled(text: str) -> str:
    """The text of a page with what the program says in the place of its marks."""
    return MARK.sub(lambda mark: MADE[mark[1]](), text)


def install() -> str:
    """How the README says to install."""
    return README.read_text(encoding="utf-8").partition("\n## Install\n")[2].partition("\n## ")[0].strip()


def commands() -> str:
    """Every command with its usage, help and options."""
    context = click.Context(group, info_name="wavesweep")
    found = {name: group.get_command(context, name) for name in COMMANDS}
    options = {name: [each for each in command.params if isinstance(each, click.Option)] for name, command in found.items()}
    often = Counter((each.opts[0], each.help) for each in chain(*options.values()))
    shared = {key: each for each in chain(*options.values()) if often[key := (each.opts[0], each.help)] >= SHARED}
    parts = [_rows(("command", "what it does"), [(f"[`{name}`](#wavesweep-{name})", _plain(COMMANDS[name])) for name in found])]
    parts += ["## Options of several commands", _options(shared.values())]
    for name, command in found.items():
        own = [each for each in options[name] if (each.opts[0], each.help) not in shared]
        rest = [f"`{each.opts[0]}`" for each in options[name] if (each.opts[0], each.help) in shared]
        usage = " ".join(command.collect_usage_pieces(click.Context(command)))
        parts += [f"## wavesweep {name}", f"    wavesweep {name} {usage}", *_paragraphs(command.help)]
        parts += [_options(own)] * bool(own)
        parts += [f"And {', '.join(rest)}, which [several commands have](#options-of-several-commands)."] * bool(rest)
    return "\n\n".join(parts)


def _paragraphs(text):
    """The paragraphs of a help; those that click is told not to wrap are code."""
    for part in inspect.cleandoc(text).split("\n\n"):
        kept = part.removeprefix("\b\n")
        yield _plain(part) if kept == part else "\n".join(f"    {line}" for line in kept.split("\n"))


def _options(options) -> str:
    rows = []
    for each in options:
        name, metavar = each.opts[0], each.make_metavar(click.Context(click.Command("")))
        words = " / ".join(f"`{word}`" for word in (*each.opts, *each.secondary_opts))
        takes = "" if each.is_flag else f" `{metavar}`"
        default = f" Default: {each.default}." if each.show_default and isinstance(each.default, str | int) and takes else ""
        rows.append((f"{words}{takes}", _plain((each.help or name) + default)))
    return _rows(("option", "meaning"), rows)


def keys() -> str:
    """Every key of a spec, by table: unit, default, values and meaning."""
    found, parts = {path: describing.described(key, path) for path, key in describing.EVERY_KEY.items()}, []
    for table in dict.fromkeys(path.split(".")[0] for path in found):
        parts += [f"## [{table}]", _keys({path: key for path, key in found.items() if path.split(".")[0] == table})]
    return "\n\n".join([*parts, *_drawing()])


def _keys(found) -> str:
    """A row for each key."""
    rows = [(f"`{name}`", _plain(key["unit"]), _default(key), _values(key), _meaning(key)) for name, key in found.items()]
    return _rows(("key", "unit", "default", "values", "meaning"), rows)


def _drawing():
    """The tables of a drawn loop, [for_all] and those of [design], which hold names of the user's own."""
    for table in ("numbers", "wire", "ports", "for_all", "design.vary", "design.wish"):
        found = describing.named(table)[table]
        yield f"## [{table}]"
        yield _plain(found["description"])
        if wishes := found.get("wishes"):
            rows = [
                (f"`{name}`", _unit(wish["unit"]), f"`{wish['bound']}`", _words(wish["options"]), _plain(wish["description"]))
                for name, wish in wishes.items()
            ]
            yield _rows(("wish", "unit", "bound", "options", "meaning"), rows)


def devices() -> str:
    """The devices of `device.preset`, each number with its source."""
    rows = []
    for name, device in describing.named("device.preset")["device.preset"]["devices"].items():
        for path, number in device["numbers"].items():
            source = _plain(number["source"])
            value = f"{number['value']:g} {_unit(number['unit'])}"
            rows.append((f"`{name}`", f"`{path}`", value, f"assumed: {source}" if number["assumed"] else source))
    return _rows(("device", "key", "value", "source"), rows)


def blocks() -> str:
    """Every type of block with its ports and keys."""
    parts = []
    for path, kind in describing.named("block").items():
        parts += [f"## {path.removeprefix('block.')}", f"{_plain(kind['description'])}. Ports: {_plain(kind['ports'])}"]
        parts += [_keys(kind["keys"])]
    return "\n\n".join(parts)


def steps() -> str:
    """What every type of block does where the steps between its runs vary."""
    found = describing.named("block").items()
    return _rows(("type", "run j"), [(f"`{path.removeprefix('block.')}`", _plain(kind["steps"])) for path, kind in found])


def columns() -> dict[str, tuple]:
    """The columns of every table."""
    from wavesweep.program.tables import kinds

    return {name: kind.fields for name, kind in kinds().items() if kind.fields}


def tables() -> str:
    """Every table with its columns: kind, unit and meaning. Tables with the same columns stand together."""
    named: dict[tuple, list[str]] = {}
    for name, fields in columns().items():
        named.setdefault(fields, []).append(name)
    parts = []
    for fields, names in named.items():
        rows = [
            (
                f"`{each.name}`",
                each.kind,
                _unit(each.unit),
                _column(each, "with guarantees for hands" if each.optional and any("-hands" in name for name in names) else ""),
            )
            for each in fields
        ]
        parts += [f"## {', '.join(names)}", _rows(("column", "kind", "unit", "meaning"), rows)]
    return "\n\n".join(parts)


def _column(field, only: str) -> str:
    """The meaning of a column, of the words in it, and what a reader can do."""
    values = "; ".join(f"`{word}`: {_plain(meaning)}" for word, meaning in field.values.items())
    said = [_plain(field.description) + (f" ({only})" if only else ""), values, _plain(field.advice)]
    return ". ".join(part.rstrip(".") for part in said if part)


def doubts() -> str:
    """The words of the column `doubt`."""
    from wavesweep.program.tables.fields import DOUBTS

    rows = [(f"`{word}`", _plain(each.meaning), _plain(each.advice)) for word, each in DOUBTS.items() if word]
    return _rows(("word", "meaning", "what to do"), rows)


SAMPLE = """[controller]
kind = "pmw"
[sweep]
B_VE = [1, 2]
[simulate]
input = "pulse"
duration_s = 1
wall = 0.001
late = 3
max_force = 1
[design]
generations = 1
population = 8
[design.vary]
b = { start = 5, stop = 50 }
[design.wish]
z_width = { B_VE = [1] }
"""
SAMPLED = {
    "zwidth": "zwidth mine.toml",
    "stability-region": "stability-region mine.toml --set 'sweep.b={start=5, stop=50}'",
    "bode": "bode mine.toml",
    "simulate": "simulate mine.toml",
    "passivity": "passivity mine.toml",
    "why": "why mine.toml --set environment.integration=explicit",
    "margins": "margins mine.toml --cut avatar.out",
    "poles": "poles mine.toml",
    "design": "design mine.toml",
    "identify": "identify pushed.csv --friction",
    "check": "check mine.toml",
    "export": "export mine.toml --to c",
    "verify": "verify results/mine",
}


def summaries() -> str:
    """What commands print with --json for a small spec."""
    parts = [f"`mine.toml`:\n\n```toml\n{SAMPLE}```"]
    for name, line, printed in sampled():
        parts += [f"#### `{name} --json`", f"    wavesweep {line} --json", f"```json\n{_laid_out(_short(printed))}\n```"]
    return "\n\n".join(parts)


def sampled():
    """Yield the name of each command that has --json, a line that runs it, and the object that it prints."""
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        Path("mine.toml").write_text(SAMPLE, encoding="utf-8")
        Path("pushed.csv").write_bytes((HERE.parent / "sweeps/examples/pushed.csv").read_bytes())
        for name, line in SAMPLED.items():
            words = shlex.split(line)
            yield name, line, _printed(*words, *(["--no-plot"] if "--no-plot" in switches(name) else []))


def switches(name: str) -> set[str]:
    """All options of a command, in every spelling."""
    command = group.get_command(click.Context(group), name)
    return {word for each in command.params for word in (*each.opts, *each.secondary_opts)}


def _short(found, most=3):
    """A summary without the tails of long texts, lists and numbers."""
    if isinstance(found, dict):
        return {name: 0.1 if name == "seconds" else _short(value) for name, value in found.items()}
    if isinstance(found, list):
        return [_short(value) for value in found[:most]] + ["…"] * (len(found) > most)
    if isinstance(found, float):
        return float(f"{found:.6g}")
    return f"{found[:57]}…" if isinstance(found, str) and len(found) > 60 else found


def _laid_out(found, indent="", wide=110):
    """JSON with a line for whatever fits into one."""
    line = json.dumps(found, ensure_ascii=False)
    if not isinstance(found, dict) or len(line) + len(indent) <= wide:
        return line
    inner = f"{indent}  "
    rows = [f"{inner}{json.dumps(name)}: {_laid_out(value, inner)}" for name, value in found.items()]
    return "{\n" + ",\n".join(rows) + f"\n{indent}}}"


SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}\n", re.MULTILINE)  # of a docstring, whose line would make it a heading of the page
ENTRY = re.compile(r"^(\S.*)\n?((?: .*\n?)*)", re.MULTILINE)
OF_FILES = ("read", "read_table", "verify")  # of wavesweep.program.results: the rest writes what a run has computed


def library() -> str:
    """Every public name of the package with its signature and docstring."""
    parts = []
    for name, each in public():
        parts.append(f"### {name}" if name.startswith("Loop.") else f"## wavesweep.{name}")
        if not inspect.isclass(each):
            signature = inspect.signature(each)
            given = [each.replace(annotation=inspect.Parameter.empty) for each in parameters(each)]
            call = signature.replace(parameters=given, return_annotation=inspect.Signature.empty)
            parts.append(f"    {name.rpartition('.')[2]}{call}")
        said, found = sections(each)
        parts += [_plain(said), *(part for title, text in found.items() for part in (f"**{title}**", _section(title, text)))]
    return "\n\n".join(parts)


def public():
    """Yield the public names of the package, those of methods of a compiled loop too, and what they name."""
    found = {name: getattr(wavesweep, name) for name in wavesweep.__all__}
    for name, each in ({"Loop": found.pop("Loop")} | found).items():
        if inspect.ismodule(each):
            yield from ((f"{name}.{inner}", getattr(each, inner)) for inner in OF_FILES)
        elif callable(each):
            yield name, each
        if name == "Loop":  # a spec is made by `load`, and its methods are for the program
            own = {method: call for method, call in vars(each).items() if inspect.isfunction(call) and method[0] != "_"}
            own |= {method: of_library(f"{name}.{method}") for method in library_names(name)}
            yield from ((f"{name}.{method}", call) for method, call in own.items())


def parameters(call):
    """The parameters of a call but for the loop that it is a method of."""
    return [each for each in inspect.signature(call).parameters.values() if each.name != "self"]


def sections(each):
    """What a docstring says first, and the text of each section of numpydoc by its title."""
    said, *parts = SECTION.split(inspect.getdoc(each))
    return said.strip(), dict(zip(parts[::2], parts[1::2], strict=True))


def entries(text):
    """The entries of a section: names, type and meaning of each; what is not named has its type alone."""
    for head, meaning in ENTRY.findall(text):
        names, _, kind = head.partition(" : ")
        yield names, kind, " ".join(meaning.split())


def _section(title, text) -> str:
    if title == "Examples":
        return f"```pycon\n{text.strip()}\n```"
    if title == "Notes":
        return _plain(text.strip())
    return "\n".join(
        f"- `{names}`" + f" *{_plain(kind)}*" * bool(kind) + f": {_plain(meaning)}" * bool(meaning)
        for names, kind, meaning in entries(text)
    )


def lines_before(name: str) -> list[str]:
    """The commands before a figure of the gallery."""
    before = GALLERY.read_text("utf-8").partition(f"(figures/{name}.png)")[0].rpartition("\n\n![")[0]
    shown = before.rpartition("\n\n")[2]
    return [line.removeprefix("    wavesweep ") for line in shown.splitlines()]


def draw(name: str) -> bytes:
    """The PNG that the commands before a figure of the gallery draw, of the table of this name if there are several."""
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        Path("sweeps").symlink_to(HERE.parent / "sweeps")
        for line in lines_before(name):
            if code := main([*shlex.split(line), "--quiet"]):
                raise RuntimeError(f"wavesweep {line}: exit code {code}")
        found = {path.stem: path for path in Path("results").rglob("*.png")}
        return found.get(name, next(iter(found.values()))).read_bytes()


def draw_loop(name: str) -> bytes:
    """The SVG of a controller's loop with the defaults of its keys, and with the gain Kp if it may have one; or of a page."""
    page = HERE / f"{name}.md"
    if page.exists():
        tables = tomllib.loads(page.read_text(encoding="utf-8").split("```toml\n")[1].split("```")[0])
    else:
        waves = {"Kp": 20.0} if name.startswith("pmw") else {}
        tables = {"controller": {"kind": name, **waves}}
    import matplotlib as mpl

    from wavesweep.program.plots import diagram

    picture = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name}):
        canvas = diagram(replace(wavesweep.load(tables), name="the loop"))
        canvas.savefig(picture, format="svg", metadata={"Date": None}, facecolor="white")
    return "\n".join(line.rstrip() for line in picture.getvalue().splitlines()).encode() + b"\n"


def proofs() -> str:
    """The format of proof files, the memory of loops and the inequalities, as the modules of the checker have them."""
    parts = []
    for name in CHECKER.split():
        first, _, rest = inspect.getdoc(import_module(f"wavesweep.checker.{name}")).partition("\n")
        parts += [f"## {_plain(first.rstrip('.'))}", "\n".join(f"    {line}" for line in rest.strip().split("\n"))]
    return "\n\n".join(parts)


PARTS = install, commands, keys, devices, blocks, steps, tables, doubts, summaries, library, proofs
MADE = {made.__name__: made for made in PARTS}


def _printed(*words):
    """The object that a command prints with --json."""
    out = io.StringIO()
    with redirect_stdout(out):
        code = main([*words, "--json"])
    if code:
        raise RuntimeError(f"wavesweep {' '.join(words)} --json: exit code {code}")
    return json.loads(out.getvalue())


def _rows(head, rows) -> str:
    lines = [head, ["---"] * len(head), *rows]
    cells = [[re.sub(r"(?<!\\)\|", r"\|", " ".join(cell.split())) for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def _plain(text: str) -> str:
    """A text of the program as Markdown that shows it as it is; what stands in backticks is code."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(part if index % 2 else re.sub(r"([\\*<|\[\]$])", r"\\\1", part) for index, part in enumerate(parts))


def _unit(unit):
    return "" if unit == "1" else _plain(unit)


def _words(names):
    return ", ".join(f"`{name}`" for name in names)


def _default(key):
    shown = describing.default_of(key)
    return shown if shown in ("", "required") else f"`{shown.strip(chr(34))}`"


def _values(key):
    return _words(key["choices"]) if key["choices"] else _plain(key["values"])


def _meaning(key):
    """The meaning of a key, and of its values if these have one."""
    meanings = [f"`{each}`: {_plain(meaning)}" for each, meaning in (key["choices"] or {}).items() if meaning]
    symbol = [f"symbol `{key['symbol']}`"] if key["symbol"] else []
    return "; ".join([_plain(key["description"]), *symbol, *meanings])


if __name__ == "__main__":
    for path in sorted((HERE / "figures").iterdir()):
        path.write_bytes(draw(path.stem) if path.suffix == ".png" else draw_loop(path.stem))
