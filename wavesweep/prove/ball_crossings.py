"""The values of a number at which a polynomial has a root on the unit circle, enclosed with proof.

Times a power of z, the polynomial is `U(x) + i sin(theta) V(x)` on the circle, x = cos(theta), or
with half angles if its degree is odd. Its roots there are the common roots of U and V in x and the
number, and those at z = 1 and z = -1. Boxes of both are cut until the signs of Bernstein
coefficients exclude them, or the linear parts of U and V leave next to nothing of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from math import comb

import numpy as np
from flint import arb, arb_mat, arb_poly, ctx

from wavesweep.prove.ball_polynomials import Budget, FamilyPart, bernstein, chebyshev
from wavesweep.prove.ticks import UndecidedError

MOST_OPEN = 200  # boxes at a time, and crossings of a part, beyond which these bits are too few
# shares of a range
ALL = (arb(0), arb(1))
FIRST_HALF = (arb(0), arb(0.5))
SECOND_HALF = (arb(0.5), arb(1))


class CrowdedError(UndecidedError):
    """More boxes are left than crossings are to be expected, as for an eigenvalue that is always
    on the circle."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """A value of the number, as a ball, at which a root may be on the circle, and its angle
    there."""

    value: arb
    theta: arb


def crossings(part: FamilyPart, budget: Budget) -> Iterator[Crossing]:
    """Yield enclosures of all values in a part at which a root is on the circle. Errors:
    UndecidedError."""
    width = part.high - part.low
    for table in part.polynomials:
        if not all(entry.is_finite() for entry in table.entries()):
            raise UndecidedError
        n = table.nrows() - 1
        if table.ncols() == 1:  # the same for all values
            count_outside(table.entries())
            continue
        real_roots = [(1, arb(0)), (-1, arb.pi())] if n else [(1, arb("nan"))]
        for z, theta in real_roots:
            powers = arb_mat([[arb(z) ** j for j in range(n + 1)]])
            at_z = powers * table
            for _, (low, high) in _boxes(at_z, at_z, budget):
                yield Crossing(part.low + width * low.union(high), theta)
        if n > 1:
            to_U, to_V = _on_circle(n, ctx.prec)
            for (left, right), (low, high) in _boxes(to_U * table, to_V * table, budget):
                half_angle = (1 - left.union(right)).nonnegative_part().sqrt().min(1).asin()
                yield Crossing(part.low + width * low.union(high), 2 * half_angle)


def is_unstable(part: FamilyPart) -> bool:
    """Whether some root is outside the circle for every value in a part, since a coefficient is too
    large.

    Coefficients of a frame that grows by many powers of ten say so long before the small roots are
    known.
    """
    for table in part.polynomials:
        *lower, leading = table.tolist()
        n = len(lower)
        for j, coefficient in enumerate(lower):
            largest = [
                comb(n, j) * c for c in leading
            ]  # of a polynomial whose roots are all inside
            above = [a - b for a, b in zip(coefficient, largest, strict=True)]
            below = [a + b for a, b in zip(coefficient, largest, strict=True)]
            if _have_one_sign([*below, *above]):
                return True
    return False


def count_outside(p: list[arb]) -> int:
    """The number of roots of a polynomial outside the unit circle (I. Schur; A. Cohn 1922). Errors:
    UndecidedError.

    p: coefficients of ascending powers.
    """
    outside = 0
    while len(p) > 1:
        first = p[0]
        last = p[-1]
        if abs(first) < abs(last):
            p = [last * a - first * b for a, b in zip(p[1:], p[-2::-1], strict=True)]
        elif abs(first) > abs(last):
            p = [first * a - last * b for a, b in zip(p[:-1], p[:0:-1], strict=True)]
            outside += 1
        else:
            raise UndecidedError
        scale = max(abs(c).upper() for c in p)
        if not (scale.is_finite() and scale > 0):
            raise UndecidedError
        p = [c / scale for c in p]
    if p[0].contains(0):
        raise UndecidedError
    return outside


@lru_cache(maxsize=64)
def _on_circle(n, bits):
    """The matrices from the coefficients of a polynomial to the Bernstein coefficients of U and
    V on (-1, 1)."""
    del bits
    half, odd = divmod(n, 2)
    if odd:  # cosines and sines of (k + 1/2) theta, over those of theta/2
        of_U = chebyshev(half + 1, 2, -1)
        of_V = chebyshev(half + 1, 2, 1)
    else:  # cos(k theta), and sin(k theta)/sin(theta), which is of degree k - 1
        of_U = chebyshev(half + 1, 1)
        of_V = [[0], *chebyshev(half, 2)]
    middle_twice = 0 if odd else 1  # the middle coefficient of an even degree stands once
    even = [*reversed(of_U), *of_U[middle_twice:]]
    negative = [[-c for c in p] for p in reversed(of_V)]
    uneven = [*negative, *of_V[middle_twice:]]
    return bernstein(even, half).transpose(), bernstein(uneven, half).transpose()


def _boxes(U, V, budget):
    """The boxes ((x from, x to), (number from, to)), in shares of the ranges, that may have a
    common root.

    U, V: Bernstein coefficients, the columns those of the number. A single row stands for functions
    of the number alone.
    """
    if all(entry.contains(0) for entry in (*U.entries(), *V.entries())):
        raise UndecidedError  # an eigenvalue is always on the circle
    # A box of 45 % of the bits encloses a crossing well enough.
    narrow = arb(2) ** (-int(0.45 * ctx.prec))
    count = 0
    open_ = [_Box(U, V, (arb(0), arb(1)), (arb(0), arb(1)), 0)]
    while open_:
        box = open_.pop()
        budget.use((U.nrows() + U.ncols()) * U.nrows() * U.ncols() + 1500)
        if _have_one_sign(box.U.entries()) or (V is not U and _have_one_sign(box.V.entries())):
            continue
        thin_in_x = box.U.nrows() == 1 or bool(box.x[1] - box.x[0] < narrow)
        thin_in_number = bool(box.k[1] - box.k[0] < narrow)
        thin = thin_in_x and thin_in_number
        ranges = _contracted(box.U, box.V)
        if ranges is None:
            continue
        (x_from, x_to), (k_from, k_to) = ranges
        # A box that shrinks by this is contracted again before it is cut.
        shrunk = (x_to - x_from) * (k_to - k_from) < 0.7
        count += thin
        # Times that an enclosure is contracted further.
        if thin and (not shrunk or box.polished == 3):
            yield box.x, box.k
        elif shrunk:
            open_.append(box.cut(ranges, polished=box.polished + thin))
        elif thin_in_x or (not thin_in_number and _bends_along_number(box)):
            open_ += [box.cut([ALL, FIRST_HALF]), box.cut([ALL, SECOND_HALF])]
        else:
            open_ += [box.cut([FIRST_HALF, ALL]), box.cut([SECOND_HALF, ALL])]
        if box.depth > 6 * ctx.prec or len(open_) > MOST_OPEN or count > MOST_OPEN:
            raise CrowdedError


@dataclass(frozen=True, slots=True)
class _Box:
    """A box with the Bernstein coefficients of U and V on it, and its ranges of both variables."""

    U: arb_mat
    V: arb_mat
    x: tuple[arb, arb]
    k: tuple[arb, arb]
    depth: int
    polished: int = 0

    def cut(self, ranges, polished=0):
        """The part of the box in these shares of its ranges."""
        x_shares, k_shares = ranges
        U = _cut(self.U, ranges)
        V = _cut(self.V, ranges)
        return _Box(
            U, V, _inside(self.x, x_shares), _inside(self.k, k_shares), self.depth + 1, polished
        )


def _bends_along_number(box):
    """Whether the functions vary more with the number than with x, relative to their size."""
    along_x = 0.0
    along_number = 0.0
    for polynomial in (box.U, box.V):
        largest = max(abs(c).mid() for c in polynomial.entries())
        if not largest > 0:
            continue
        shares = np.array([float((c / largest).mid()) for c in polynomial.entries()])
        shares = shares.reshape(polynomial.nrows(), polynomial.ncols())
        along_x += np.abs(np.diff(shares, axis=0)).sum(0).max(initial=0.0)
        along_number += np.abs(np.diff(shares, axis=1)).sum(1).max(initial=0.0)
    return along_number > along_x


def _have_one_sign(entries):
    if entries[0] > 0:
        return all(c > 0 for c in entries)
    return all(c < 0 for c in entries)


def _contracted(U, V):
    """The ranges of both variables, in shares of those of the box, that hold every common root;
    None if there is none.

    With the inverse of their mean slopes, U and V become nearly the variables themselves. A root is
    then at their mean value less a remainder, whose range the Bernstein coefficients bound.
    """
    n = U.nrows() - 1
    m = U.ncols() - 1
    box_range = [ALL, ALL]
    for variable, nearly in _preconditioned(U, V):
        remainders = []
        for i in range(n + 1):
            for j in range(m + 1):
                of_variable = arb(i) / n if variable == 0 else arb(j) / m
                remainders.append(nearly[i, j] - of_variable)
        low = -max(c.upper() for c in remainders)
        high = -min(c.lower() for c in remainders)
        if not (low.is_finite() and high.is_finite()):
            continue
        low = max(low, arb(0))
        high = min(high, arb(1))
        if low > high:
            return None
        box_range[variable] = low, high
    return box_range


def _preconditioned(U, V):
    """Each variable that U and V settle, 0 for x and 1 for the number, and what is nearly it."""
    ux, uk = _slopes(U)
    vx, vk = _slopes(V)
    if U.nrows() == 1:
        if uk != 0:
            return [(1, U * (1 / uk).mid())]
        return []
    det = (ux * vk - uk * vx).mid()
    if det == 0 or not det.is_finite():
        return []
    nearly_x = U * (vk / det).mid() + V * (-uk / det).mid()
    nearly_number = U * (-vx / det).mid() + V * (ux / det).mid()
    return [(0, nearly_x), (1, nearly_number)]


def _slopes(U):
    """The mean slopes in both variables, from the corners."""
    n = U.nrows() - 1
    m = U.ncols() - 1
    a, b, c, d = (U[i, j].mid() for i, j in product((0, n), (0, m)))
    along_x = (c + d - a - b) / 2 if n else arb(0)
    along_number = (b + d - a - c) / 2 if m else arb(0)
    return along_x, along_number


def _cut(U, ranges):
    """The coefficients on a part of the box."""
    (a, b), (c, d) = ranges
    if a != 0 or b != 1:
        U = _restriction(U.nrows() - 1, a, b) * U
    if c != 0 or d != 1:
        U = U * _restriction(U.ncols() - 1, c, d).transpose()
    return U


def _restriction(n, a, b):
    """The matrix from Bernstein coefficients on (0, 1) to those on (a, b)."""
    if (a == 0 or b == 1) and b - a == 0.5:
        return _half(n, bool(a == 0), ctx.prec)
    return _of_restriction(n, a, b)


@lru_cache(maxsize=256)
def _half(n, first, bits):
    del bits
    return _of_restriction(n, *(FIRST_HALF if first else SECOND_HALF))


def _of_restriction(n, a, b):
    """Row i has the coefficients of `(1-a + a s)^(n-i) (1-b + b s)^i`, the blossom at a and b."""
    first = arb_poly([1 - a, a])
    second = arb_poly([1 - b, b])
    firsts = [arb_poly([1])]
    seconds = [arb_poly([1])]
    for _ in range(n):
        firsts.append(firsts[-1] * first)
        seconds.append(seconds[-1] * second)
    rows = [(firsts[n - i] * seconds[i]).coeffs() for i in range(n + 1)]
    return arb_mat([row + [arb(0)] * (n + 1 - len(row)) for row in rows])


def _inside(range_, share):
    low, high = range_
    start, stop = share
    return (low + (high - low) * start).lower(), (low + (high - low) * stop).upper()
