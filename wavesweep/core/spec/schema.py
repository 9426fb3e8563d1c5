"""The JSON Schema (2020-12) of a spec, made from the tables of keys, so that an editor completes keys and marks slips.

It says what can be said of each key by itself: names, types, ranges, choices. What two keys say together is checked by `load`.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from wavesweep.core.drawing.block_types import EVERY, PHASE, TICK_HZ, TYPES
from wavesweep.core.drawing.classes import PARTS as OF_CLASS
from wavesweep.core.drawing.drawing_ports import NAMED, OPTIONAL
from wavesweep.core.drawing.drawing_ports import PORTS as OF_PORTS
from wavesweep.core.drawing.drawing_tables import NUMBER_PARTS
from wavesweep.core.reading.keys import AXIS_KEYS, KEYS, STUDY_KEYS, SYMBOLS, Key
from wavesweep.designs.wish_keys import WISHES
from wavesweep.for_all.keys import LOST
from wavesweep.simulation.keys import FRAME_KEYS as OF_FRAME

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
    numeric = {path: key for path, key in KEYS.items() if key.numeric}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Spec of wavesweep",
        "oneOf": [_controlled(), _drawn()],
        "$defs": {
            "axis": {"anyOf": [axis, _tables({}, AXIS)]},  # "numbers.k" may be a path of tables
            "range": {"anyOf": [_range(), _tables({}, RANGE)]},
            **{path: _value(key) for path, key in KEYS.items()},
            **{f"axis of {path}": _axis(key) for path, key in numeric.items()},
            **{f"range of {path}": _range(key) for path, key in numeric.items()},
        },
    }


def _controlled() -> Schema:
    named = {path: path for path, key in KEYS.items() if key.numeric} | SYMBOLS
    axes, ranges = ({name: _reference(f"{kind} of {path}") for name, path in named.items()} for kind in ("axis", "range"))
    tables = _nested({path: _reference(path) for path in KEYS})
    tables["environment"]["properties"]["delay"] = {"anyOf": [_reference("environment.delay"), {"const": "frame"}]}
    tables["controller"]["required"] = ["kind"]
    tables |= _studies(axes | _nested(axes), ranges | _nested(ranges), WISHES)
    del tables["bode"]["properties"]["from"], tables["bode"]["properties"]["to"]
    return _tables(tables, title="loop of a controller", required=["controller"])


def _drawn() -> Schema:
    number = _tables(dict.fromkeys(NUMBER_PARTS, TEXT) | {"value": {"type": ["number", "string"]}})
    end = {"anyOf": [TERMS, _tables({"signal": TERMS, "unit": TEXT}, required=["signal"])]}
    ports = {
        name: _tables(
            {part: {"type": "boolean"} if part == "turns" else TEXT for part in parts},
            required=[part for part in parts if part not in OPTIONAL],
        )
        for name, parts in OF_PORTS.items()
    } | {side: _tables({}, end) for side in NAMED}
    wire = {"anyOf": [TERMS, _tables({}, TERMS)]}
    tables = {
        "rates": _tables({"tick_hz": _value(TICK_HZ, text=True)}),
        "numbers": _tables({}, {"anyOf": [{"type": ["number", "string"]}, number]}),
        "type": _tables({}, _tables({part: {"type": "object"} for part in OF_CLASS})),
        "block": _tables({}, {"oneOf": [*map(_block, TYPES), {"properties": {"type": {"not": {"enum": [*TYPES]}}}}]}),
        "signals": _tables({}, wire),
        "wire": _tables({}, {"anyOf": [TERMS, _tables({}, wire)]}),
        "ports": _tables(ports),
    }
    tables |= _studies({}, {}, [wish for wish, kind in WISHES.items() if kind.ports is not None], AXIS, RANGE)
    own = {"properties": {"block": {"additionalProperties": {"properties": {"type": {"enum": [*TYPES]}}}}}}
    classes = {"if": {"required": ["type"]}, "else": own}  # whose names are types of blocks too
    return _tables(tables, title="drawn loop", required=["rates", "block"]) | classes


def _studies(
    axes: Schema, ranges: Schema, wishes: Iterable[str], other: Schema | bool = False, other_range: Schema | bool = False
) -> Schema:
    """The tables of studies. axes, ranges: of the numbers with known names; other, other_range: what any other names are."""
    tables = _nested({path: _value(key) for path, key in STUDY_KEYS.items()})
    sweep, bode, simulate, design = (tables[name]["properties"] for name in ("sweep", "bode", "simulate", "design"))
    bode["frequency_hz"] = _axis(STUDY_KEYS["bode.frequency_hz"])
    tables |= {"sweep": _tables(sweep | axes, other), "bode": _tables(bode | axes, other)}
    lost = {"anyOf": [_value(LOST), RANGE]} if other_range else _value(LOST)
    tables["for_all"] = _tables(ranges | {"lost": lost}, other_range)
    frequency = STUDY_KEYS["simulate.frequency_hz"]
    simulate["frequency_hz"] = {"anyOf": [_value(frequency), _axis(frequency), {"type": "array", "maxItems": 0}]}
    simulate["show"]["items"] = TEXT
    frame = _tables({name: _value(key) for name, key in OF_FRAME.items()}, required=["ticks"])
    simulate["frames"]["items"] = {"anyOf": [_value(OF_FRAME["ticks"]), frame]}
    late = {"type": "array", "items": {"type": ["integer", "string"]}, "minItems": 1}
    simulate["messages"] = _tables({}, late, description=simulate["messages"]["description"])
    values = {"type": "array", "items": {"type": "number"}, "minItems": 1}
    hand = _tables({path.partition(".")[2]: values for path in KEYS if path.startswith("operator.")})
    wished = _tables({name: _wish(name) for name in wishes})
    design |= {"vary": _tables(axes, other), "wish": wished, "for_all": _tables({"hand": hand}, AXIS)}
    return tables


def _wish(name: str) -> Schema:
    kind = WISHES[name]
    options = {
        option: _value(key) if count == 1 else {"type": "array", "items": _value(key), "minItems": count or 1}
        for option, (key, count) in kind.options.items()
    }
    return _tables({kind.bound: {"type": "number"}, **options}, description=_described(kind))


def _block(kind: str) -> Schema:
    keys = {key.path: _value(key, text=True) for key in (*TYPES[kind].keys.values(), EVERY, PHASE)}
    required = [key.path for key in TYPES[kind].keys.values() if key.required]
    return _tables({"type": {"const": kind}, **keys}, required=["type", *required], description=TYPES[kind].description)


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
