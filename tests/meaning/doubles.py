"""Coefficients in double precision, for the march of the interpreter."""

import math
from fractions import Fraction

pi = math.pi
sqrt = math.sqrt
sin = math.sin
cos = math.cos
tan = math.tan
exp = math.exp
log = math.log
number = float
whole = round


def exact(value) -> Fraction:
    """The decimal number that a spec has, not the double nearest to it; of what was computed, the double."""
    return value if isinstance(value, Fraction) else Fraction(str(value))


time = least = exact


def ends(value) -> tuple[Fraction, Fraction]:
    return exact(value), exact(value)


def at_least(value: float, other: float) -> bool:
    return value >= other
