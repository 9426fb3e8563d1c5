"""Numbers in sentences: ranges whose ends can be told apart, and values that are rounded to one side."""

from decimal import ROUND_CEILING, ROUND_FLOOR, Context

DIGITS, MOST_DIGITS = (
    6,
    17,
)  # significant ones of a number in a sentence, and those that tell any two doubles apart


def span_in_words(low: float, high: float, digits: int = DIGITS) -> str:
    """A range, "0.1 to 0.25": with so many digits, and more if its ends would look alike. A single value has one number."""
    if low == high:
        return f"{low:.{digits}g}"
    while digits < MOST_DIGITS and f"{low:.{digits}g}" == f"{high:.{digits}g}":
        digits += 1
    return f"{low:.{digits}g} to {high:.{digits}g}"


def rounded_up(value: float, digits: int = DIGITS) -> str:
    """A value of so many digits that is no lower than it, as what is refuted from there on."""
    return f"{float(Context(prec=digits, rounding=ROUND_CEILING).create_decimal(value)):.{digits}g}"


def rounded_down(value: float, digits: int = DIGITS) -> str:
    """A value of so many digits that is no higher than it, as what is proved up to there."""
    return f"{float(Context(prec=digits, rounding=ROUND_FLOOR).create_decimal(value)):.{digits}g}"
