"""Nested tables as the text of a spec."""

import json
import re
from collections.abc import Iterator, Mapping

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def as_toml(tables: Mapping[str, object]) -> str:
    """Return nested tables as TOML, from which `load` gives the same values; tables within tables are in braces.

    tables: of texts, numbers, booleans, lists of these and further tables, as `Spec.tables` gives them; None is left out.
    """
    return "\n".join("\n".join(_table(name, table)) + "\n" for name, table in tables.items() if table)


def _table(name: str, table: Mapping[str, object]) -> Iterator[str]:
    own = {key: value for key, value in table.items() if not (name == "block" and isinstance(value, Mapping))}
    if own:
        yield f"[{_key(name)}]"
        yield from (f"{_key(key)} = {_value(value)}" for key, value in own.items() if value is not None)
    for at, (key, block) in enumerate(table.items() if name == "block" else ()):
        yield from ["", f"[block.{_key(key)}]"] if at or own else [f"[block.{_key(key)}]"]
        yield from (f"{_key(part)} = {_value(value)}" for part, value in block.items() if value is not None)


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _text(name)


def _value(value: object) -> str:
    if isinstance(value, Mapping):
        parts = ", ".join(f"{_key(key)} = {_value(part)}" for key, part in value.items() if part is not None)
        return f"{{ {parts} }}" if parts else "{}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, str):
        return _text(value)
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _text(text: str) -> str:
    # A JSON string is a TOML string, except for DEL, which TOML wants escaped too.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
