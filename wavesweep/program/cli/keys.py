"""`wavesweep keys`."""

import json
import sys
from collections.abc import Iterator, Mapping
from shutil import get_terminal_size
from textwrap import wrap

import click

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import show
from wavesweep.program.cli import completions
from wavesweep.program.cli.entry import verbosity
from wavesweep.program.columns import TAKEN
from wavesweep.program.reading.keys import SYMBOLS
from wavesweep.program.reading.tables import tables
from wavesweep.program.spec import describing
from wavesweep.program.spec.describing import Description, default_of, meaning_of

EACH_AXIS = (
    f"AXIS is one of {' '.join(SYMBOLS)} or the path of any other number, such as device.damping. It takes a list of\n"
    "values, or { start, stop, num, scale }."
)
MORE = """
{}A spec can draw its loop without [controller]: `wavesweep keys block`, numbers, signals, wire, ports, rates.tick_hz.
Columns: key, unit, default, meaning and values. `wavesweep keys KEY` says more about a key."""


@click.command("keys")
@click.argument("name", metavar="[KEY]", required=False, shell_complete=completions.keys)
@click.option("--schema", is_flag=True, help="Print the JSON Schema of a spec, for editors.")
def command(name: str | None, schema: bool) -> None:
    """Explain the keys of a spec: values, units and defaults.

    KEY is a path (device.mass), a symbol (b), an axis (sweep.b) or a table (filters.lp1). Without
    it all keys are listed. `wavesweep keys device.preset` lists the devices with their numbers and
    the sources of these, `wavesweep keys block` the types of blocks of drawn loops. With --json the
    keys are printed as one JSON object.
    """
    if schema:
        from wavesweep.program.spec.schema import schema as of_specs

        click.echo(json.dumps(of_specs(), indent=1))
        return
    if name is None:
        descriptions = {
            path: describing.described(key, path) for path, key in describing.EVERY_KEY.items()
        }
    elif not (descriptions := describing.named(name)):
        meant = describing.meant(name)
        path = SYMBOLS.get(meant, meant)
        if meant:
            hint = f"; did you mean {meant}{f' ({path})' * (path != meant)}?"
        else:
            hint = "; `wavesweep keys` lists all"
        raise UsageError(f"{name} is no key, table or type of block of a spec{hint}")
    click.echo(
        json.dumps(descriptions, indent=2)
        if verbosity().as_json
        else "\n".join(_lines(descriptions))
    )


def _lines(descriptions: Mapping[str, Description]) -> Iterator[str]:
    path, first = next(iter(descriptions.items()))
    if "ports" in first:
        if len(descriptions) == 1:
            return _type(path, first)
        return _types(descriptions)
    if "type" not in first:
        return _own_names(path, first)
    if len(descriptions) == 1:
        return _details(path, first)
    return _table(descriptions)


def _table(keys: Mapping[str, Description]) -> Iterator[str]:
    """Lines with a row for each key under the name of its table."""
    rows = [(path, key["unit"], default_of(key)) for path, key in keys.items()]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    table, indent = None, sum(widths) + 6
    across = get_terminal_size(
        (sys.maxsize, 0)
    ).columns  # what is no terminal has lines of any length
    room = max(across - indent, 24)  # letters of a meaning in a line
    for (path, key), row in zip(keys.items(), rows, strict=True):
        if path.partition(".")[0] != table:
            yield from [""] * (table is not None)
            table = path.partition(".")[0]
            yield f"[{table}]"
            if any(".AXIS." in path for path in keys if path.startswith(f"{table}.")):
                yield EACH_AXIS
        words = wrap(meaning_of(key), room, break_on_hyphens=False)
        yield (
            "  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True))
            + f"  {words[0]}"
        )
        yield from (" " * indent + line for line in words[1:])
    hints = [table.hint for _, table in sorted(tables().items()) if table.hint]
    yield MORE.format("".join(f"{hint}\n" for hint in hints))


def _details(path: str, key: Description) -> Iterator[str]:
    """Lines about one key."""
    symbol, unit = key["symbol"], f" ({key['unit']})" if key["unit"] else ""
    yield f"{path}{unit}: {key['description']}"
    yield f"  values: {key['values']}"
    yield f"  default: {default_of(key) or 'none'}"
    if symbol:
        yield f"  symbol: {symbol}, as in --set {symbol}=... and as an axis"
    if key["axis"]:
        yield f"  may be an axis of [sweep] and [bode]: {symbol or show(path)} = [...] or {{ start, stop, num, scale }}"
    choices = key["choices"] or {}
    for choice, meaning in choices.items() if any(choices.values()) else ():
        yield f"  {choice}: {meaning}".rstrip(": ")
        if "devices" in key:
            yield from (f"    {line}" for line in _device(key["devices"][choice]))


def _device(device: Description) -> Iterator[str]:
    """Lines with the numbers of a device and their sources."""
    for path, number in device["numbers"].items():
        mark = "assumed" if number["assumed"] else "source"
        yield f"{path} = {number['value']:g} {number['unit']}; {mark}: {number['source']}"
    yield from (f"{path}: not known, the spec has to give it" for path in device["not_known"])
    if wall := device["recommended_wall"]:
        limits = f"walls up to {wall['stiffness']:g} N/m, damping up to {wall['damping']:g} N*s/m"
        yield f"recommended at 1 kHz: {limits}; source: {wall['source']}"


def _own_names(name: str, table: Description) -> Iterator[str]:
    """Lines about a table with names of the user's own."""
    yield (
        f"{name}: {table['description']}"
        if name.startswith("rates")
        else f"[{name}]  {table['description']}"
    )
    for wish, kind in table.get("wishes", {}).items():
        if kind["unit"] == "1":
            unit = "without unit"
        else:
            unit = kind["unit"] or "of output per input"
        options = f"; options: {', '.join(kind['options'])}" if kind["options"] else ""
        yield f"  {wish} ({unit}, {kind['bound']}): {kind['description']}{options}"
    if name == "numbers":
        yield f"  names of columns of tables, which are taken: {', '.join(sorted(TAKEN))}"


def _types(types: Mapping[str, Description]) -> Iterator[str]:
    """Lines about all types of blocks."""
    width = max(map(len, types)) - len("block.")
    yield "[block.NAME]  type = one of"
    for path, kind in types.items():
        yield f"  {path.removeprefix('block.'):{width}}  {kind['ports']}"
        yield f"  {'':{width}}    {kind['description']}"
    yield "Each has every and phase too. `wavesweep keys block.TYPE` lists the keys of a type."


def _type(path: str, kind: Description) -> Iterator[str]:
    """Lines about one type of block."""
    yield f'type = "{path.removeprefix("block.")}": {kind["description"]}'
    yield f"  ports: {kind['ports']}"
    yield f"  where steps vary: {kind['steps']}"
    for name, key in kind["keys"].items():
        unit = f" {key['unit']}" if key["unit"] else ""
        default = default_of(key)
        if not default:
            default = "absent by default"
        elif default != "required":
            default = f"by default {default}"
        yield f"  {name}: {key['description']} ({key['values']}{unit}; {default})"
    yield "  every key that is a number takes an expression in numbers, as text"
