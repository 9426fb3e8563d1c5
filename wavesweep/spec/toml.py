"""Tables as the text of a TOML file, which `load` reads back to the same values."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def dumps(tables: Mapping[str, object]) -> str:
    """Return nested tables of numbers, texts, booleans and lists as TOML; below the first level, those without
    tables in them are inline."""
    return "\n".join(_lines((), tables)).strip() + "\n"


def _lines(path: tuple[str, ...], table: Mapping[str, object]) -> Iterator[str]:
    deep = {name: value for name, value in table.items() if _is_deep(value) or (not path and isinstance(value, Mapping))}
    here = {name: value for name, value in table.items() if name not in deep and value is not None}
    if path and (here or not deep):
        yield from ("", f"[{'.'.join(map(_key, path))}]")
    yield from (f"{_key(name)} = {_value(value)}" for name, value in here.items())
    for name, value in deep.items():
        yield from _lines((*path, name), value)


def _is_deep(value: object) -> bool:
    return isinstance(value, Mapping) and any(isinstance(each, Mapping) for each in value.values())


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(name)} = {_value(each)}" for name, each in value.items() if each is not None) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    return repr(value)
