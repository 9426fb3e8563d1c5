"""Checks of one value against its key, and the text of a mistake: expected, found, and the nearest known name."""

import math
from collections.abc import Iterable

from wavesweep.spec.keys import Key

LONGEST_SHOWN = 60
LONGEST_COMPARED = 80  # difflib takes quadratic time, and no name of ours comes near this length


class Rejected(ValueError):
    """A value that a key does not accept, with the text of the mistake; the caller adds its place."""

    def __init__(self, expected: str, found: str, suggestion: str = "") -> None:
        super().__init__(f"expected {expected}, found {found}")
        self.expected, self.found, self.suggestion = expected, found, suggestion


def check(key: Key, value: object) -> float | int | str:
    """Return `value` as the key's own type, or raise `Rejected`.

    A whole number is accepted as a float, and a float without fraction (20.0) as a whole number. A boolean is no number.
    """
    if key.type == "string":
        return _check_string(key, value)
    if key.type == "boolean" and isinstance(value, bool):
        return value
    number = _finite(value)
    if number is None or key.type == "boolean" or (key.type == "integer" and number != math.floor(number)):
        expected = expectation(key)
        if number is None and isinstance(value, (int, float)) and not isinstance(value, bool):
            expected = expected.replace("a number", "a finite number")
        raise Rejected(expected, show(value))
    if not _in_range(key, number):
        raise Rejected(expectation(key, number), show(value))
    # Adding 0.0 turns -0.0 into 0.0, so that equal specs have equal digests.
    return int(number) if key.type == "integer" else float(number) + 0.0


def _check_string(key: Key, value: object) -> str:
    if isinstance(value, str) and (value in key.choices or not key.choices):
        return value
    suggestion = nearest(value, key.choices) if isinstance(value, str) else ""
    raise Rejected(expectation(key), show(value), suggestion)


def _finite(value: object) -> float | int | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        return value if math.isfinite(value) else None
    except OverflowError:  # a whole number beyond the largest double
        return None


def _in_range(key: Key, number: float) -> bool:
    if key.choices:
        return number in key.choices
    if key.low is not None and (number < key.low or (key.above_low and number == key.low)):
        return False
    return key.high is None or number <= key.high


def expectation(key: Key, number: float | None = None) -> str:
    """Describe the values of `key`. If `number` exceeds its upper limit, that limit is named, otherwise the lower one."""
    if key.choices:
        return "one of " + ", ".join(map(show, key.choices))
    if key.type in (words := {"string": "a string", "boolean": "true or false", "list": "a list"}):
        return words[key.type]
    what = "a whole number" if key.type == "integer" else "a number"
    if key.high is not None and number is not None and number > key.high:
        return f"{what} <= {key.high:g}"
    if key.low is None:
        return what
    return f"{what} {'>' if key.above_low else '>='} {key.low:g}"


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


def apart(one: float, other: float) -> tuple[str, str]:
    """Return two different numbers with as many digits as tell them apart, six at least."""
    texts = ((f"{one:.{digits}g}", f"{other:.{digits}g}") for digits in range(6, 18))
    return next((pair for pair in texts if pair[0] != pair[1]), (repr(one), repr(other)))


def _shorten(text: str) -> str:
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."


def nearest(name: str, known: Iterable[str]) -> str:
    """Return the most likely intended name among `known`, or an empty string.

    The same name in another table or in other case is preferred to the closest spelling.
    """
    known = list(dict.fromkeys(known))
    if len(name) > LONGEST_COMPARED:
        return ""
    last = _last(name)
    for same in (lambda one: _last(one) == last, lambda one: _last(one).lower() == last.lower()):
        matches = [one for one in known if same(one)]
        if len(matches) == 1:
            return matches[0]
    import difflib

    close = difflib.get_close_matches(name, known, n=1) or _close_in_last(last, known)
    return close[0] if close else ""


def _close_in_last(last: str, known: list[str]) -> list[str]:
    import difflib

    close = difflib.get_close_matches(last, [_last(one) for one in known], n=1)
    return [one for one in known if _last(one) in close][:1]


def _last(name: str) -> str:
    return name.rsplit(".", 1)[-1]
