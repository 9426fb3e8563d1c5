"""Values as they are given, each with its place in what gives it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from wavesweep.engine.errors import Mistake

Path = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Place:
    """Place of a value: at a path of nested tables.

    name: of the source, such as an override as it was typed; empty for a dict. exact: whether the value is as it stands there,
    so that offsets in it are those of the source. text: of the source, empty for a dict.
    """

    name: str = ""
    path: Path = ()
    exact: bool = True
    text: str = ""

    def location(self, of_key: bool = False) -> str:  # noqa: ARG002 - for places in a text
        """Return the prefix of a mistake's line, for the value here or for its key."""
        return self.name

    def inside(self, offset: int) -> str:  # noqa: ARG002 - for places in a text
        """Return the prefix of a mistake's line, for the character at that offset of the text that is the value here."""
        return self.location()

    def mistake(self, key: str, expected: str, found: str, suggestion: str = "", of_key: bool = False) -> Mistake:
        """Return the mistake made by the value here or, if `of_key`, by its key."""
        return Mistake(self.location(of_key), key, expected, found, suggestion)

    def under(self, path: Path) -> Place:
        """Return the place of another path of the same source."""
        return replace(self, path=path)

    def parent(self) -> Place:
        """Return the place of the table around this value."""
        return self.under(self.path[:-1])


@dataclass(frozen=True, slots=True)
class Leaf:
    """A value as given, with its place."""

    value: object
    place: Place


def leaves_of(tables: Mapping[str, Any], place: Place, prefix: Path = ()) -> Iterator[tuple[Path, Leaf]]:
    """Yield path and leaf of every value that is not a table with something in it."""
    for name, value in tables.items():
        path = (*prefix, name)
        if isinstance(value, dict) and value:
            yield from leaves_of(value, place, path)
        else:
            yield path, Leaf(value, place.under(path))


LONGEST_RANGE = 2_000_000  # numbers; a longer range is no list of a spec


def read_dict(tables: Mapping[Any, Any]) -> dict[str, Any]:
    """Return nested tables as plain dicts, lists and Python numbers."""
    return {str(key): plain(value) for key, value in tables.items()}


def plain(value: object) -> object:
    """Return one value, or a table of them, as plain Python types, without tuples, ranges, numpy types and other mappings."""
    if isinstance(value, Mapping):
        return read_dict(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, range) and len(value[: LONGEST_RANGE + 1]) <= LONGEST_RANGE:
        return list(value)
    return value


def split_names(path: Path, depth: int) -> Path:
    """Return a path with the names below `depth` split at their dots, as those of wires: `"motor.u"` is `motor.u`."""
    return (*path[:depth], *(piece for name in path[depth:] for piece in name.split(".")))
