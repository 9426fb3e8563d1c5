"""Numbers that are enclosed while the sides of a cell have any of their values.

A polynomial is a tuple (radius, c0, c1, ...) of whole numbers in units of 2^-BITS: the sum of c_k times the k-th monomial in the
sides' own variables, -1 <= s <= 1, plus or minus the radius. Whatever is rounded or left out counts in the radius. A `Number` is
a coefficient of a loop, exact or by what it is computed of; its polynomial in a cell is made when it is asked for.

The module is an arithmetic of the reader: `number`, `whole`, `exact`, `pi`, `sqrt`, `sin`, `cos`, `tan`, `exp`, `log`, `at_least`.
"""

import re
from fractions import Fraction
from functools import cache, lru_cache, partial
from itertools import product as all_of
from math import isqrt

from .reader.loops import Unreadable

BITS = 192
ONE = 1 << BITS
GUARD = 64  # further bits of exp, cos, sin and log
UNIT = (0, ONE)
ORDERS = {
    0: 0,
    1: 6,
    2: 4,
    3: 3,
}  # of polynomials in so many sides, else 2: errors of products of many ticks
LONGEST = 60  # characters of a number
EXPONENT = 100  # of a number: a key has sizes from 1e-60 to 1e60
LARGEST = 8192  # bits of exact numbers; those beyond are enclosed
POWER = 64
COMPUTED = "a rate, a time or a count follows from a number with a range, or has no proof as it is computed: give it values"
DIGITS = "[0-9](?:_?[0-9])*"
DECIMAL = re.compile(rf"[+-]?(?:{DIGITS}(?:\.(?:{DIGITS})?)?|\.{DIGITS})(?:[eE]([+-]?{DIGITS}))?")


class Refused(Exception):
    """Not proved."""


def decimal(text: str) -> Fraction:
    """A number as it is written, of no more digits than somebody would write."""
    match = DECIMAL.fullmatch(text)
    if not match or len(text) > LONGEST or abs(int(match[1] or 0)) > EXPONENT:
        raise Unreadable(f"{text[:LONGEST]!r} is no decimal number of at most {LONGEST} characters")
    return Fraction(text)


def ball(x: Fraction) -> tuple:
    whole = (x.numerator << BITS) // x.denominator
    return int(whole * x.denominator != x.numerator << BITS), whole


def _above(numerator: int, denominator: int) -> int:
    """The least whole number that is not below the fraction."""
    return -(-numerator // denominator)


def negative(a):
    return a[0], *(-c for c in a[1:])


def add(a, b):
    if len(a) < len(b):
        a, b = b, a
    return *(x + y for x, y in zip(a, b, strict=False)), *a[len(b) :]


class Ring:
    """Polynomials in so many sides up to an order: what is above it counts as an error."""

    def __init__(self, sides: int):
        self.order = ORDERS.get(sides, 2)
        powers = [
            powers_of_sides
            for powers_of_sides in all_of(range(self.order + 1), repeat=sides)
            if sum(powers_of_sides) <= self.order
        ]
        self.monomials = sorted(
            powers, key=lambda powers_of_sides: (sum(powers_of_sides), powers_of_sides[::-1])
        )
        places = {powers_of_sides: index for index, powers_of_sides in enumerate(self.monomials)}
        # where the monomials of each degree begin, and of each monomial where its products with the first ones are
        self.begins = [
            sum(sum(powers_of_sides) < degree for powers_of_sides in self.monomials)
            for degree in range(self.order + 2)
        ]
        self.table = [
            [
                places[tuple(i + j for i, j in zip(a, b, strict=True))]
                for b in self.monomials
                if sum(a) + sum(b) <= self.order
            ]
            for a in self.monomials
        ]

    def multiply(self, a, b):
        """|(A + a)(B + b) - A B| <= |A| b + a (|B| + b); each coefficient is rounded down by less than 1."""
        if a is UNIT:
            return b
        if b is UNIT:
            return a
        if len(a) == 2 and len(b) == 2:
            radius = abs(a[1]) * b[0] + a[0] * (abs(b[1]) + b[0])
            return (radius >> BITS) + 2, (a[1] * b[1]) >> BITS
        radius = sum(map(abs, a[1:])) * b[0] + a[0] * (sum(map(abs, b[1:])) + b[0])
        if len(a) == 2 or len(b) == 2:
            factor, polynomial = (a[1], b) if len(a) == 2 else (b[1], a)
            product = [factor * c for c in polynomial[1:]]
        else:
            product = [0] * len(self.monomials)
            for row, x in zip(self.table, a[1:], strict=False):
                if x:
                    for place, y in zip(row, b[1:], strict=False):
                        product[place] += x * y
            for degree in range(
                1, self.order + 1
            ):  # of a, with those of b that lead beyond the order
                here = a[1 + self.begins[degree] : 1 + self.begins[degree + 1]]
                beyond = b[1 + self.begins[self.order - degree + 1] :]
                radius += sum(map(abs, here)) * sum(map(abs, beyond))
        return (radius >> BITS) + len(product) + 1, *(c >> BITS for c in product)

    def series(self, h, values, rest):
        """values[0] + values[1] h + values[2] h^2 + ... +- rest."""
        total = values[-1]
        for value in reversed(values[:-1]):
            total = add(self.multiply(total, h), value)
        return total[0] + rest, *total[1:]

    def reciprocal(self, a):
        """1/(c + h) by (-1)^k h^k/c^(k + 1); what n terms leave out is below b^n/(|c|^n (|c| - b)), |h| <= b."""
        c, h, b = _parted(a)
        if abs(c) <= b:
            raise Refused("a divisor may be 0")
        inverse = (1, ONE * ONE // c)
        values = [inverse]
        for _ in range(self.order if b else 0):
            values.append(negative(self.multiply(values[-1], inverse)))
        n = len(values)
        return self.series(h, values, _above(b**n * ONE * ONE, abs(c) ** n * (abs(c) - b)))

    def root(self, a):
        """By binomial(1/2, k) h^k c^(1/2 - k); n terms leave out less than b^n (c - b)^(1/2 - n)."""
        c, h, b = _parted(a)
        if c <= b:
            raise Refused("a root of what may be 0 or less")
        values = [(1, isqrt(c << BITS))]
        inverse = self.reciprocal((0, c))
        for k in range(self.order if b else 0):
            share = ball(Fraction(1 - 2 * k, 2 * k + 2))
            values.append(self.multiply(self.multiply(values[-1], inverse), share))
        n = len(values)
        return self.series(
            h, values, _above(b**n * (isqrt((c - b) << BITS) + 1), (c - b) ** n) if b else 0
        )

    def logarithm(self, a):
        """By log c and (-1)^(k + 1) h^k/(k c^k); n terms leave out less than b^n/(n (c - b)^n)."""
        c, h, b = _parted(a)
        if c <= b:
            raise Refused("a logarithm of what may be 0 or less")
        values = [_logarithm(c)]
        inverse = self.reciprocal((0, c))
        power = UNIT
        for k in range(1, self.order + 1 if b else 1):
            power = self.multiply(power, inverse)
            values.append(self.multiply(power, ball(Fraction(1 if k % 2 else -1, k))))
        n = len(values)
        return self.series(h, values, _above(b**n * ONE, n * (c - b) ** n) if b else 0)

    def exponential(self, a):
        c, h, b = _parted(a)
        e = _exp_cos_sin(c)[0]
        return self._taylor(h, b, [e], 3 * (e[0] + e[1]))  # e^(c + b) <= 3 e^c

    def cosine(self, a):
        c, h, b = _parted(a)
        _, co, si = _exp_cos_sin(c)
        return self._taylor(h, b, [co, negative(si), negative(co), si], ONE)

    def sine(self, a):
        c, h, b = _parted(a)
        _, co, si = _exp_cos_sin(c)
        return self._taylor(h, b, [si, co, negative(si), negative(co)], ONE)

    def tangent(self, a):
        return self.multiply(self.sine(a), self.reciprocal(self.cosine(a)))

    def _taylor(self, h, b, derivatives, largest):
        """A function whose derivatives at c are these in turn, and nowhere on |h| <= b larger than `largest`."""
        if b > ONE:
            raise Refused("a wide argument of a function")
        values = []
        factorial = 1
        for k in range(self.order + 1 if b else 1):
            values.append(
                self.multiply(derivatives[k % len(derivatives)], ball(Fraction(1, factorial)))
            )
            factorial *= k + 1
        n = len(values)
        return self.series(h, values, _above(b**n * largest, factorial * ONE**n) if b else 0)


def _parted(a):
    """(c, h, b): a = c + h with an exact c and |h| <= b."""
    return a[1], (a[0], 0, *a[2:]), a[0] + sum(map(abs, a[2:]))


@lru_cache(1024)
def _exp_cos_sin(c: int):
    """exp, cos and sin of an exact c, as balls: the series of `c/2^k`, then k doublings, `e^2 = e e`, `cos 2x = cos^2 - sin^2`.

    Rounding of the sum, 2 a term, grows at most 4 times in each doubling: far below the guard bits.
    """
    halvings = max(0, abs(c).bit_length() - BITS + 6)
    if halvings > 12:
        raise Refused("a large argument of a function")
    small = (c << GUARD) >> halvings
    term = ONE << GUARD
    parts = [0, 0, 0, 0]
    k = 0
    while abs(term) > 1:
        parts[k % 4] += term
        k += 1
        term = (term * small >> (BITS + GUARD)) // k
    e = sum(parts)
    co = parts[0] - parts[2]
    si = parts[1] - parts[3]
    for _ in range(halvings):
        e = e * e >> (BITS + GUARD)
        co, si = (co * co - si * si) >> (BITS + GUARD), 2 * co * si >> (BITS + GUARD)
    if e >> GUARD > ONE << 20:
        raise Refused("a large exponential")
    return tuple((2, value >> GUARD) for value in (e, co, si))


@lru_cache(1024)
def _logarithm(c: int):
    """c = m 2^k with m between 2/3 and 4/3, log c = k log 2 + log m."""
    k = (3 * c // 2).bit_length() - 1 - BITS
    m = c << (GUARD - k) if k <= GUARD else c >> (k - GUARD)
    total = _log_near_one(m) + k * _log_near_one(2 * ONE << GUARD)
    return abs(k) + 3, total >> GUARD


def _log_near_one(m: int) -> int:
    """2 (t + t^3/3 + t^5/5 + ...), t = (m - 1)/(m + 1), with the guard bits."""
    unity = ONE << GUARD
    t = ((m - unity) << (BITS + GUARD)) // (m + unity)
    total = 0
    power = t
    k = 1
    while abs(power) > 1:
        total += power // k
        power = (power * t >> (BITS + GUARD)) * t >> (BITS + GUARD)
        k += 2
    return 2 * total


def _pi(_):
    """4 (4 arctan(1/5) - arctan(1/239))."""
    total = 0
    for factor, n in ((16, 5), (-4, 239)):
        power = (ONE << GUARD) // n
        k = 1
        while power:
            total += (factor if k % 4 == 1 else -factor) * (power // k)
            power //= n * n
            k += 2
    return 2, total >> GUARD


class Cell:
    """Sides with their ranges, and polynomials of their powers: p = centre + half s."""

    def __init__(self, sides: dict[str, tuple[Fraction, Fraction]]):
        wide = [name for name, (low, high) in sides.items() if low < high]
        self.ring = _ring(len(wide))
        self.width = len(wide)
        self.powers: dict[tuple[str, int], tuple] = {}
        for name, (low, high) in sides.items():
            centre = ball((low + high) / 2)
            if name in wide:
                half = ball((high - low) / 2)
                place = self.ring.monomials.index(
                    tuple(int(name_of_side == name) for name_of_side in wide)
                )
                self.powers[name, 1] = (centre[0] + half[0], centre[1], *[0] * (place - 1), half[1])
            else:
                self.powers[name, 1] = centre

    def power(self, name: str, power: int):
        if (name, power) not in self.powers:
            if power < 0:
                found = self.ring.reciprocal(self.power(name, -power))
            else:
                found = self.ring.multiply(self.power(name, power - 1), self.power(name, 1))
            self.powers[name, power] = found
        return self.powers[name, power]


@cache
def _ring(sides: int) -> Ring:
    return Ring(sides)


POINT = Cell({})


def sum_of(_, a, b):
    return add(a, b)


class Number:
    """exact: {monomial: share} with fractions, monomials as ((side, power), ...); None if it is made of other numbers.

    make: a function of a ring and of the parts' polynomials. moves: whether it depends on a side.
    """

    __slots__ = ("cell", "exact", "kept", "make", "moves", "parts")

    def __init__(self, exact=None, make=None, parts=()):
        self.exact = exact
        self.make = make
        self.parts = parts
        self.moves = any(part.moves for part in parts) if exact is None else any(exact)
        self.cell = None
        self.kept = None

    def value(self, cell: Cell):
        """Its polynomial in a cell."""
        waiting = [] if self.known(cell) else [self]
        while waiting:  # those first that others are made of
            now = waiting[-1]
            missing = [part for part in now.parts if not part.known(cell)]
            if missing and not now.known(cell):
                waiting += missing
                continue
            waiting.pop()
            if not now.known(cell):
                now.kept = now.computed(cell)
                now.cell = cell
        return self.kept

    def known(self, cell: Cell) -> bool:
        return self.cell is cell or (self.kept is not None and not self.moves)

    def computed(self, cell: Cell):
        if self.exact is None:
            return self.make(cell.ring, *(part.kept for part in self.parts))
        if self.exact == {(): 1}:
            return UNIT
        total = (0, 0)
        for monomial, share in self.exact.items():
            term = ball(share)
            for name, power in monomial:
                term = cell.ring.multiply(term, cell.power(name, power))
            total = add(total, term)
        return total

    def __bool__(self):
        return self.exact != {}

    def __add__(self, other):
        other = number(other)
        if self.exact is not None and other.exact is not None:
            total = dict(self.exact)
            for monomial, share in other.exact.items():
                total[monomial] = total.get(monomial, 0) + share
            total_of_both = _exactly(total)
            if total_of_both is not None:
                return total_of_both
        return Number(None, sum_of, (self, other))

    def __mul__(self, other):
        other = number(other)
        if self.exact is not None and other.exact is not None:
            total: dict[tuple, Fraction] = {}
            for monomial, share in self.exact.items():
                for further, factor in other.exact.items():
                    both = _together(monomial, further)
                    total[both] = total.get(both, 0) + share * factor
            product = _exactly(total)
            if product is not None:
                return product
        if not self or not other:
            return Number({})
        return Number(None, Ring.multiply, (self, other))

    def __truediv__(self, other):
        other = number(other)
        if not other:
            raise Unreadable("a division by 0")
        if other.exact is not None and len(other.exact) == 1:
            ((monomial, share),) = other.exact.items()
            return self * Number({tuple((name, -power) for name, power in monomial): 1 / share})
        return self * Number(None, Ring.reciprocal, (other,)) if self else self

    def __neg__(self):
        return self * -1

    def __sub__(self, other):
        return self + -number(other)

    def __rsub__(self, other):
        return number(other) + -self

    def __rtruediv__(self, other):
        return number(other) / self

    __radd__ = __add__
    __rmul__ = __mul__

    def __pow__(self, power):
        power = exact(power)
        if power.denominator == 1 and abs(power) <= POWER:
            total = number(1)
            for _ in range(abs(power.numerator)):
                total = total * self
            return total if power >= 0 else 1 / total
        return sqrt(self) if power == Fraction(1, 2) else exp(log(self) * power)

    def __rpow__(self, base):
        return number(base) ** self


def _together(monomial, further):
    powers = dict(monomial)
    for name, power in further:
        powers[name] = powers.get(name, 0) + power
    return tuple(sorted((name, power) for name, power in powers.items() if power))


def _exactly(total: dict):
    """The exact number, or None if it has become too long to be kept so."""
    bits = sum(
        share.numerator.bit_length() + share.denominator.bit_length() for share in total.values()
    )
    if bits > LARGEST:
        return None
    return Number({monomial: share for monomial, share in total.items() if share})


class Side(str):
    """The name of a side, which knows its ends."""

    __slots__ = ("ends",)
    ends: tuple[Fraction, Fraction]


def side(name: str, ends: tuple[Fraction, Fraction]) -> Number:
    variable = Side(name)
    variable.ends = ends
    return Number({((variable, 1),): Fraction(1)})


def number(value) -> Number:
    if isinstance(value, Number):
        return value
    if isinstance(
        value, float | str
    ):  # a constant in an expression: the shortest decimal number of its double
        value = decimal(str(value))
    if isinstance(value, bool) or not isinstance(value, int | Fraction):
        raise Unreadable(f"{value!r} is no number")
    if value.numerator.bit_length() + value.denominator.bit_length() > LARGEST:
        raise Unreadable("a number with too many digits")
    return Number({(): Fraction(value)} if value else {})


def exact(value) -> Fraction:
    if number(value).moves:
        raise Unreadable(COMPUTED)
    return least(value)


def time(value):
    """A time, exact where it is the same in the whole of the sides."""
    return value if number(value).moves else least(value)


def least(value) -> Fraction:
    """The least value of a sum of sides, `c + sum of share * side`, in the whole of them."""
    exactly = number(value).exact
    if exactly is None:
        raise Unreadable(COMPUTED)
    total = Fraction(0)
    for monomial, share in exactly.items():
        match monomial:
            case ():
                total += share
            case ((name, 1),):
                total += min(share * end for end in name.ends)
            case _:
                raise Unreadable(COMPUTED)
    return total


def ends(value) -> tuple[Fraction, Fraction]:
    """The least and the largest value of a sum of sides; of what is computed otherwise what it surely reaches at corners, those
    left out at which it has none. Refused if it has none anywhere."""
    total = number(value)
    if total.exact is not None and all(
        sum(power for _, power in monomial) in (0, 1) for monomial in total.exact
    ):
        return least(total), -least(-total)
    values = []
    why = None
    for corner in all_of(*_sides(total)):
        try:
            values.append(total.value(Cell({name: (end, end) for name, end in corner})))
        except Refused as refused:
            why = refused
    if why and not values:
        raise why
    low = min(middle + radius for radius, middle in values)
    high = max(middle - radius for radius, middle in values)
    return Fraction(low, ONE), Fraction(high, ONE)


def _sides(value: Number) -> list[list[tuple[str, Fraction]]]:
    """The ends of each side that a number depends on."""
    sides: dict[str, list] = {}
    seen: set[int] = set()
    waiting = [value]
    while waiting:
        now = waiting.pop()
        if now.moves and id(now) not in seen:
            seen.add(id(now))
            waiting += now.parts
            for monomial in now.exact or {}:
                sides |= {name: [(name, end) for end in name.ends] for name, _ in monomial}
    return [*sides.values()]


def whole(value) -> int:
    count = exact(value)
    if count.denominator != 1:
        raise Unreadable(f"{float(count)} has to be a whole number")
    return int(count)


def at_least(value, bound) -> bool:
    radius, middle = (number(value) - number(bound)).value(POINT)
    if abs(middle) <= radius:
        raise Refused("two numbers are too near to each other to say which is larger")
    return middle > 0


pi = Number(None, _pi)


def sqrt(x) -> Number:
    return Number(None, Ring.root, (number(x),)) if number(x) else Number({})


def _of(function, x) -> Number:
    return Number(None, function, (number(x),))


exp = partial(_of, Ring.exponential)
log = partial(_of, Ring.logarithm)
cos = partial(_of, Ring.cosine)
sin = partial(_of, Ring.sine)
tan = partial(_of, Ring.tangent)
