"""Checks of values against their keys, and the mistakes of a spec: expected, found, and the
nearest known name."""

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import Any

from wavesweep.engine._keys.key import LARGEST, SMALLEST, Key, Leaf, Place
from wavesweep.engine.errors import Mistake

LONGEST_SHOWN = 60  # letters of a value in a message
SIZES = f"a number from {SMALLEST:g} to {LARGEST:g} in size, or 0"


class Rejected(ValueError):
    """A value that a key does not accept, with the text of the mistake; the caller adds its
    place."""

    def __init__(self, expected: str, found: str, suggestion: str = "") -> None:
        super().__init__(f"expected {expected}, found {found}")
        self.expected = expected
        self.found = found
        self.suggestion = suggestion


class Mistakes(list[Mistake]):
    """The mistakes of a spec, collected while its tables are read."""

    def refuse(
        self,
        where: Leaf | Place,
        path: str,
        expected: str,
        found: str,
        suggestion: str = "",
        *,
        of_key: bool = True,
    ) -> None:
        """Add the mistake of a key or, unless `of_key`, of its value."""
        place = where.place if isinstance(where, Leaf) else where
        self.append(place.mistake(path, expected, found, suggestion, of_key))

    def check(self, key: Key, leaf: Leaf, path: str = "") -> Any:
        """Return the value of a leaf as the key's own type, or None and add a mistake. path:
        that of the key by default."""
        if key.items:
            return self._check_items(key, key.items, leaf, path or key.path)
        try:
            return check(key, leaf.value)
        except Rejected as error:
            self.refuse(
                leaf, path or key.path, error.expected, error.found, error.suggestion, of_key=False
            )
            return None

    def check_list(
        self,
        key: Key,
        leaf: Leaf,
        path: str,
        expected: str,
        count: int | None = None,
    ) -> list[Any]:
        """Return the values of a list that is not empty, each as the key's own type, and add
        mistakes. count: of the values."""
        if (
            not isinstance(leaf.value, list)
            or not leaf.value
            or count not in (None, len(leaf.value))
        ):
            self.refuse(leaf, path, expected, show(leaf.value), of_key=False)
            return []
        values = []
        before = len(self)
        for index, item in enumerate(leaf.value):
            if len(self) == before + 20:  # mistakes that are listed for one list
                rest = f"many wrong ones; the {len(leaf.value) - index} values from [{index}] on were not looked at"
                self.refuse(leaf, path, expected, rest, of_key=False)
                break
            values.append(self.check(key, replace(leaf, value=item), f"{path}[{index}]"))
        return values

    def _check_items(self, key: Key, items: Key, leaf: Leaf, path: str) -> tuple[Any, ...] | None:
        """Return the values of a list, or None and add mistakes. items: the key of each."""
        expected = f"a list of {key.count} numbers" if key.count else "a list of numbers"
        if key.rising:
            expected = "[lowest, highest frequency]"
        values = self.check_list(items, leaf, path, expected, key.count)
        if not values or None in values:
            return None
        if key.rising and not values[0] < values[-1]:
            found = f"[{', '.join(f'{value:g}' for value in values)}]"
            self.refuse(leaf, path, "the lower frequency first", found, of_key=False)
            return None
        return tuple(values)

    def is_known(
        self,
        name: str,
        known: Collection[str],
        leaf: Leaf,
        path: str,
        found: str = "an unknown key",
    ) -> bool:
        """Return whether a name is known; one that is not is a mistake. path: of the key with
        this name."""
        if name in known:
            return True
        self.refuse(leaf, path, f"one of {', '.join(known)}", found, nearest(name, known))
        return False

    def read(
        self, keys: Mapping[str, Key], leaves: Mapping[str, Leaf], table: str = ""
    ) -> dict[str, Any]:
        """Return the values of a table's keys by name; those that are unknown or wrong are left
        out, and mistakes.

        table: path of the table; its keys have the paths `table.name`.
        """
        values = {}
        for name, leaf in leaves.items():
            path = f"{table}.{name}" if table else name
            if (
                self.is_known(name, keys, leaf, path)
                and (value := self.check(keys[name], leaf, path)) is not None
            ):
                values[name] = value
        return values

    def in_order(self) -> list[Mistake]:
        """Return the mistakes by line and column; those without a place keep their order, at the
        end.

        Of a value that should be a table, the keys below it are not reported as missing too.
        """
        no_tables = tuple(mistake.key for mistake in self if mistake.expected == "a table")
        below = tuple(f"{key}." for key in no_tables)
        causes = [
            mistake
            for mistake in self
            if mistake.expected == "a table"
            or not (mistake.key in no_tables or mistake.key.startswith(below))
        ]

        def position(mistake: Mistake) -> tuple[int, ...]:
            numbers = mistake.location.rsplit(":", 2)[1:]
            return (
                tuple(map(int, numbers))
                if len(numbers) == 2 and all(map(str.isdecimal, numbers))
                else (10**9,)
            )

        return sorted(dict.fromkeys(causes), key=position)


def check(key: Key, value: object) -> float | int | str | bool:
    """Return `value` as the key's own type, or raise `Rejected`.

    A whole number is accepted as a float, and a float without fraction (20.0) as a whole number. A
    boolean is no number.
    """
    if key.type == "string":
        if isinstance(value, str) and (value in key.choices or not key.choices):
            return value
        raise Rejected(
            expectation(key),
            show(value),
            nearest(value, key.choices) if isinstance(value, str) else "",
        )
    if key.type == "boolean" and isinstance(value, bool):
        return value
    return _number(key, value)


def _is_finite(number: Any) -> bool:
    """Whether a number is finite as a double; None is not."""
    try:
        return math.isfinite(number)
    except (OverflowError, TypeError):  # a whole number beyond the largest double, or None
        return False


def _is_allowed(key: Key, number: float) -> bool:
    """Whether a number is in the range of a key, and one of its choices."""
    below = key.low is not None and (number < key.low or (key.above_low and number == key.low))
    above = key.high is not None and number > key.high
    return not (below or above or (key.choices and number not in key.choices))


def _number(key: Key, value: object) -> float | int:
    """Return `value` as a number that the key accepts, or raise `Rejected`."""
    number: Any = value if isinstance(value, (int, float)) and not isinstance(value, bool) else None
    finite = _is_finite(number)
    if (
        not finite
        or key.type == "boolean"
        or (key.type == "integer" and number != math.floor(number))
    ):
        expected = expectation(key)
        expected = (
            expected
            if number is None or finite
            else expected.replace("a number", "a finite number")
        )
        raise Rejected(
            expected,
            show(value),
            key.instead if isinstance(value, str) == key.instead.startswith('"') else "",
        )
    if not _is_allowed(key, number):
        raise Rejected(expectation(key, number), show(value))
    if not computable(number):
        raise Rejected(SIZES, show(value))
    # Adding 0.0 turns -0.0 into 0.0, so that equal specs have equal digests.
    return int(number) if key.type == "integer" else float(number) + 0.0


def computable(number: Any) -> Any:
    """Return whether a number, or each of an array, is 0 or of a size from which nothing
    underflows or overflows."""
    return (number == 0) | ((abs(number) >= SMALLEST) & (abs(number) <= LARGEST))


def expectation(key: Key, number: float | None = None) -> str:
    """Describe the values of `key`. If `number` exceeds its upper limit, that limit is named,
    otherwise the lower one."""
    if key.choices:
        return "one of " + ", ".join(map(show, key.choices))
    if key.type in (words := {"string": "a string", "boolean": "true or false", "list": "a list"}):
        return words[key.type]
    noun = "a whole number" if key.type == "integer" else "a number"
    if key.high is not None and number is not None and number > key.high:
        return f"{noun} <= {key.high:g}"
    if key.low is None:
        return noun
    return f"{noun} {'>' if key.above_low else '>='} {key.low:g}"


def show(value: object) -> str:
    """Return a value in the notation of a spec, shortened, on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        import json

        return _shorten(json.dumps(value, ensure_ascii=False))
    if isinstance(value, int) and value.bit_length() > 200:
        return f"a whole number of {value.bit_length()} bits"  # str() refuses the longest ones
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return "a list" if value else "an empty list"
    return _shorten(" ".join(str(value).split()))


def _shorten(text: str) -> str:
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the most likely intended name among `names`, or an empty string.

    The same name in another table or in other case is preferred to the closest spelling.
    """
    names = list(dict.fromkeys(names))
    if len(name) > 80:  # difflib takes quadratic time, and no name of ours comes near this length
        return ""
    last = _last(name)
    for folded in (str, str.lower):  # as it stands, then in any case
        matches = [candidate for candidate in names if folded(_last(candidate)) == folded(last)]
        if len(matches) == 1:
            return matches[0]
    import difflib

    if close := difflib.get_close_matches(name, names, n=1):
        return close[0]
    lasts = difflib.get_close_matches(last, [_last(candidate) for candidate in names], n=1)
    return next((candidate for candidate in names if _last(candidate) in lasts), "")


def _last(name: str) -> str:
    return name.rsplit(".", 1)[-1]
