"""Keys: names of values with their type, range, unit and meaning."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

INTEGRATIONS = {
    "explicit": "the spring reads the position before the step; usually the least stable wall",
    "implicit": "the spring reads the position after the step; usually the most stable wall",
    "trapezoidal": "the spring reads the position after a step with the mean of both velocities",
}
AHEAD = {"explicit": 0.0, "implicit": 1.0, "trapezoidal": 0.5}  # share of the new velocity in the position that a spring reads
RATIO = "ratio"  # unit of a value without one in a column of units, where a bare 1 would be read as a number
HIGHEST_ORDER = 12
LONGEST_FRAME = 100_000  # ticks
SMALLEST, LARGEST = 1e-60, 1e60  # sizes of numbers other than 0: what a loop makes of several stays within doubles
VALUE_WORDS = ("nan", "inf", "infinity", "none", "null", "na", "true", "false")  # no names, in any case of letters
FORMULA = ("=", "+", "-", "@")  # how a text begins that a spreadsheet runs


@dataclass(frozen=True, slots=True)
class Key:
    """One key: `type` is "number", "integer", "string" or "boolean"; `default` None means that the key may be absent.

    Keys of blocks may also be "list" (of numbers), "rows" (lists of numbers) or "ports" (names); in other tables a "list" may
    hold anything.

    Numbers lie in `low`..`high`, without `low` itself if `above_low` is true. If there are `choices`, no other value is
    allowed; `meanings` describes some of them. Limits set by other keys are checked
    where all values are known.
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
    instead: str = ""  # what is meant by a fraction that the key does not take, or, in quotes, by another word
    shaping: bool = False  # whether the structure of the loop, or other values and limits, depend on it although it is a number

    @property
    def numeric(self) -> bool:
        """Whether the key may be an axis of a sweep."""
        return self.type in ("number", "integer")

    @property
    def structural(self) -> bool:
        """Whether more than a number of the loop depends on this one: its structure, or other values and limits."""
        return self.type != "number" or self.shaping

    @staticmethod
    def number(path: str, default: float | None, unit: str, description: str, **limits: Any) -> "Key":
        """Return the key of a number. limits: `low`, `high`, `required`."""
        return Key(path, "number", default, unit, description, **limits)

    @staticmethod
    def positive(path: str, default: float | None, unit: str, description: str, **limits: Any) -> "Key":
        """Return the key of a number above 0. limits: `high`, `required`."""
        return Key(path, "number", default, unit, description, low=0.0, above_low=True, **limits)

    @staticmethod
    def gain(path: str, default: float | None, unit: str, description: str, **limits: Any) -> "Key":
        """Return the key of a number from 0 on. limits: `high`, `required`."""
        return Key(path, "number", default, unit, description, low=0.0, **limits)

    @staticmethod
    def whole(
        path: str, default: int | None, description: str, low: int, high: int | None, unit: str = "1", **more: Any
    ) -> "Key":
        """Return the key of a whole number from `low` to `high`. more: `required`, `instead`."""
        return Key(path, "integer", default, unit, description, low=low, high=high, **more)

    @staticmethod
    def word(path: str, default: str | None, description: str, meanings: Iterable[str] = (), required: bool = False) -> "Key":
        """Return the key of a text; one of several words if there are `meanings` of them, or names alone."""
        described = meanings if isinstance(meanings, Mapping) else {}
        return Key(path, "string", default, "", description, choices=tuple(meanings), required=required, meanings=described)

    @staticmethod
    def by_path(keys: Iterable["Key"]) -> Mapping[str, "Key"]:
        """Return keys by their paths."""
        return MappingProxyType({key.path: key for key in keys})


# Units at the port of a hand that turns, for those of one that slides.
TURNED = MappingProxyType({"m": "rad", "N": "N*m", "m/s": "rad/s", "m/N": "rad/(N*m)", "N/m": "N*m/rad", "N*s/m": "N*m*s/rad"})


@dataclass(frozen=True, slots=True)
class Names:
    """The keys of a spec by path, the symbols that are short for a path, and the numbers that follow from others."""

    keys: Mapping[str, Key]
    symbols: Mapping[str, str]
    following: frozenset[str] = frozenset()

    def find(self, name: str) -> Key | None:
        """Return the key of a name, which is a symbol (`kp`) or a full path (`numbers.kp`), or None."""
        return self.keys.get(self.symbols.get(name, name))

    @property
    def numeric(self) -> list[str]:
        """Paths of the keys that may be axes."""
        return [path for path, key in self.keys.items() if key.numeric]
