"""Values of expressions from 60 decimal digits, where doubles lose some: terms may be thirty powers of ten apart."""

import cmath
import decimal
from collections.abc import Iterator, Mapping
from decimal import Decimal
from functools import lru_cache

from wavesweep.spec.expressions import Tree, evaluate, is_constant

# What has no value is NaN or infinite, and raises nothing.
_CONTEXT = decimal.Context(prec=60, Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN, traps=[])
_NOTHING = Decimal(0)
_REST = Decimal("1e-62")  # relative, of a Taylor series
_WHOLE = 2**53  # from here on doubles are no whole numbers that somebody meant


def exactly(tree: Tree, numbers: Mapping[str, float | complex]) -> float | complex:
    """Return the value of a tree without signals, rounded once, for numbers that are exact; NaN or infinite if there is none.

    It is complex if it is not real. Powers of other than positive numbers are rounded themselves if their exponents are no
    whole numbers.
    """
    known = {constant: constant for constant in constants_of(tree)} | dict(numbers)
    with decimal.localcontext(_CONTEXT):
        found = evaluate(named(tree), {name: _Decimals.of(number) for name, number in known.items()}, _Decimals)
        return complex(found) if found.im else float(found.re)


@lru_cache(maxsize=1024)
def named(tree: Tree) -> Tree:
    """Return the tree with a name in place of each constant, the constant itself, except for exponents that are constants."""
    if tree[0] == "number":
        return ("name", tree[1], tree[2])
    parts = [named(part) if isinstance(part, tuple) else part for part in tree[1:-1]]
    return (tree[0], parts[0], *tree[2:]) if tree[0] == "**" and is_constant(tree[2]) else (tree[0], *parts, tree[-1])


def constants_of(tree: Tree) -> Iterator[float]:
    """Yield the constants of a tree."""
    if tree[0] == "number":
        yield tree[1]
    for part in tree[1:-1]:
        if isinstance(part, tuple):
            yield from constants_of(part)


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
        exponent = self.of(exponent)
        if exponent.im == self.im == 0 < self.re:
            return _Decimals(self.re**exponent.re)
        if exponent.im == 0 and exponent.re == exponent.re.to_integral_value() and abs(exponent.re) < _WHOLE:
            return self._to_whole(int(exponent.re))
        base, exponent = complex(self), complex(exponent)
        try:
            real = base.imag == exponent.imag == 0 <= base.real
            return self.of(base.real**exponent.real if real else base**exponent)
        except ArithmeticError:
            return _Decimals(Decimal("nan"))

    def _to_whole(self, exponent):
        total = _Decimals(Decimal(1))
        for bit in f"{abs(exponent):b}":
            total = total * total * self if bit == "1" else total * total
        return total if exponent >= 0 else 1 / total

    def sqrt(self):
        """The principal square root."""
        size = (((self.re * self.re + self.im * self.im).sqrt() + abs(self.re)) / 2).sqrt()
        if not size:
            return _Decimals(size)
        other = abs(self.im) / (2 * size)
        re, im = (size, other) if self.re >= 0 else (other, size)
        return _Decimals(re, -im if self.im < 0 else im)

    def exp(self):
        """The real part by the library, the angle by `exp(i a) = exp(i a/2^k)^(2^k)`."""
        halvings = max(0, self.im.adjusted() * 4 + 8) if self.im else 0
        part = self.im / 2**halvings
        turned = _Decimals(_series(Decimal(1), -part * part, 1), _series(part, -part * part, 2))
        for _ in range(halvings):
            turned = turned * turned
        return turned * _Decimals(self.re.exp())

    def sin(self):
        """The sine (angle in rad), in all digits also next to 0."""
        if not self.im:
            return _Decimals(_series(self.re, -self.re * self.re, 2) if abs(self.re) < 1 else self._turned().im)
        even, odd = _halves(self.im)
        along = _Decimals(self.re)
        return _Decimals(along.sin().re * even, along.cos().re * odd)

    def cos(self):
        """The cosine (angle in rad)."""
        along = self._turned()
        even, odd = _halves(self.im)
        return _Decimals(along.re * even, -along.im * odd)

    def _turned(self):
        return _Decimals(_NOTHING, self.re).exp()

    def tan(self):
        """The tangent (angle in rad)."""
        return self.sin() / self.cos()

    def log(self):
        """The principal logarithm; of numbers that are not positive, Newton's method from that of doubles."""
        if self.im == 0 < self.re or not complex(self):
            return _Decimals(self.re.ln())
        found = self.of(cmath.log(complex(self)))
        for _ in range(2):  # 16 digits, 32, all
            found = found + self * (-found).exp() - self.of(1)
        return found


def _series(term, factor, n):
    """The sum of a term and those that follow it, each `factor/(n (n + 1))` times the one before, n two more each time."""
    total = term
    while abs(term) > _REST * abs(total):
        term *= factor / (n * (n + 1))
        total += term
        n += 2
    return total


def _halves(x):
    """The hyperbolic cosine and sine, the latter in all digits also next to 0."""
    up, down = x.exp(), (-x).exp()
    if abs(x) > 1:
        return (up + down) / 2, (up - down) / 2
    return (up + down) / 2, _series(x, x * x, 2)
