"""Where in a TOML text a key and its value stand; tomllib keeps no positions.

The text is known to be valid TOML, so this reads no more of the grammar than it takes to walk past strings, comments
and nested values. Arrays are stepped over: what stands in them has the position of the array.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from functools import lru_cache

DEEPEST = 16  # inline tables nested deeper than any key of ours are stepped over

_BLANK = re.compile(r"(?:[ \t\n]|#[^\n]*)*")
_STRING = (
    r'"""(?:\\.|[^\\])*?"""(?:"{0,2})'
    r"|'''.*?'''(?:'{0,2})"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'"
)
_SEGMENT = re.compile(rf"[ \t]*({_STRING}|[A-Za-z0-9_-]+)[ \t]*(\.?)", re.DOTALL)
_SCALAR = re.compile(rf"{_STRING}|[^,\]}}#\n]+", re.DOTALL)
_IN_BRACKETS = re.compile(rf"{_STRING}|#[^\n]*|[^\[\]{{}}\"'#]+|[\[\]{{}}]", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Position:
    """Offsets of a key and of its value; a table's value is its own name."""

    key: int
    value: int


@lru_cache(maxsize=1)
def scan(text: str) -> dict[tuple[str, ...], Position]:
    """Return the first position of every table, key and inline key of a valid TOML text, by path."""
    found: dict[tuple[str, ...], Position] = {}
    table: tuple[str, ...] = ()
    at = _skip_blank(text, 0)
    while at < len(text):
        if text[at] == "[":
            at = _skip_blank(text, at + (2 if text.startswith("[[", at) else 1))
            table, end = _read_key(text, at)
            _record(found, (), table, at, at)
            at = text.find("\n", end) + 1 or len(text)
        else:
            at = _read_pair(text, at, table, found)
        at = _skip_blank(text, at)
    return found


def locate(text: str, path: tuple[str, ...], of_key: bool = False) -> tuple[int, int]:
    """Return line and column, both from 1, of the value at `path` (or of its key), or of the nearest table above it."""
    positions = scan(text)
    for length in range(len(path), 0, -1):
        position = positions.get(path[:length])
        if position is not None:
            offset = position.key if of_key or length < len(path) else position.value
            return text.count("\n", 0, offset) + 1, offset - text.rfind("\n", 0, offset)
    return 1, 1


def _skip_blank(text: str, at: int) -> int:
    return _BLANK.match(text, at).end()


def _record(found: dict, table: tuple, keys: tuple, key_at: int, value_at: int) -> None:
    for length in range(1, len(keys)):  # the tables that a dotted key makes on its way
        found.setdefault(table + keys[:length], Position(key_at, key_at))
    found.setdefault(table + keys, Position(key_at, value_at))


def _read_key(text: str, at: int) -> tuple[tuple[str, ...], int]:
    segments = []
    more = True
    while more and (match := _SEGMENT.match(text, at)):
        segments.append(_unquote(match[1]))
        at, more = match.end(), bool(match[2])
    return tuple(segments), at


def _unquote(segment: str) -> str:
    return tomllib.loads(f"key = {segment}")["key"] if segment[0] in "\"'" else segment


def _read_pair(text: str, at: int, table: tuple, found: dict) -> int:
    keys, end = _read_key(text, at)
    value_at = _skip_blank(text, text.index("=", end) + 1)
    _record(found, table, keys, at, value_at)
    return _read_value(text, value_at, table + keys, found)


def _read_value(text: str, at: int, path: tuple, found: dict) -> int:
    if text[at] == "{" and len(path) < DEEPEST:
        return _read_inline_table(text, at, path, found)
    if text[at] in "[{":
        return _step_over(text, at)
    return _SCALAR.match(text, at).end()


def _read_inline_table(text: str, at: int, path: tuple, found: dict) -> int:
    at = _skip_blank(text, at + 1)
    while text[at] != "}":
        at = _skip_blank(text, _read_pair(text, at, path, found))
        if text[at] == ",":
            at = _skip_blank(text, at + 1)
    return at + 1


def _step_over(text: str, at: int) -> int:
    depth = 0
    for match in _IN_BRACKETS.finditer(text, at):
        depth += (match[0] in ("[", "{")) - (match[0] in ("]", "}"))
        if depth == 0:
            return match.end()
    return len(text)
