"""The JSON Schema (2020-12) of a spec, made from the tables of keys, so that an editor completes
keys and marks slips.

It says what can be said of each key by itself: names, types, ranges, choices. What two keys say
together is checked by `load`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from wavesweep.engine.drawing import TABLES, TICK_HZ, TYPES
from wavesweep.engine.keys import Key
from wavesweep.program.reading.keys import AXIS_KEYS, KEYS, STUDY_KEYS, SYMBOLS
from wavesweep.program.reading.matrix_files import keys_of
from wavesweep.program.reading.tables import tables
from wavesweep.program.spec.shipped_classes import shipped_classes

Schema = dict[str, Any]
TEXT = {"type": "string"}
UNKNOWN = {
    "not": {"title": "unknown key"}
}  # false, but for the place: editors mark the whole table for a false
TERMS = {"type": ["string", "number"], "description": "expression that is linear in signals"}
OTHERS = {
    "list": {"items": TERMS, "minItems": 1},
    "rows": {"items": {"type": "array", "items": TERMS}},
    "ports": {"items": TEXT},
}


def _reference(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


def _either(condition: Schema, then: Schema, otherwise: Schema) -> Schema:
    """One of two shapes: an editor then marks a slip within the one that was meant, and not the
    whole of what may be either."""
    return {"if": condition, "then": then, "else": otherwise}


AXIS = _reference("axis")  # of drawn loops


def schema() -> Schema:
    """Return the schema of a spec, of a controller or of a drawn loop, as nested dicts that JSON
    can hold."""
    axis = _axis(Key("axis", "number", None, "", "number of the drawn loop"))
    definitions: Schema = {}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Spec of wavesweep",
        **_either({"required": ["controller"]}, _controlled(definitions), _drawn(definitions)),
        "$defs": {
            # "numbers.k" may be a path of tables
            "axis": _either(
                {"anyOf": [{"type": "array"}, {"required": ["start"]}]}, axis, _tables({}, AXIS)
            ),
            **{path: _value(key) for path, key in KEYS.items()},
            **{f"axis_of_{path}": _axis(key) for path, key in KEYS.items() if key.numeric},
            **definitions,
        },
    }


def _controlled(definitions: Schema) -> Schema:
    shapes = _nested({path: _reference(path) for path in KEYS})
    shapes["environment"]["properties"]["delay"] = {
        "anyOf": [_reference("environment.delay"), {"const": "frame"}]
    }
    shapes["controller"]["required"] = ["kind"]
    shapes |= _studies(Shapes(False, definitions))
    del shapes["bode"]["properties"]["from"], shapes["bode"]["properties"]["to"]
    return _tables(shapes, title="loop of a controller", required=["controller"])


def _drawn(definitions: Schema) -> Schema:
    number = _tables(
        dict.fromkeys(TABLES["numbers"], TEXT) | {"value": {"type": ["number", "string"]}}
    )
    end = {"anyOf": [TERMS, _tables({"signal": TERMS, "unit": TEXT}, required=["signal"])]}
    ports = {}
    for name, parts in TABLES["ports"].items():
        shapes_of_parts = {key: _port_part(part) for key, part in parts.items()}
        required = [key for key, part in parts.items() if not part.optional]
        ports[name] = _tables(shapes_of_parts, required=required)
        if "signal" in parts:  # of each of several ports with names
            ports[name] = _tables({}, end)
    wire = {"anyOf": [TERMS, _tables({}, TERMS)]}
    shapes = {
        "rates": _tables({"tick_hz": _value(TICK_HZ, text=True)}),
        "numbers": _tables({}, _either({"type": "object"}, number, {"type": ["number", "string"]})),
        "type": _tables(
            {}, _tables({table: {"type": "object"} for table in TABLES if table != "rates"})
        ),
        "block": _tables(
            {}, {"type": "object", "required": ["type"], "allOf": [*map(_block, TYPES)]}
        ),
        "signals": _tables({}, wire),
        "wire": _tables({}, {"anyOf": [TERMS, _tables({}, wire)]}),
        "ports": _tables(ports),
    }
    shapes |= _studies(Shapes(True, definitions))
    # Without classes of its own, whose names are types of blocks too.
    types = {"type": {"enum": [*TYPES, *shipped_classes()]}}
    blocks = {"block": {"additionalProperties": {"properties": types}}}
    classes = {"if": {"required": ["type"]}, "else": {"properties": blocks}}
    return _tables(shapes, title="drawn loop", required=["rates", "block"]) | classes


def _port_part(part) -> Schema:
    """The value of a part of a port, see `drawing_ports.PORTS`."""
    single = {"type": part.type}
    if not part.several:
        return single
    several = {"type": "array", "items": single, "minItems": 1}
    return _either({"type": "array"}, several, single)


def _studies(shapes: Shapes) -> Schema:
    """The tables of studies."""
    keys_of_studies = _nested({path: _value(key) for path, key in STUDY_KEYS.items()})
    sweep, bode = (keys_of_studies[name]["properties"] for name in ("sweep", "bode"))
    bode["frequency_hz"] = _axis(STUDY_KEYS["bode.frequency_hz"])
    table_shapes = {}
    for table in tables().values():
        made = table.schema(shapes) if table.schema else shapes.keys(table.keys_in_it)
        table_shapes[table.path] = made
    outer = {path: shape for path, shape in table_shapes.items() if "." not in path}
    for path, shape in table_shapes.items():
        parent, _, name = path.rpartition(".")
        if parent == "sweep":
            sweep[name] = shape
        elif parent in outer:
            outer[parent]["properties"][name] = shape
    return {"sweep": shapes.axes(sweep), "bode": shapes.axes(bode), **outer}


def _block(kind: str) -> Schema:
    keys = {key.path: _value(key, text=True) for key in keys_of(kind).values()}
    required = [key.path for key in TYPES[kind].keys.values() if key.required]
    of_kind = {"properties": {"type": {"const": kind}}, "required": ["type"]}
    # A key that is misspelt is not also said to be missing.
    complete = {"if": {"propertyNames": {"enum": ["type", *keys]}}, "then": {"required": required}}
    return {
        "if": of_kind,
        "then": _tables({"type": TEXT, **keys}, description=TYPES[kind].description) | complete,
    }


def _axis(key: Key) -> Schema:
    """The values of an axis: a list of them, or a span."""
    span_keys = {name: _value(span_key) for name, span_key in AXIS_KEYS.items()} | {
        "start": _value(key),
        "stop": _value(key),
    }
    values = {"type": "array", "items": _value(key), "minItems": 1}
    span = _tables(span_keys, required=["start", "stop"])
    return _either({"type": "array"}, values, span) | {"description": _described(key)}


def _value(key: Key, *, text: bool = False) -> Schema:
    """The values of a key; text: whether a number may be an expression in numbers as well."""
    value: Schema = {"description": _described(key)} if key.description else {}
    if key.default is not None and not isinstance(key.default, tuple):
        value["default"] = key.default
    if key.items:
        item = replace(key.items, description="", default=None)
        shape = {"type": "array", "items": _value(item), "minItems": key.count or 1}
        return value | shape | ({"maxItems": key.count} if key.count else {})
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
    if key.unit not in ("", "1"):
        return f"{key.description} ({key.unit})"
    return key.description


def _nested(paths: Mapping[str, Schema]) -> Schema:
    """The properties of tables in tables that have these paths."""
    nested: Schema = {}
    for path, value in paths.items():
        *tables, last = path.split(".")
        branch = nested
        for table in tables:
            branch = branch.setdefault(table, _tables({}))["properties"]
        branch[last] = value
    return nested


def _tables(
    properties: Mapping[str, Schema], further: Schema | bool = False, **more: Any
) -> Schema:
    """A table with these keys and, if `further` says what they hold, any further ones. more: as
    `required`, `description`."""
    return {
        "type": "object",
        "properties": dict(properties),
        "additionalProperties": further or UNKNOWN,
        **more,
    }


@dataclass(frozen=True, slots=True)
class Shapes:
    """What the schema of a capability's table is made from. drawn: whether for a drawn loop;
    definitions: those of its own."""

    drawn: bool
    definitions: Schema = field(default_factory=dict)

    @property
    def numbers(self) -> dict[str, Key]:
        """The numbers with known names, by symbol and by path."""
        if self.drawn:
            paths = ()
        else:
            paths = (path for path, key in KEYS.items() if key.numeric)
        return {path: KEYS[path] for path in paths} | {
            name: KEYS[path] for name, path in SYMBOLS.items() if not self.drawn
        }

    def axes(self, further: Mapping[str, Schema] = MappingProxyType({})) -> Schema:
        """A table of axes. further: keys beside them."""
        axes = {name: _reference(f"axis_of_{key.path}") for name, key in self.numbers.items()}
        return self.table({**further, **axes, **self.nested(axes)}, AXIS if self.drawn else False)

    def keys(self, keys: Mapping[str, Key], **more: Any) -> Schema:
        """A table of keys by their names in it. more: as of `table`."""
        return self.table(self.nested({name: _value(key) for name, key in keys.items()}), **more)

    def several(self, shape: Schema) -> Schema:
        """A table, or a list of such tables."""
        return {"anyOf": [shape, {"type": "array", "items": shape, "minItems": 1, "maxItems": 9}]}

    def define(self, name: str, shape: Schema) -> Schema:
        """Keep a definition, and return the reference to it."""
        self.definitions[name] = shape
        return self.reference(name)

    # How a capability makes the parts of its own.
    reference = staticmethod(_reference)
    value = staticmethod(_value)
    axis = staticmethod(_axis)
    described = staticmethod(_described)
    nested = staticmethod(_nested)
    table = staticmethod(_tables)
