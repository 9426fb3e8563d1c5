"""Sentences in lines, and their numbers: bounds, which are rounded to the side on which what is said of them is so.

What holds up to a value is printed rounded down, and what holds from one on rounded up; what is
refuted from a value on is printed rounded up, since nothing is known of what is below it. A value
that its digits give exactly is printed as it is.
"""

from collections.abc import Callable
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from textwrap import wrap

DIGITS = 6  # significant ones of a number in a sentence
MOST_DIGITS = 17  # those that tell any two doubles apart
WIDEST = 120  # letters of a line


def folded(line: str, width: int = WIDEST) -> list[str]:
    """A line as lines of at most so many letters, those after the first indented; no word is cut."""
    indent = " " * (len(line) - len(line.lstrip()) + 4)
    return wrap(
        line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


def span_in_words(low: float, high: float, digits: int = DIGITS) -> str:
    """A range in all of which something holds, "0.1 to 0.25": its ends are rounded inwards, with more digits if these meet."""
    if low == high:
        return in_all_digits(low)
    return " to ".join(ends_in_words(low, high, digits))


def ends_in_words(low: float, high: float, digits: int = DIGITS) -> tuple[str, str]:
    """The ends of a range in all of which something holds, or which is to be searched, rounded inwards."""
    while digits < MOST_DIGITS:
        ends = rounded_up(low, digits), rounded_down(high, digits)
        if float(ends[0]) < float(ends[1]):
            return ends
        digits += 1
    return in_all_digits(low), in_all_digits(high)


def span_around(low: float, high: float, digits: int = DIGITS) -> str:
    """A range outside of which something holds, as one that is not known: its ends are rounded outwards."""
    ends = rounded_down(low, digits), rounded_up(high, digits)
    return " to ".join(dict.fromkeys(ends))


def in_all_digits(value: float) -> str:
    """A number that refutes something, as it reads back: rounded, it may lie outside of its range, or refute nothing."""
    nearest = f"{value:.{DIGITS}g}"
    if float(nearest) == value:
        return nearest
    return repr(float(value))


def in_digits(value: float, digits: int) -> str:
    """A value of so many digits, without an exponent below a million."""
    return f"{float(f'{value:.{digits}g}'):g}"


def lasting(time_constant_s: float) -> str:
    """How a mode goes on: its time constant (s), negative of one that grows."""
    way = "falls to 1/e" if time_constant_s > 0 else "grows by a factor of e"
    return f"{way} in {abs(time_constant_s):.4g} s"


def in_time(
    seconds: float, digits: int = DIGITS, rounding: Callable[[float, int], str] = in_digits
) -> str:
    """A time with its unit: in ms, or from 10 s on in s."""
    return (
        f"{rounding(seconds, digits)} s"
        if seconds >= 10
        else f"{rounding(1e3 * seconds, digits)} ms"
    )


def rounded_up(value: float, digits: int = DIGITS) -> str:
    """A value of so many digits that is no lower than it."""
    return _rounded(value, digits, ROUND_CEILING)


def rounded_down(value: float, digits: int = DIGITS) -> str:
    """A value of so many digits that is no higher than it."""
    return _rounded(value, digits, ROUND_FLOOR)


def _rounded(value: float, digits: int, rounding: str) -> str:
    nearest = f"{value:.{digits}g}"
    # Relative: 0.1 is not a double, and 2*0.3/1e-5 not 60000.
    if abs(float(nearest) - value) <= 1e-15 * abs(value):
        return nearest
    return f"{float(Context(prec=digits, rounding=rounding).create_decimal(value)):.{digits}g}"
