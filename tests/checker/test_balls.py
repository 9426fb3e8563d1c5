"""Enclosures of numbers over a cell, against 100 digits and against exact products at points of it."""

import random
from fractions import Fraction

import mpmath
import pytest

from wavesweep.checker import balls
from wavesweep.checker.balls import ONE, Cell, Refused, Ring, number
from wavesweep.checker.reader.loops import Unreadable

EXACT = mpmath.MPContext()
EXACT.dps = 100
NAMES = "abcd"  # of sides
FUNCTIONS = {  # what it is, in both arithmetics; where its argument may lie; by what an argument may vary
    "sqrt": (balls.sqrt, EXACT.sqrt, (1e-6, 1e6), 0.3),
    "log": (balls.log, EXACT.log, (1e-9, 1e9), 0.3),
    "exp": (balls.exp, EXACT.exp, (-30, 12), 0.01),
    "cos": (balls.cos, EXACT.cos, (-60, 13), 0.005),
    "sin": (balls.sin, EXACT.sin, (-60, 13), 0.005),
    "tan": (balls.tan, EXACT.tan, (-1.2, 1.2), 0.1),
    "1/x": (lambda x: 1 / (x + 0 * balls.pi), lambda x: 1 / x, (-1e3, -1e-3), 0.3),
    "1/x exactly": (lambda x: 1 / x, lambda x: 1 / x, (1e-3, 1e3), 0.3),
    "x**3": (lambda x: x**3, lambda x: x**3, (-50, 50), 0.3),
    "x**-2": (lambda x: x**-2, lambda x: x**-2, (0.02, 50), 0.3),
    "x**0.5": (lambda x: x ** Fraction(1, 2), EXACT.sqrt, (0.02, 50), 0.3),
    "x**-0.3": (lambda x: x ** Fraction(-3, 10), lambda x: x ** EXACT.mpf("-0.3"), (0.02, 50), 0.1),
    "pi x": (lambda x: balls.pi * x - 3, lambda x: EXACT.pi * x - 3, (-9, 9), 0.3),
}


def real(x: Fraction):
    return EXACT.mpf(x.numerator) / x.denominator


def at(cell: Cell, polynomial: tuple, shares: list[Fraction]) -> Fraction:
    """The value of a polynomial at a point of its cell, without its radius, in units."""
    total = Fraction(0)
    for powers, c in zip(cell.ring.monomials, polynomial[1:], strict=False):
        term = Fraction(c)
        for share, power in zip(shares, powers, strict=True):
            term *= share**power
        total += term
    return total


def drawn(draw: random.Random, low: float, high: float) -> Fraction:
    """By its size, where the range has one sign."""
    if low * high > 0:
        share = draw.random()
        return Fraction(f"{low ** (1 - share) * high**share:.20f}") if low > 0 else -drawn(draw, -high, -low)
    return Fraction(f"{draw.uniform(low, high):.20f}")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_of_sides_lies_in_its_enclosure(name):
    """Of 0 to 4 sides; and the enclosure is no wider than what its order leaves out."""
    ours, exactly, (low, high), spread = FUNCTIONS[name]
    draw = random.Random(name)  # noqa: S311
    for width in (0, 0, 0, 1, 1, 2, 3, 4):
        centre = drawn(draw, low, high)
        shares = [Fraction(draw.randint(1, 9)) for _ in range(width)]
        half = abs(centre) * Fraction(spread) * min(1, Fraction(1, 9 * max(width, 1)))
        ends = {side: (-share * half, share * half) for side, share in zip(NAMES, shares, strict=False)}
        x = number(centre)
        for side, pair in ends.items():
            x = x + balls.side(side, pair) * Fraction(1, 3)
        if name == "1/x exactly" and width:
            continue  # a sum has no exact reciprocal
        cell = Cell(ends)
        found = ours(x).value(cell)
        off = []
        for _ in range(6):
            point = [Fraction(draw.choice((-1, 1, draw.uniform(-1, 1)))) for _ in range(width)]
            value = centre + sum(s * end[1] / 3 for s, end in zip(point, ends.values(), strict=True))
            off.append(abs(at(cell, found, point) - Fraction(str(exactly(real(value)) * ONE))))
        assert max(off) <= found[0]
        size = abs(found[1]) / ONE
        assert found[0] <= (ONE >> 140) * (1 + size) + 1000 * max(off) * bool(width)


@pytest.mark.parametrize("width", range(5))
def test_a_product_encloses_all_products(width):
    """Of polynomials with radii, large and of few units, where it counts that they are rounded."""
    draw = random.Random(width)  # noqa: S311
    ring = Ring(width)
    cell = Cell({name: (Fraction(-1), Fraction(1)) for name in NAMES[:width]})
    terms = len(ring.monomials)
    for _ in range(60):
        bits = draw.choice((96, 100, 192))
        factors = []
        for _ in range(2):
            parts = [draw.randint(-(1 << bits), 1 << bits) for _ in range(draw.choice((1, terms)))]
            factors.append((draw.choice((0, draw.randint(0, 1 << (bits - 1)))), *parts))
        product = ring.multiply(*factors)
        point = [Fraction(draw.choice((-1, 1, draw.uniform(-1, 1)))) for _ in range(width)]
        first, second = ([at(cell, each, point) + sign * each[0] for sign in (-1, 1)] for each in factors)
        middle = at(cell, product, point)
        off = max(abs(x * y / ONE - middle) for x in first for y in second)
        assert off <= product[0]
        left_out = sum(map(abs, factors[0][1:])) * sum(map(abs, factors[1][1:])) * (len(factors[0]) > 2 and len(factors[1]) > 2)
        radii = sum(map(abs, factors[0])) * factors[1][0] + sum(map(abs, factors[1])) * factors[0][0]
        assert product[0] <= Fraction(left_out + radii, ONE) + terms + 2
    assert ring.multiply(balls.UNIT, factors[0]) == ring.multiply(factors[0], balls.UNIT) == factors[0]


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda x: balls.log(x - 1), "a logarithm of what may be 0 or less"),
        (lambda x: balls.sqrt(x - 1), "a root of what may be 0 or less"),
        (lambda x: balls.sqrt(-x), "a root of what may be 0 or less"),
        (lambda x: balls.log(-x), "a logarithm of what may be 0 or less"),
        (lambda x: 1 / (x * x - 1), "a divisor may be 0"),
        (lambda x: balls.exp(15 * x), "a large exponential"),
        (lambda x: balls.cos(400 * x), "a large argument"),
        (lambda x: balls.exp(3 * x), "a wide argument"),
    ],
)
def test_what_has_no_enclosure_is_refused(make, why):
    x = balls.side("x", (Fraction(1, 2), Fraction(3, 2)))
    ends = (
        (Fraction(1), Fraction(1))
        if "large" in why or ("wide" not in why and "may" not in why)
        else (Fraction(1, 2), Fraction(3, 2))
    )
    with pytest.raises(Refused, match=why):
        make(x).value(Cell({"x": ends}))


def test_numbers_are_compared_where_they_differ():
    assert balls.at_least(balls.pi, Fraction(314159265, 10**8))
    assert not balls.at_least(Fraction(314159265, 10**8), balls.pi)
    with pytest.raises(Refused, match="too near"):
        balls.at_least(balls.sqrt(2) * balls.sqrt(2), 2)


def test_numbers_have_the_sizes_that_are_told():
    assert balls.decimal("1" * 60) == int("1" * 60)
    assert balls.decimal("-1.5e-100") == Fraction(-15, 10**101)
    for text in ("1" * 61, "1e101", "1e-101", "1 ", "", "1e", "."):
        with pytest.raises(Unreadable, match="no decimal number"):
            balls.decimal(text)
    x = number(Fraction(1, 3))
    assert (x**64).exact == {(): Fraction(1, 3**64)}
    assert (x**-64).exact == {(): Fraction(3**64)}
    assert (x**65).exact is None
    assert number(2**8190).exact == {(): 2**8190}
    small = number(Fraction(1, 2**4095))
    assert (small * small).exact == {(): Fraction(1, 2**8190)}
    assert (small * small * Fraction(1, 2)).exact is None
    with pytest.raises(Unreadable, match="a division by 0"):
        x / (x - x)
    assert (2**x).value(balls.POINT)[1] / ONE == pytest.approx(2 ** (1 / 3), abs=1e-16)
    with pytest.raises(Unreadable, match="too many digits"):
        number(2**8192)
    assert balls.whole(3) == 3
    with pytest.raises(Unreadable, match="has to be a whole number"):
        balls.whole(Fraction(1, 2))
    x = balls.side("x", (Fraction(1), Fraction(3)))
    assert balls.least(2 - x) == -1
    assert balls.least(2 * x + 1) == 3
    for read, other in ((balls.least, x * x), (balls.least, balls.pi), (balls.exact, x)):
        with pytest.raises(Unreadable, match="is computed"):
            read(other)
