"""Values of expressions from decimal arithmetic of 60 digits, for sums that cancel: terms may be thirty powers of ten apart."""

import decimal
from collections.abc import Iterator, Mapping
from decimal import Decimal
from functools import lru_cache

from wavesweep.spec.expressions import Tree, evaluate

# What has no value is NaN or infinite, and raises nothing.
_CONTEXT = decimal.Context(prec=60, Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN, traps=[])
_NOTHING = Decimal(0)


def exactly(tree: Tree, numbers: Mapping[str, float | complex]) -> float | complex:
    """Return the value of a tree without signals, rounded once, for numbers that are exact; NaN or infinite if there is none.

    It is complex if it is not real. Powers whose exponents are no whole numbers are rounded themselves.
    """
    known = {constant: constant for constant in _constants(tree)} | dict(numbers)
    with decimal.localcontext(_CONTEXT):
        found = evaluate(_named(tree), {name: _Decimals.of(number) for name, number in known.items()}, _Decimals.sqrt)
        return complex(found) if found.im else float(found.re)


@lru_cache(maxsize=1024)
def _named(tree):
    """The tree with a name in place of each constant, the constant itself, except for exponents."""
    if tree[0] == "number":
        return ("name", tree[1], tree[2])
    parts = [_named(part) if isinstance(part, tuple) else part for part in tree[1:-1]]
    return (tree[0], parts[0], *tree[2:]) if tree[0] == "**" else (tree[0], *parts, tree[-1])


def _constants(tree) -> Iterator[float]:
    if tree[0] == "number":
        yield tree[1]
    for part in tree[1:-1]:
        if isinstance(part, tuple):
            yield from _constants(part)


class _Decimals:
    """A complex number of two decimals."""

    __slots__ = ("im", "re")

    def __init__(self, re, im=_NOTHING):
        self.re, self.im = re, im

    @staticmethod
    def of(number):
        """The number itself, or the exact value of a double or a complex number."""
        return number if isinstance(number, _Decimals) else _Decimals(Decimal(number.real), Decimal(number.imag))

    def __complex__(self):
        return complex(float(self.re), float(self.im))

    def __neg__(self):
        return _Decimals(-self.re, -self.im)

    def __add__(self, other):
        return _Decimals(self.re + other.re, self.im + other.im)

    def __sub__(self, other):
        return self + -other

    def __mul__(self, other):
        other = self.of(other)
        return _Decimals(self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re)

    __rmul__ = __mul__

    def __truediv__(self, other):
        size, part = other.re * other.re + other.im * other.im, self * _Decimals(other.re, -other.im)
        return _Decimals(part.re / size, part.im / size)

    def __rtruediv__(self, other):
        return self.of(other) / self

    def __pow__(self, exponent):
        base, exponent = complex(self), complex(self.of(exponent))
        try:
            real = base.imag == exponent.imag == 0 <= base.real
            return self.of(base.real**exponent.real if real else base**exponent)
        except ArithmeticError:
            return _Decimals(Decimal("nan"))

    def sqrt(self):
        """The principal square root."""
        size = (((self.re * self.re + self.im * self.im).sqrt() + abs(self.re)) / 2).sqrt()
        if not size:
            return _Decimals(size)
        other = abs(self.im) / (2 * size)
        re, im = (size, other) if self.re >= 0 else (other, size)
        return _Decimals(re, -im if self.im < 0 else im)
