"""A spec written again: the tables of a drawn loop, and nested tables as text."""

import json
import re
from collections.abc import Iterator, Mapping

from wavesweep.engine.drawing import RATE, Drawing, keys_of_block, path_of, path_of_port
from wavesweep.engine.expressions import sum_of
from wavesweep.engine.keys import Path

NUMBER_WORDS = (".unit", ".description")
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def as_toml(tables: Mapping[str, object]) -> str:
    """Return nested tables as TOML, from which `load` gives the same values; tables within tables
    are in braces.

    tables: of texts, numbers, booleans, lists of these and further tables, as `Spec.tables` gives
    them; None is left out.
    """
    return "\n".join(
        "\n".join(_table(name, table)) + "\n" for name, table in tables.items() if table
    )


def _table(name: str, table: Mapping[str, object]) -> Iterator[str]:
    plain = {
        key: value
        for key, value in table.items()
        if not (name == "block" and isinstance(value, Mapping))
    }
    if plain:
        yield f"[{_key(name)}]"
        yield from (
            f"{_key(key)} = {_value(value)}" for key, value in plain.items() if value is not None
        )
    for number, (key, block) in enumerate(table.items() if name == "block" else ()):
        yield from ["", f"[block.{_key(key)}]"] if number or plain else [f"[block.{_key(key)}]"]
        yield from (
            f"{_key(name)} = {_value(value)}" for name, value in block.items() if value is not None
        )


def _key(name: str) -> str:
    if _BARE.fullmatch(name):
        return name
    return _text(name)


def _value(value: object) -> str:
    if isinstance(value, Mapping):
        items = ", ".join(
            f"{_key(key)} = {_value(item)}" for key, item in value.items() if item is not None
        )
        return f"{{ {items} }}" if items else "{}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value)


def _text(text: str) -> str:
    # A JSON string is a TOML string, except for DEL, which TOML wants escaped too.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


NAMED_PORTS = ("ports.inputs.", "ports.outputs.")


def written(drawing: Drawing, values: Mapping[str, float], given) -> dict[Path, object]:
    """Return the resolved tables by path, as a spec could give them. given: a `Given`."""
    tables: dict[Path, object] = {
        ("rates", "tick_hz"): values.get(RATE) or given.leaves[RATE].value
    }
    for name, unit, description in drawing.numbers:
        tables["numbers", name] = {
            "value": values[path_of(name)],
            "unit": unit,
            "description": description,
        }
    for block in drawing.blocks:
        if f"block.{block.name}.type" in given.leaves:  # others are of `prev(...)`
            tables |= _written_block(block, values, given)
    asked = {}  # outputs that [bode] or another table names, see `Drawing.signals`
    for name, terms, unit in drawing.outputs:
        if path_of_port("outputs", name) not in given.leaves:
            asked["ports", "outputs", name, "signal"] = sum_of(terms)
            asked["ports", "outputs", name, "unit"] = unit
    for path in given.leaves:
        if not path.startswith(NAMED_PORTS):
            tables |= (
                asked  # here, where they stand if this is read again: the order decides the digest
            )
        tables |= _written_leaf(path, values, given)
    return tables | asked


def _written_leaf(path: str, values: Mapping[str, float], given) -> dict[Path, object]:
    """Return what a spec could give for a port, wire or signal, or for a number that follows
    from others; empty for what is written elsewhere."""
    leaf = given.leaves[path]
    table, _, rest = path.partition(".")
    if path.startswith(NAMED_PORTS):
        # The unit of a port is written with it; a port itself may be called "unit".
        if path.endswith(".unit") and path.removesuffix(".unit") in given.leaves:
            return {}
        word = given.leaves.get(f"{path}.unit")
        place = tuple(path.split(".", 2))
        return {(*place, "signal"): leaf.value, (*place, "unit"): word.value if word else ""}
    if table in ("wire", "signals", "ports"):
        # The name of a wire or a signal is one key, with its dots.
        place = tuple(path.split(".")) if table == "ports" else (table, rest)
        return {place: leaf.value}
    if (
        table == "numbers" and path not in values and not path.endswith(NUMBER_WORDS)
    ):  # one that follows from others
        words = (given.leaves.get(path + suffix) for suffix in NUMBER_WORDS)
        unit, description = (word.value if word else "" for word in words)
        return {(table, rest): {"value": leaf.value, "unit": unit, "description": description}}
    return {}


def _written_block(block, values, given):
    """The keys of a block, as `written` gives them."""
    tables = {("block", block.name, "type"): block.type}
    for name, key in keys_of_block(block.type).items():
        path = f"block.{block.name}.{name}"
        leaf = given.leaves.get(path)
        value = values.get(path, leaf.value if leaf else key.default)
        if value is not None and not (name == "steps" and block.dead_time):
            tables["block", block.name, name] = list(value) if isinstance(value, tuple) else value
    return tables
