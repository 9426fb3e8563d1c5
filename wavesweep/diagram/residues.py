"""Numbers in residues of a prime, in which what is exactly zero is zero, and next to nothing else is.

A number has a residue if it is a fraction, as doubles and decimals are, and so has a sum, product or quotient of such numbers.
So have roots of fractions, of a prime in which they have one. Other roots and broken powers have some residue, the same for
the same argument.
"""

from __future__ import annotations

import operator
from fractions import Fraction
from hashlib import sha256
from math import isqrt

from wavesweep.diagram.elimination import PRIME


class Field:
    """Residues of a prime, with roots: the product of roots is the root of the product, as it is of real numbers.

    A prime of 4n + 3 has roots of half of all fractions. The roots are 1 and -1 times others, and one sign of each is as good
    as the other, if only the roots of products follow from those of their factors.
    """

    def __init__(self, prime: int, decimals: bool = False, scattered: bool = False) -> None:
        """decimals: doubles stand for the shortest decimals that are read as them. scattered: any residue is a root."""
        self.prime, self.decimals, self.scattered = prime, decimals, scattered
        self.roots = {Fraction(1): 1}  # each product of the numbers whose roots were taken, with the residue of its root

    def of(self, number: object) -> Residue:
        """The residue of a double or a fraction."""
        if isinstance(number, Residue):
            return number
        exact = Fraction(repr(float(number))) if self.decimals and not isinstance(number, Fraction) else Fraction(number)
        return Residue(self, exact.numerator * pow(exact.denominator, -1, self.prime), exact)

    def root(self, number: Residue) -> Residue:
        """The root of a residue; some residue in its place if the number is no fraction. Errors: NoRoot."""
        if number.exact is None or self.scattered:
            return self.some("root", number.value)
        for product, root in self.roots.items():
            if (whole := _whole_root(number.exact * product)) is not None:
                return Residue(self, self.of(whole).value * pow(root, -1, self.prime), whole if product == 1 else None)
        if len(self.roots) == MOST_ROOTS:
            return self.some("root", number.value)
        found = pow(number.value, (self.prime + 1) // 4, self.prime)
        if (found * found - number.value) % self.prime:
            raise NoRoot
        self.roots |= {product * number.exact: root * found for product, root in self.roots.items()}
        return Residue(self, found)

    def some(self, *given: object) -> Residue:
        """Some residue, the same for the same numbers."""
        return Residue(self, int.from_bytes(sha256(repr(given).encode()).digest()))


class NoRoot(ArithmeticError):
    """A number has no root in residues of this prime."""


# Primes of 4n + 3, one in two of which has a given root.
_LESS = (0, 24, 308, 576, 696, 800, 956, 1080, 1104, 1140, 1200, 1484, 1740, 2196, 2436, 2508, 2568, 2588, 2600, 2664, 2720)
_STILL_LESS = (2828, 2900, 3044, 3380, 3488, 3800, 3804, 3948, 3960, 4440, 4556, 4704, 4788, 4896, 5016)
PRIMES = tuple(PRIME - less for less in _LESS + _STILL_LESS)
MOST_ROOTS = 8  # products of three roots; one prime in eight has them
LONGEST = 8192  # bits of a fraction whose root is taken


def _whole_root(number):
    """The root of a fraction, if it is a fraction. Errors: ValueError for a negative one."""
    above, below = isqrt(number.numerator), isqrt(number.denominator)
    return Fraction(above, below) if (above * above, below * below) == (number.numerator, number.denominator) else None


class Residue:
    """A residue, with the arithmetic of expressions, and the fraction that it is of, if it is known.

    Errors: ZeroDivisionError.
    """

    __slots__ = ("exact", "field", "value")

    def __init__(self, field: Field, value: int, exact: Fraction | None = None) -> None:
        self.field, self.value = field, value % field.prime
        short = exact is not None and exact.numerator.bit_length() + exact.denominator.bit_length() < LONGEST
        self.exact = exact if short else None

    def _with(self, other, operation):
        """A residue from two: by their values, and by their fractions if both are known."""
        other = self.field.of(other)
        known = self.exact is not None and other.exact is not None
        exact = operation(self.exact, other.exact) if known else None
        return Residue(self.field, operation(self.value, other.value), exact)

    def __add__(self, other):
        return self._with(other, operator.add)

    def __sub__(self, other):
        return self._with(other, operator.sub)

    def __mul__(self, other):
        return self._with(other, operator.mul)

    def __truediv__(self, other):
        return self * self.field.of(other).inverse()

    def __pow__(self, other):
        if isinstance(other, float) and other == 0.5:
            return self.sqrt()
        if not isinstance(other, Residue) and float(other).is_integer():
            return Residue(self.field, pow(self.value, int(other), self.field.prime))
        return self.field.some("power", self.value, self.field.of(other).value)

    def __neg__(self):
        return self * -1

    def __radd__(self, other):
        return self + other

    def __rsub__(self, other):
        return -self + other

    def __rmul__(self, other):
        return self * other

    def __rtruediv__(self, other):
        return self.field.of(other) / self

    def __bool__(self):
        return bool(self.value)

    def inverse(self) -> Residue:
        """1 over it."""
        if not self:
            raise ZeroDivisionError
        return Residue(self.field, pow(self.value, -1, self.field.prime), 1 / self.exact if self.exact else None)

    def sqrt(self) -> Residue:
        """The root, see `Field.root`."""
        return self.field.root(self)
