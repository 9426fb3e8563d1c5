"""Floats that remember how they were computed from numbers with names, so that C can compute
them again."""

import math
import operator
from collections.abc import Mapping
from typing import Any, Self

_SIGNS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


class Named(float):
    """A float and what it was made from: a name, or an operation and its operands.

    Sums, products, quotients and `root` remember; all else gives plain floats, which are constants.
    It is true even at zero, so that a gain of zero keeps its place in sums.
    """

    __slots__ = ("made",)
    made: Any

    def __new__(cls, value: float, made: Any) -> Self:
        """Return the float with what it was made from."""
        number = super().__new__(cls, value)
        number.made = made
        return number

    def __bool__(self) -> bool:
        return True

    def __neg__(self) -> Any:
        return Named(-float(self), ("negative", self))

    def __add__(self, other: Any) -> Any:
        if _is(other, 0.0):
            return self
        return _made("+", self, other)

    def __sub__(self, other: Any) -> Any:
        if _is(other, 0.0):
            return self
        return _made("-", self, other)

    def __rsub__(self, other: Any) -> Any:
        return _made("-", other, self)

    def __mul__(self, other: Any) -> Any:
        if _is(other, 0.0):
            return 0.0
        if _is(other, 1.0):
            return self
        return _made("*", self, other)

    def __truediv__(self, other: Any) -> Any:
        return _made("/", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return _made("/", other, self)

    __radd__, __rmul__ = __add__, __mul__  # both commute to the last bit


def _is(other: Any, value: float) -> bool:
    return not isinstance(other, Named) and other == value


def _made(sign: str, left: Any, right: Any) -> Named:
    return Named(_SIGNS[sign](float(left), float(right)), (sign, left, right))


def root(value: float) -> float:
    """Return the square root."""
    value_of_root = math.sqrt(value)
    if isinstance(value, Named):
        return Named(value_of_root, ("sqrt", value))
    return value_of_root


def again(value: float, numbers: Mapping[str, float], seen: dict[int | str, float]) -> float:
    """Return what a number would be with these in place of those with names.

    seen: what was found before, by `id`, and the numbers with names that were read.
    """
    if not isinstance(value, Named):
        return value
    if isinstance(value.made, str):
        return seen.setdefault(value.made, numbers[value.made])
    if id(value) not in seen:
        sign, first, *operands = (
            operand if isinstance(operand, str) else again(operand, numbers, seen)
            for operand in value.made
        )
        seen[id(value)] = (
            -first
            if sign == "negative"
            else math.sqrt(first)
            if sign == "sqrt"
            else _SIGNS[sign](first, *operands)
        )
    return seen[id(value)]
