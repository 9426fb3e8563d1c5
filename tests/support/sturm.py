"""Real roots counted exactly: Sturm's theorem in rational arithmetic."""

from fractions import Fraction
from itertools import pairwise


def from_roots(roots):
    """Coefficients in the basis U_0, U_1, ... of the monic polynomial with these real roots and complex pairs."""
    c = [Fraction(1)]
    for root in roots:
        if isinstance(root, complex):
            real, size = Fraction(root.real), Fraction(root.real) ** 2 + Fraction(root.imag) ** 2
            once = _times_x(c)
            c = _add(_add(_times_x(once), once, -2 * real), c, size)
        else:
            c = _add(_times_x(c), c, -Fraction(root))
    return c


def _times_x(c):
    """`x U_k = (U_{k+1} + U_{k-1})/2`."""
    out = [Fraction(0)] * (len(c) + 1)
    for k, value in enumerate(c):
        out[k + 1] += value / 2
        if k:
            out[k - 1] += value / 2
    return out


def _add(long, short, factor):
    return [a + factor * (short[i] if i < len(short) else 0) for i, a in enumerate(long)]


def powers(c):
    """Coefficients of 1, x, x^2, ... of `sum c_k U_k`, without leading zeros."""
    before, now = [Fraction(0)], [Fraction(1)]
    out = [Fraction(0)] * len(c)
    for value in c:
        out = _add(out, now, Fraction(value))
        before, now = now, _add([Fraction(0)] + [2 * a for a in now], before, -1)
    while out and out[-1] == 0:
        out.pop()
    return out


def chain(polynomial):
    """Sturm's sequence of a polynomial in powers of x."""
    links = [polynomial, [k * a for k, a in enumerate(polynomial)][1:]]
    while links[-1]:
        rest = list(links[-2])
        while len(rest) >= len(links[-1]):
            factor, shift = rest[-1] / links[-1][-1], len(rest) - len(links[-1])
            for i, a in enumerate(links[-1]):
                rest[shift + i] -= factor * a
            rest.pop()
        while rest and rest[-1] == 0:
            rest.pop()
        scale = abs(rest[-1]) if rest else 1  # keeps the fractions short; a positive factor changes no sign
        links.append([-a / scale for a in rest])
    return links[:-1]


def count(links, low, high):
    """Distinct real roots in (low, high], exactly."""

    def changes(x):
        signs = [value for link in links if (value := _value(link, Fraction(x))) != 0]
        return sum((a < 0) != (b < 0) for a, b in pairwise(signs))

    return changes(low) - changes(high)


def sign(polynomial, x):
    """Sign of a polynomial in powers of x, exactly."""
    value = _value(polynomial, Fraction(float(x)))
    return (value > 0) - (value < 0)


def _value(polynomial, x):
    out = Fraction(0)
    for a in reversed(polynomial):
        out = out * x + a
    return out
