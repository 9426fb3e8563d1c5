"""`wavesweep keys`."""

import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from shutil import get_terminal_size
from textwrap import wrap
from typing import Any

import click

from wavesweep.cli import block_keys
from wavesweep.cli.talk import talk
from wavesweep.errors import UsageError
from wavesweep.spec.checking import expectation, nearest, show
from wavesweep.spec.design import DESIGN_KEYS
from wavesweep.spec.devices import DEVICES, HapticDevice
from wavesweep.spec.keys import AXIS_KEYS, KEYS, STUDY_KEYS, SYMBOLS, Key, find_key

NARROWEST = 24  # letters of a meaning in a line
STUDIES = ("sweep", "bode")
AXES = {f"{study}.AXIS.{part}": key for study in STUDIES for part, key in AXIS_KEYS.items()}
TABLES = ("sweep", "bode", "simulate", "measured")
EVERY = KEYS | {path: key for table in TABLES for path, key in (STUDY_KEYS | AXES).items() if path.startswith(f"{table}.")}
EVERY |= {key.path: key for key in DESIGN_KEYS.values()}
EACH_AXIS = (
    f"AXIS is one of {' '.join(SYMBOLS)} or the path of any other number, such as device.damping. It takes a list of\n"
    "values, or { start, stop, num, scale }."
)


@click.command("keys")
@click.argument("name", metavar="[KEY]", required=False)
@click.option("--schema", is_flag=True, help="Print the JSON Schema of a spec, for editors.")
def command(name: str | None, schema: bool) -> None:
    """Explain the keys of a spec: values, units and defaults.

    KEY is a path (device.mass), a symbol (b), an axis (sweep.b) or a table (filters.lp1). Without it all keys are listed.
    `wavesweep keys device.preset` lists the devices with their numbers and the sources of these, `wavesweep keys block` the
    types of blocks of drawn loops. With --json the keys are printed as one JSON object.
    """
    as_json = talk().as_json
    if schema:
        from wavesweep.spec.schema import schema as of_specs

        click.echo(json.dumps(of_specs(), indent=1))
        return
    if name is not None and block_keys.is_drawn(name):
        click.echo(json.dumps(block_keys.record(name), indent=2) if as_json else "\n".join(block_keys.lines(name)))
        return
    found = _select(name)
    if as_json:
        click.echo(json.dumps({path: _record(path, key) for path, key in found.items()}, indent=2))
    elif len(found) == 1:
        click.echo("\n".join(_details(*next(iter(found.items())))))
    else:
        click.echo("\n".join(_table(found)))


def _select(name: str | None) -> dict[str, Key]:
    """The keys of that name, of its table, or of its axis; all of them if there is no name. Errors: UsageError."""
    if name is None:
        return EVERY
    path = SYMBOLS.get(name, name)
    if path in EVERY:
        return {path: EVERY[path]}
    found = {other: key for other, key in EVERY.items() if other.startswith(f"{path}.")}
    study, _, axis = path.partition(".")
    key = find_key(axis)
    if study in STUDIES and key is not None and key.numeric:
        whole = replace(
            key, default=None, description=f"axis over {key.path}, {key.description}: a list of values, or the parts below"
        )
        found = {path: whole, **{f"{path}.{part}": of_axis for part, of_axis in AXIS_KEYS.items()}}
    if not found:
        meant = nearest(name, SYMBOLS) or nearest(name, (*EVERY, *(other.rpartition(".")[0] for other in EVERY)))
        hint = f"; did you mean {meant}?" if meant else "; `wavesweep keys` lists all"
        raise UsageError(f"{name} is no key of a spec{hint}")
    return found


def _takes(key: Key) -> str:
    """The values of a key in words."""
    if key.choices:
        return ", ".join(map(str, key.choices))
    text = expectation(key).removeprefix("a ")
    return f"{text} and <= {key.high:g}" if key.high is not None else text


def _default(key: Key) -> str:
    return "required" if key.required else "" if key.default is None else show(key.default)


def _unit(key: Key) -> str:
    return "" if key.unit == "1" else key.unit


def _table(keys: Mapping[str, Key]) -> Iterator[str]:
    """Lines with a row for each key under the name of its table."""
    rows = [(path, _unit(key), _default(key)) for path, key in keys.items()]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    table, indent = None, sum(widths) + 6
    across = get_terminal_size((sys.maxsize, 0)).columns  # what is no terminal has lines of any length
    room = max(across - indent, NARROWEST)
    for (path, key), row in zip(keys.items(), rows, strict=True):
        if path.partition(".")[0] != table:
            if table is not None:
                yield ""
            table = path.partition(".")[0]
            yield f"[{table}]"
            if any(".AXIS." in other for other in keys if other.startswith(f"{table}.")):
                yield EACH_AXIS
        values = "" if _takes(key) in ("number", "string") else f" ({_takes(key)})"
        words = wrap(f"{key.description}{values}", room, break_on_hyphens=False)
        yield "  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)) + f"  {words[0]}"
        yield from (" " * indent + line for line in words[1:])
    yield ""
    yield "[design] has the tables vary, wish and for_all besides: `wavesweep keys design.vary` and so on."
    yield "What every answer has to hold for is in [for_all]: `wavesweep keys for_all`."
    yield "A spec can draw its loop without [controller]: `wavesweep keys block`, numbers, signals, wire, ports, rates.tick_hz."
    yield "Columns: key, unit, default, meaning and values. `wavesweep keys KEY` says more about a key."


def _details(path: str, key: Key) -> Iterator[str]:
    """Lines about one key."""
    yield f"{path}{f' ({_unit(key)})' if _unit(key) else ''}: {key.description}"
    yield f"  values: {_takes(key)}"
    yield f"  default: {_default(key) or 'none'}"
    symbol = _symbol(path)
    if symbol:
        yield f"  symbol: {symbol}, as in --set {symbol}=... and as an axis"
    if path in KEYS and key.numeric:
        yield f"  may be an axis of [sweep] and [bode]: {symbol or show(path)} = [...] or {{ start, stop, num, scale }}"
    for choice in key.choices if key.meanings else ():
        yield f"  {choice}: {key.meanings.get(choice, '')}".rstrip(": ")
        if path == "device.preset":
            yield from (f"    {line}" for line in _device(DEVICES[choice]))


def _device(device: HapticDevice) -> Iterator[str]:
    """Lines with the numbers of a device and their sources."""
    for path, number in device.numbers.items():
        mark = "assumed" if number.assumed else "source"
        yield f"{path} = {number.value:g} {EVERY[path].unit}; {mark}: {number.source}"
    yield from (f"{path}: not known, the spec has to give it" for path in device.unknown())
    if device.wall:
        stiffness, damping, source = device.wall
        yield f"recommended at 1 kHz: walls up to {stiffness:g} N/m, damping up to {damping:g} N*s/m; source: {source}"


def _symbol(path: str) -> str:
    return next((symbol for symbol, full in SYMBOLS.items() if full == path), "")


def _record(path: str, key: Key) -> dict[str, Any]:
    """A key as JSON; `choices` maps each value to its description."""
    record = {
        "type": key.type,
        "unit": _unit(key),
        "default": key.default,
        "required": key.required,
        "minimum": key.low,
        "above_minimum": key.above_low,
        "maximum": key.high,
        "choices": {str(choice): key.meanings.get(choice, "") for choice in key.choices} or None,
        "symbol": _symbol(path) or None,
        "axis": path in KEYS and key.numeric,
        "description": key.description,
    }
    return record | (
        {"devices": {name: _device_record(device) for name, device in DEVICES.items()}} if path == "device.preset" else {}
    )


def _device_record(device: HapticDevice) -> dict[str, Any]:
    wall = device.wall and dict(zip(("stiffness", "damping", "source"), device.wall, strict=True))
    numbers = {
        path: {"value": number.value, "unit": EVERY[path].unit, "source": number.source, "assumed": number.assumed}
        for path, number in device.numbers.items()
    }
    return {"title": device.title, "numbers": numbers, "not_known": list(device.unknown()), "recommended_wall": wall}
