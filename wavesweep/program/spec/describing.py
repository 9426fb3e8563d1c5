"""One description of each key, table and type of block, from which `wavesweep keys`, `init` and
the documents are made."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wavesweep.engine.drawing import TICK_HZ, TYPES
from wavesweep.engine.keys import Key, expectation, nearest, show
from wavesweep.program.reading.keys import (
    AXIS_KEYS,
    DEVICES,
    HARDWARE_KEYS,
    KEYS,
    SYMBOLS,
    HapticDevice,
    find_key,
)
from wavesweep.program.reading.matrix_files import keys_of
from wavesweep.program.reading.tables import study_keys, study_tables, tables
from wavesweep.program.spec.shipped_classes import shipped_classes

Description = dict[str, Any]
STUDIES = ("sweep", "bode")
_AXES = {f"{study}.AXIS.{part}": key for study in STUDIES for part, key in AXIS_KEYS.items()}
_OF_STUDIES = {
    path: key
    for table in study_tables()
    for path, key in (study_keys() | _AXES).items()
    if path.startswith(f"{table}.")
}
EVERY_KEY: Mapping[str, Key] = {**KEYS, **_OF_STUDIES}
# Tables with names of the user's own.
_TABLES = {
    "numbers": "numbers of a drawn loop: NAME = value, or { value = ..., unit = ..., description = ... }; each may be an axis, "
    'and so may a number in a block, "block.NAME.KEY"; NAME = "expression" follows from other numbers, which may be axes',
    "type": "classes of blocks: [type.NAME.block.motor], and tables numbers, signals, wire and ports = { inputs = [names], "
    "outputs = { name = expression } } of the same; a block of that type gives its numbers",
    "signals": 'names of signals: NAME = "expression", for wires and ports',
    "wire": 'wires: "block.port" = "expression", linear in the outputs of blocks ("block.port"), in [signals] and '
    "signals from outside, of the same tick; prev(...) is a signal as it was before the tick; terms between plants act "
    "continuously, all others at a plant are held over a tick",
    "ports": "hand = { force = NAME, displacement = expression, reaction = expression, turns or volts = true } for bode, "
    "passivity and simulate, if they are a torque and an angle, or a voltage and a charge; of several axes, both are lists; "
    "environment = { force = NAME, displacement = expression }, a second port that passivity takes together with the hand's; "
    "wall = { stiffness = number, damping = number } for zwidth; "
    "inputs = { NAME = signal }, signals from outside that wires read, as { ref = 'ref' }, "
    "and outputs = { NAME = expression }, each perhaps { signal = ..., unit = ... }, for bode, simulate and to_control",
    "rates.tick_hz": f"{TICK_HZ.description} (Hz): {expectation(TICK_HZ)}, or an expression in numbers",
}
_OF_CAPABILITIES = {
    path: each
    for table in sorted(tables().values(), key=lambda each: each.path)
    for path, each in table.described.items()
}
TABLES: Mapping[str, Description] = {
    path: {"description": text} for path, text in _TABLES.items()
} | _OF_CAPABILITIES


def symbol_of(path: str) -> str:
    """Return the symbol that is short for a path, empty without one."""
    return next((symbol for symbol, full in SYMBOLS.items() if full == path), "")


def described(key: Key, path: str = "") -> Description:
    """Return what is to be said of a key: `values` in words, `choices` with the meaning of each,
    and its other attributes.

    path: of the key in a spec, its own by default.
    """
    path = path or key.path
    description: Description = {
        "type": key.type,
        "unit": "" if key.unit == "1" else key.unit,
        "default": list(key.default) if isinstance(key.default, tuple) else key.default,
        "required": key.required,
        "minimum": key.low,
        "above_minimum": key.above_low,
        "maximum": key.high,
        "values": _values(key),
        "choices": {str(choice): key.meanings.get(choice, "") for choice in key.choices} or None,
        "symbol": symbol_of(path) or None,
        "axis": path in KEYS and key.numeric,
        "description": key.description,
    }
    if path == "device.preset":
        description["devices"] = {name: _device(device) for name, device in DEVICES.items()}
    return description


def _values(key: Key) -> str:
    lists = {
        "list": "list of numbers" if "." not in key.path else "list",
        "rows": "list of rows",
        "ports": "list of names",
    }
    limit = f" and <= {key.high:.16g}" if key.high is not None else ""
    return (
        ", ".join(map(str, key.choices))
        or lists.get(key.type)
        or expectation(key).removeprefix("a ") + limit
    )


def _device(device: HapticDevice) -> Description:
    wall = device.wall and dict(zip(("stiffness", "damping", "source"), device.wall, strict=True))
    numbers = {
        path: {
            "value": number.value,
            "unit": (KEYS | HARDWARE_KEYS)[path].unit,
            "source": number.source,
            "assumed": number.assumed,
        }
        for path, number in device.numbers.items()
    }
    return {
        "title": device.title,
        "numbers": numbers,
        "not_known": list(device.unknown()),
        "recommended_wall": wall,
    }


def default_of(description: Description) -> str:
    """Return the default of a key in the notation of a spec; empty if it may be absent."""
    if description["required"]:
        return "required"
    if description["default"] is None:
        return ""
    return show(description["default"])


def meaning_of(description: Description) -> str:
    """Return the meaning of a key and, unless any number or text will do, its values."""
    if description["values"] in ("number", "string"):
        values = ""
    else:
        values = f" ({description['values']})"
    return f"{description['description']}{values}"


def named(name: str) -> dict[str, Description]:
    """Return the descriptions of what a name stands for, by path: a key, a table, an axis, or types
    of blocks.

    Those of a type have `ports`, `steps` and `keys`, those of a table with names of the user's own
    neither `type` nor `ports`. Empty for an unknown name.
    """
    path = SYMBOLS.get(name, name)
    if (
        path in study_keys() and path in EVERY_KEY
    ):  # also one in a table with names of the user's own
        return {path: described(EVERY_KEY[path], path)}
    if table := next(
        (table for table in TABLES if path == table or path.startswith(f"{table}.")), ""
    ):
        return {table: TABLES[table]}
    if blocks := _blocks(path):
        return blocks
    if path in EVERY_KEY:
        return {path: described(EVERY_KEY[path], path)}
    study, _, axis = path.partition(".")
    if study in STUDIES and (key := find_key(axis)) and key.numeric:
        text = f"axis over {key.path}, {key.description}: a list of values, or the parts below"
        axis_keys = {
            f"{path}.{name_of_part}": described(key_of_part, f"{path}.{name_of_part}")
            for name_of_part, key_of_part in AXIS_KEYS.items()
        }
        return {path: described(key, path) | {"default": None, "description": text}} | axis_keys
    return {
        known_path: described(key, known_path)
        for known_path, key in EVERY_KEY.items()
        if known_path.startswith(f"{path}.")
    }


def _blocks(path: str) -> dict[str, Description]:
    """Return the descriptions of all types of blocks, of one type, or of a class; empty for any
    other path."""
    if path == "block":
        return {f"block.{kind}": _type(kind) for kind in TYPES}
    if path.startswith("block.") and path[6:] in TYPES:
        return {path: _type(path[6:])}
    if path.startswith("block.") and path[6:] in (classes := shipped_classes()):
        return {path: _class(classes[path[6:]])}
    return {}


def meant(name: str) -> str:
    """Return the known name that is nearest to an unknown one; empty if no name is near."""
    if name.startswith("block."):
        near = nearest(name.removeprefix("block."), (*TYPES, *shipped_classes()))
        return near and f"block.{near}"
    tables = (known_path.rpartition(".")[0] for known_path in EVERY_KEY)
    return nearest(name, SYMBOLS) or nearest(name, (*EVERY_KEY, *tables, *TABLES))


def _class(file: Path) -> Description:
    """The description of a class of blocks that a capability has: the first paragraph of its
    file, ports and numbers."""
    text = file.read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    numbers = {
        name: number for name, number in tables["numbers"].items() if isinstance(number, dict)
    }
    keys = {
        name: Key(name, "number", number["value"], number["unit"], number["description"])
        for name, number in numbers.items()
    }
    ports = tables["ports"]
    return {
        "description": text.partition("\n#\n")[0]
        .partition("\n\n")[0]
        .removeprefix("# ")
        .replace("\n# ", " ")
        .rstrip("."),
        "ports": f"{', '.join(ports['inputs'])} -> {', '.join(ports['outputs'])}",
        "steps": "as those of its blocks",
        "keys": {name: described(key) for name, key in keys.items()},
    }


def _type(name: str) -> Description:
    kind = TYPES[name]
    if isinstance(kind.ports, Mapping):
        pairs = kind.ports.values()
    else:
        pairs = [kind.ports or (("inputs",), ("outputs",))]
    return {
        "description": kind.description,
        "ports": "; or ".join(
            f"{', '.join(inputs)} -> {', '.join(outputs)}" for inputs, outputs in pairs
        ),
        "steps": kind.steps or ("runs in every tick" if kind.plant else "refused"),
        "keys": {key.path: described(key) for key in keys_of(name).values()},
    }
