"""Keys, which are names of values with type, range, unit and meaning, and values as they are
given, each with its place."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from wavesweep.engine.errors import Mistake

Path = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Place:
    """Place of a value: at a path of nested tables.

    name: of the source, such as an override as it was typed; empty for a dict. exact: whether the
    value is as it stands there, so that offsets in it are those of the source. text: of the source,
    empty for a dict.
    """

    name: str = ""
    path: Path = ()
    exact: bool = True
    text: str = ""

    def location(self, of_key: bool = False) -> str:  # noqa: ARG002 - for places in a text
        """Return the prefix of a mistake's line, for the value here or for its key."""
        return self.name

    def inside(self, offset: int) -> str:  # noqa: ARG002 - for places in a text
        """Return the prefix of a mistake's line, for the character at that offset of the text
        that is the value here."""
        return self.location()

    def mistake(
        self, key: str, expected: str, found: str, suggestion: str = "", of_key: bool = False
    ) -> Mistake:
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


def leaves_of(
    tables: Mapping[str, Any], place: Place, prefix: Path = ()
) -> Iterator[tuple[Path, Leaf]]:
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
    """Return one value, or a table of them, as plain Python types, without tuples, ranges, numpy
    types and other mappings."""
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
    """Return a path with the names below `depth` split at their dots, as those of wires:
    `"motor.u"` is `motor.u`."""
    return (*path[:depth], *(piece for name in path[depth:] for piece in name.split(".")))


INTEGRATIONS = {
    "explicit": "the spring reads the position before the step; usually the least stable wall",
    "implicit": "the spring reads the position after the step; usually the most stable wall",
    "trapezoidal": "the spring reads the position after a step with the mean of both velocities",
}
AHEAD = {
    "explicit": 0.0,
    "implicit": 1.0,
    "trapezoidal": 0.5,
}  # share of the new velocity in the position that a spring reads
HIGHEST_ORDER = 12
LONGEST_FRAME = 100_000  # ticks
# sizes of numbers other than 0, in any unit: what a loop makes of several stays within doubles
SMALLEST = 1e-60
LARGEST = 1e60
# no names, in any case of letters
VALUE_WORDS = ("nan", "inf", "infinity", "none", "null", "na", "true", "false")
FORMULA = ("=", "+", "-", "@")  # how a text begins that a spreadsheet runs


@dataclass(frozen=True, slots=True)
class Key:
    """One key: `type` is "number", "integer", "string" or "boolean"; `default` None means that the
    key may be absent.

    Keys of blocks may also be "list" (of numbers), "rows" (lists of numbers) or "ports" (names). In
    other tables a "list" has values of the key `items`, or holds anything without one.

    Numbers lie in `low`..`high`, without `low` itself if `above_low` is true. If there are
    `choices`, no other value is allowed; `meanings` describes some of them. Limits set by other
    keys are checked where all values are known.
    """

    path: str
    type: str
    default: float | int | str | None
    unit: str
    description: str
    low: float | None = None
    high: float | None = None
    above_low: bool = False
    choices: tuple[Any, ...] = ()
    required: bool = False
    meanings: Mapping[str, str] = field(default_factory=dict, repr=False)
    # what is meant by a fraction that the key does not take, or, in quotes, by another word
    instead: str = ""
    # of a list: the key of each of its values
    items: Key | None = None
    # how many these are; None for any
    count: int | None = None
    # whether the first of them is lower than the last
    rising: bool = False
    # whether the structure of the loop, or other values and limits, depend on it although it is a
    # number
    shaping: bool = False

    @property
    def numeric(self) -> bool:
        """Whether the key may be an axis of a sweep."""
        return self.type in ("number", "integer")

    @property
    def structural(self) -> bool:
        """Whether more than a number of the loop depends on this one: its structure, or other
        values and limits."""
        return self.type != "number" or self.shaping

    @staticmethod
    def number(path: str, default: float | None, unit: str, description: str, **limits: Any) -> Key:
        """Return the key of a number. limits: `low`, `high`, `required`."""
        return Key(path, "number", default, unit, description, **limits)

    @staticmethod
    def positive(
        path: str, default: float | None, unit: str, description: str, **limits: Any
    ) -> Key:
        """Return the key of a number above 0. limits: `high`, `required`."""
        return Key(path, "number", default, unit, description, low=0.0, above_low=True, **limits)

    @staticmethod
    def gain(path: str, default: float | None, unit: str, description: str, **limits: Any) -> Key:
        """Return the key of a number from 0 on. limits: `high`, `required`."""
        return Key(path, "number", default, unit, description, low=0.0, **limits)

    @staticmethod
    def whole(
        path: str,
        default: int | None,
        description: str,
        low: int,
        high: int | None,
        unit: str = "1",
        **more: Any,
    ) -> Key:
        """Return the key of a whole number from `low` to `high`. more: `required`, `instead`."""
        return Key(path, "integer", default, unit, description, low=low, high=high, **more)

    @staticmethod
    def word(
        path: str,
        default: str | None,
        description: str,
        meanings: Iterable[str] = (),
        required: bool = False,
    ) -> Key:
        """Return the key of a text; one of several words if there are `meanings` of them, or
        names alone."""
        described = meanings if isinstance(meanings, Mapping) else {}
        return Key(
            path,
            "string",
            default,
            "",
            description,
            choices=tuple(meanings),
            required=required,
            meanings=described,
        )

    @staticmethod
    def several(
        items: Key, count: int | None = None, *, rising: bool = False, description: str = ""
    ) -> Key:
        """Return the key of a list of values of another key, with its path and unit."""
        return Key(
            items.path,
            "list",
            None,
            items.unit,
            description or items.description,
            items=items,
            count=count,
            rising=rising,
        )

    @staticmethod
    def by_path(keys: Iterable[Key]) -> Mapping[str, Key]:
        """Return keys by their paths."""
        return MappingProxyType({key.path: key for key in keys})


# Units at the port of a hand that turns, for those of one that slides.
TURNED = MappingProxyType(
    {
        "m": "rad",
        "N": "N*m",
        "m/s": "rad/s",
        "m/N": "rad/(N*m)",
        "N/m": "N*m/rad",
        "N*s/m": "N*m*s/rad",
    }
)
# And of one whose force and displacement are a voltage and a charge.
ELECTRICAL = MappingProxyType(
    {"m": "C", "N": "V", "m/s": "A", "m/N": "F", "N/m": "1/F", "N*s/m": "ohm"}
)
PORT_UNITS = MappingProxyType({"turns": TURNED, "volts": ELECTRICAL})  # by the key of [ports] hand


@dataclass(frozen=True, slots=True)
class Names:
    """The keys of a spec by path, the symbols that are short for a path, and the numbers that
    follow from others."""

    keys: Mapping[str, Key]
    symbols: Mapping[str, str]
    following: frozenset[str] = frozenset()

    def find(self, name: str) -> Key | None:
        """Return the key of a name, which is a symbol (`kp`) or a full path (`numbers.kp`), or
        None."""
        return self.keys.get(self.symbols.get(name, name))

    @property
    def numeric(self) -> list[str]:
        """Paths of the keys that may be axes."""
        return [path for path, key in self.keys.items() if key.numeric]
