"""The JSON Schema (2020-12) of a spec, made from the tables of keys, so that an editor completes keys and marks slips.

It says what can be said of each key by itself: names, types, ranges, choices. What two keys say together is checked by `load`.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from wavesweep.spec.block_types import EVERY, PHASE, TICK_HZ, TYPES
from wavesweep.spec.classes import PARTS as OF_CLASS
from wavesweep.spec.design import WISHES
from wavesweep.spec.drawing_ports import OPTIONAL
from wavesweep.spec.drawing_ports import PORTS as OF_PORTS
from wavesweep.spec.drawing_tables import NUMBER_PARTS
from wavesweep.spec.experiment import FRAME_KEYS as OF_FRAME
from wavesweep.spec.for_all import LOST
from wavesweep.spec.keys import (
    AXIS_KEYS,
    DESIGN_KEYS,
    KEYS,
    MEASURED_KEYS,
    MESSAGES,
    REQUIRE_KEYS,
    SIMULATE_KEYS,
    STUDY_KEYS,
    SYMBOLS,
    Key,
)

Schema = dict[str, Any]
TEXT = {"type": "string"}
TERMS = {"type": ["string", "number"], "description": "expression that is linear in signals"}
OTHERS = {
    "list": {"items": TERMS, "minItems": 1},
    "rows": {"items": {"type": "array", "items": TERMS}},
    "ports": {"items": TEXT},
}


def _reference(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


AXIS, RANGE = _reference("axis"), _reference("range")  # of drawn loops


def schema() -> Schema:
    """Return the schema of a spec, of a controller or of a drawn loop, as nested dicts that JSON can hold."""
    axis = _axis(Key("axis", "number", None, "", "number of the drawn loop"))
    nested = {"anyOf": [axis, {"type": "object", "additionalProperties": AXIS}]}  # "numbers.k" may be a path of tables
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Spec of wavesweep",
        "oneOf": [_controlled(), _drawn()],
        "$defs": {
            "axis": nested,
            "range": {"anyOf": [_range(), _tables({}, RANGE)]},
            **{path: _value(key) for path, key in KEYS.items()},
            **{f"axis of {path}": _axis(key) for path, key in KEYS.items() if key.numeric},
            **{f"range of {path}": _range(key) for path, key in KEYS.items() if key.numeric},
        },
    }


def _controlled() -> Schema:
    named = {path: path for path, key in KEYS.items() if key.numeric} | SYMBOLS
    axes = {name: _reference(f"axis of {path}") for name, path in named.items()}
    ranges = {name: _reference(f"range of {path}") for name, path in named.items()}
    axes, ranges = axes | _nested(axes), ranges | _nested(ranges)
    loop = _nested({path: _reference(path) for path in KEYS})
    delay = loop["environment"]["properties"]["delay"]
    loop["environment"]["properties"]["delay"] = {"anyOf": [delay, {"const": "frame"}]}
    loop["controller"]["required"] = ["kind"]
    tables = loop | {
        "sweep": _tables(axes | SWEEP),
        "bode": _tables(axes | FREQUENCY),
        "for_all": _tables(ranges | {"lost": _value(LOST)}),
        "design": _design(_tables(axes), list(WISHES)),
    }
    return _tables(tables | _runs(), title="loop of a controller", required=["controller"])


def _drawn() -> Schema:
    number = _tables(dict.fromkeys(NUMBER_PARTS, TEXT) | {"value": {"type": ["number", "string"]}})
    end = {"anyOf": [TERMS, _tables({"signal": TERMS, "unit": TEXT}, required=["signal"])]}
    ports = {
        name: _tables(
            {part: {"type": "boolean"} if part == "turns" else TEXT for part in parts},
            required=[part for part in parts if part not in OPTIONAL],
        )
        for name, parts in OF_PORTS.items()
        if name in ("hand", "wall")
    }
    bode = FREQUENCY | {name: _value(STUDY_KEYS[f"bode.{name}"]) for name in ("from", "to")}
    wire = {"anyOf": [TERMS, _tables({}, TERMS)]}
    tables = {
        "rates": _tables({"tick_hz": _value(TICK_HZ, text=True)}),
        "numbers": _tables({}, {"anyOf": [{"type": ["number", "string"]}, number]}),
        "type": _tables({}, _tables({part: {"type": "object"} for part in OF_CLASS})),
        "block": _tables({}, {"oneOf": [*map(_block, TYPES), {"properties": {"type": {"not": {"enum": [*TYPES]}}}}]}),
        "signals": _tables({}, wire),
        "wire": _tables({}, {"anyOf": [TERMS, _tables({}, wire)]}),
        "ports": _tables(ports | {side: _tables({}, end) for side in ("inputs", "outputs")}),
        "sweep": _tables(SWEEP, AXIS),
        "bode": _tables(bode, AXIS),
        "for_all": _tables({"lost": {"anyOf": [_value(LOST), RANGE]}}, RANGE),
        "design": _design(_tables({}, AXIS), [wish for wish, kind in WISHES.items() if kind.ports is not None]),
    }
    own = {"properties": {"block": {"additionalProperties": {"properties": {"type": {"enum": [*TYPES]}}}}}}
    classes = {"if": {"required": ["type"]}, "else": own}  # whose names are types of blocks too
    return _tables(tables | _runs(), title="drawn loop", required=["rates", "block"]) | classes


def _block(kind: str) -> Schema:
    keys = {key.path: _value(key, text=True) for key in (*TYPES[kind].keys.values(), EVERY, PHASE)}
    required = [key.path for key in TYPES[kind].keys.values() if key.required]
    return _tables({"type": {"const": kind}, **keys}, required=["type", *required], description=TYPES[kind].description)


def _runs() -> Schema:
    """The tables that specs of both kinds have: [simulate] and [measured]."""
    simulate, frequency = _named(SIMULATE_KEYS), SIMULATE_KEYS["simulate.frequency_hz"]
    frame = _named(OF_FRAME) | {"required": ["ticks"]}
    several = [_value(frequency), _axis(frequency), {"type": "array", "maxItems": 0}]
    simulate["properties"]["frequency_hz"] = {"anyOf": several}
    simulate["properties"]["show"]["items"] = {"type": "string"}
    simulate["properties"]["frames"]["items"] = {"anyOf": [_value(OF_FRAME["ticks"]), frame]}
    late = {"type": "array", "items": {"type": ["integer", "string"]}, "minItems": 1}
    simulate["properties"]["messages"] = _tables({}, late, description=_described(SIMULATE_KEYS[MESSAGES]))
    return {"simulate": simulate, "measured": _named(MEASURED_KEYS)}


def _design(axes: Schema, wishes: Iterable[str]) -> Schema:
    """The table [design]; axes: the table of its numbers that vary."""
    wished = {}
    for name in wishes:
        kind = WISHES[name]
        options = {
            option: _value(key) if count == 1 else {"type": "array", "items": _value(key), "minItems": count or 1}
            for option, (key, count) in kind.options.items()
        }
        wished[name] = _tables({kind.bound: {"type": "number"}, **options}, description=_described(kind))
    values = {"type": "array", "items": {"type": "number"}, "minItems": 1}
    hand = _tables({path.partition(".")[2]: values for path in KEYS if path.startswith("operator.")})
    tables = {"vary": axes, "wish": _tables(wished), "for_all": _tables({"hand": hand}, AXIS)}
    return _tables(tables | _named(DESIGN_KEYS)["properties"])


def _named(keys: Mapping[str, Key]) -> Schema:
    """A table of keys by the last parts of their names."""
    return _tables({path.rpartition(".")[2]: _value(key) for path, key in keys.items()})


def _axis(key: Key) -> Schema:
    """The values of an axis: a list of them, or a span."""
    parts = {name: _value(part) for name, part in AXIS_KEYS.items()} | {"start": _value(key), "stop": _value(key)}
    values = {"type": "array", "items": _value(key), "minItems": 1}
    return {"anyOf": [values, _tables(parts, required=["start", "stop"])], "description": _described(key)}


def _range(key: Key | None = None) -> Schema:
    """A number of [for_all]: a range or values, which may vary from frame to frame; key: None for one of a drawn loop."""
    value, varying = _value(key) if key else {"type": "number"}, {"varying": {"type": "boolean"}}
    ends = _tables({"start": value, "stop": value, **varying}, required=["start", "stop"])
    values = _tables({"values": {"type": "array", "items": value, "minItems": 1}, **varying}, required=["values"])
    return {"anyOf": [ends, values, values["properties"]["values"]]} | ({"description": _described(key)} if key else {})


def _value(key: Key, *, text: bool = False) -> Schema:
    """The values of a key; text: whether a number may be an expression in numbers as well."""
    value: Schema = {"description": _described(key)}
    if key.default is not None and not isinstance(key.default, tuple):
        value["default"] = key.default
    if key.type in OTHERS:
        return value | {"type": "array"} | OTHERS[key.type]
    if key.choices:
        return value | {"enum": [*key.choices]}
    if key.low is not None:
        value["exclusiveMinimum" if key.above_low else "minimum"] = key.low
    if key.high is not None:
        value["maximum"] = key.high
    return value | {"type": [key.type, "string"] if text and key.numeric else key.type}


def _described(key: Any) -> str:
    """The description of a key or of a wish, with its unit."""
    return f"{key.description} ({key.unit})" if key.unit not in ("", "1") else key.description


def _nested(paths: Mapping[str, Schema]) -> Schema:
    """The properties of tables in tables that have these paths."""
    nested: Schema = {}
    for path, value in paths.items():
        *tables, last = path.split(".")
        here = nested
        for table in tables:
            here = here.setdefault(table, _tables({}))["properties"]
        here[last] = value
    return nested


def _tables(properties: Mapping[str, Schema], others: Schema | bool = False, **more: Any) -> Schema:
    """A table with these keys and, if `others` says what they hold, any further ones. more: as `required`, `description`."""
    return {"type": "object", "properties": dict(properties), "additionalProperties": others, **more}


SWEEP = {"along": _value(STUDY_KEYS["sweep.along"]), "require": _named(REQUIRE_KEYS)}
FREQUENCY = {"frequency_hz": _axis(STUDY_KEYS["bode.frequency_hz"])}
