"""The values of a number at which a polynomial has a root on the unit circle, enclosed with proof.

Times a power of z, the polynomial is `U(x) + i sin(theta) V(x)` on the circle, x = cos(theta), or with half angles if its
degree is odd. Its roots there are the common roots of U and V in x and the number, and those at z = 1 and z = -1. Boxes of both
are cut until the signs of Bernstein coefficients exclude them, or the linear parts of U and V leave next to nothing of them.
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

NARROW = 0.45  # share of the bits: a box this narrow encloses a crossing well enough
SHRUNK = 0.7  # of its size, below which a box is contracted again before it is cut
DEEPEST = 6  # cuts of a box for each bit
MOST_OPEN = 200  # boxes at a time, and crossings of a part, beyond which these bits are too few
POLISHED = 3  # times that an enclosure is contracted further


class CrowdedError(UndecidedError):
    """More boxes are left than crossings are to be expected, as for an eigenvalue that is always on the circle."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """A value of the number, as a ball, at which a root may be on the circle, and its angle there."""

    value: arb
    theta: arb


def crossings(part: FamilyPart, budget: Budget) -> Iterator[Crossing]:
    """Yield enclosures of all values in a part at which a root is on the circle. Errors: UndecidedError."""
    width = part.high - part.low
    for table in part.polynomials:
        if not all(entry.is_finite() for entry in table.entries()):
            raise UndecidedError
        n = table.nrows() - 1
        if table.ncols() == 1:  # the same for all values
            count_outside(table.entries())
            continue
        for sign, theta in ((1, arb(0)), (-1, arb.pi())) if n else ((1, arb("nan")),):
            ends = arb_mat([[sum((table[j, i] * sign**j for j in range(n + 1)), arb(0)) for i in range(table.ncols())]])
            for _, (low, high) in _boxes(ends, ends, budget):
                yield Crossing(part.low + width * low.union(high), theta)
        to_U, to_V = _on_circle(n, ctx.prec)
        for (left, right), (low, high) in _boxes(to_U * table, to_V * table, budget) if n > 1 else ():
            angle = 2 * (1 - left.union(right)).nonnegative_part().sqrt().min(1).asin()
            yield Crossing(part.low + width * low.union(high), angle)


def is_unstable(part: FamilyPart) -> bool:
    """Whether some root is outside the circle for every value in a part, since a coefficient is too large.

    Coefficients of a frame that grows by many powers of ten say so long before the small roots are known.
    """
    for table in part.polynomials:
        rows, n = table.tolist(), table.nrows() - 1
        for j, row in enumerate(rows[:-1]):
            sides = [[a + sign * comb(n, j) * b for a, b in zip(row, rows[-1], strict=True)] for sign in (1, -1)]
            if _have_one_sign([*sides[0], *sides[1]]):
                return True
    return False


def count_outside(p: list[arb]) -> int:
    """The number of roots of a polynomial outside the unit circle (I. Schur; A. Cohn 1922). Errors: UndecidedError.

    p: coefficients of ascending powers.
    """
    outside = 0
    while len(p) > 1:
        first, last = p[0], p[-1]
        if abs(first) < abs(last):
            p = [last * a - first * b for a, b in zip(p[1:], p[-2::-1], strict=True)]
        elif abs(first) > abs(last):
            p, outside = [first * a - last * b for a, b in zip(p[:-1], p[:0:-1], strict=True)], outside + 1
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
    """The matrices from the coefficients of a polynomial to the Bernstein coefficients of U and V on (-1, 1)."""
    del bits
    h, odd = divmod(n, 2)
    tensors = []
    for sign, slope, constant in ((1, 2, -1), (-1, 2, 1)) if odd else ((1, 1, 0), (-1, 2, 0)):
        lower = not odd and sign < 0  # sin(k theta)/sin(theta) is of degree k - 1
        coefficients = [[0]] * lower + chebyshev(h + 1 - lower, slope, constant)
        columns = [[sign * c for c in p] for p in reversed(coefficients)] + coefficients[1 - odd :]
        tensors.append(bernstein(columns, h).transpose())
    return tensors


def _boxes(U, V, budget):
    """The boxes ((x from, x to), (number from, to)), in shares of the ranges, that may have a common root.

    U, V: Bernstein coefficients, the columns those of the number. A single row stands for functions of the number alone.
    """
    if all(c.contains(0) for c in (*U.entries(), *V.entries())):  # an eigenvalue that is always on the circle
        raise UndecidedError
    narrow, count = arb(2) ** (-int(NARROW * ctx.prec)), 0
    open_ = [_Box(U, V, (arb(0), arb(1)), (arb(0), arb(1)), 0)]
    while open_:
        box = open_.pop()
        budget.use((U.nrows() + U.ncols()) * U.nrows() * U.ncols() + 1500)
        if _have_one_sign(box.U.entries()) or (V is not U and _have_one_sign(box.V.entries())):
            continue
        thin = [box.U.nrows() == 1 or box.x[1] - box.x[0] < narrow, box.k[1] - box.k[0] < narrow]
        ranges = _contracted(box.U, box.V)
        if ranges is None:
            continue
        shrunk = (ranges[0][1] - ranges[0][0]) * (ranges[1][1] - ranges[1][0]) < SHRUNK
        count += all(thin)
        if all(thin) and (not shrunk or box.polished == POLISHED):
            yield box.x, box.k
        elif shrunk:
            open_.append(box.cut(ranges, polished=box.polished + all(thin)))
        else:
            along = int(thin[0] or (not thin[1] and _bends_along_number(box)))
            halves = (arb(0), arb(0.5)), (arb(0.5), arb(1))
            open_ += [box.cut([half if i == along else (arb(0), arb(1)) for i in range(2)]) for half in halves]
        if box.depth > DEEPEST * ctx.prec or len(open_) > MOST_OPEN or count > MOST_OPEN:
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
        U, V = (_cut(polynomial, ranges) for polynomial in (self.U, self.V))
        return _Box(U, V, _inside(self.x, ranges[0]), _inside(self.k, ranges[1]), self.depth + 1, polished)


def _bends_along_number(box):
    """Whether the functions vary more with the number than with x, relative to their size."""
    total = np.zeros(2)
    for polynomial in (box.U, box.V):
        largest = max(abs(c).mid() for c in polynomial.entries())
        if largest > 0:
            size = np.array([float((c / largest).mid()) for c in polynomial.entries()]).reshape(
                polynomial.nrows(), polynomial.ncols()
            )
            total += [np.abs(np.diff(size, axis=axis)).sum(axis).max(initial=0.0) for axis in (0, 1)]
    return total[1] > total[0]


def _have_one_sign(entries):
    return all(c > 0 for c in entries) if entries[0] > 0 else entries[0] < 0 and all(c < 0 for c in entries)


def _contracted(U, V):
    """The ranges of both variables, in shares of those of the box, that hold every common root; None if there is none.

    With the inverse of their mean slopes, U and V become nearly the variables themselves. A root is then at their mean value
    less a remainder, whose range the Bernstein coefficients bound.
    """
    n, m = U.nrows() - 1, U.ncols() - 1
    box_range = [(arb(0), arb(1)), (arb(0), arb(1))]
    for row, terms in _preconditioned(U, V):
        G = sum((polynomial * factor.mid() for factor, polynomial in terms[1:]), terms[0][1] * terms[0][0].mid())
        rest = [G[i, j] - (arb(i) / n if row == 0 else arb(j) / m) for i in range(n + 1) for j in range(m + 1)]
        low, high = -max(c.upper() for c in rest), -min(c.lower() for c in rest)
        if not (low.is_finite() and high.is_finite()):
            continue
        low, high = max(low, arb(0)), min(high, arb(1))
        if low > high:
            return None
        box_range[row] = low, high
    return box_range


def _preconditioned(U, V):
    """For each variable that U and V settle, the terms of what is nearly that variable; none where their slopes do not."""
    n, m = U.nrows() - 1, U.ncols() - 1
    (ux, uk), (vx, vk) = (_slopes(polynomial, n, m) for polynomial in (U, V))
    if n == 0:
        return [(1, [(1 / uk, U)])] if uk != 0 else []
    det = (ux * vk - uk * vx).mid()
    if det == 0 or not det.is_finite():
        return []
    return [(0, [(vk / det, U), (-uk / det, V)]), (1, [(-vx / det, U), (ux / det, V)])]


def _slopes(U, n, m):
    """The mean slopes in both variables, from the corners."""
    a, b, c, d = (U[i, j].mid() for i, j in product((0, n), (0, m)))
    return (c + d - a - b) / 2 if n else arb(0), (b + d - a - c) / 2 if m else arb(0)


def _cut(U, ranges):
    """The coefficients on a part of the box."""
    (a, b), (c, d) = ranges
    U = U if a == 0 and b == 1 else _restriction(U.nrows() - 1, a, b) * U
    return U if c == 0 and d == 1 else U * _restriction(U.ncols() - 1, c, d).transpose()


def _restriction(n, a, b):
    """The matrix from Bernstein coefficients on (0, 1) to those on (a, b)."""
    if (a == 0 or b == 1) and b - a == 0.5:
        return _half(n, bool(a == 0), ctx.prec)
    return _of_restriction(n, a, b)


@lru_cache(maxsize=256)
def _half(n, first, bits):
    del bits
    return _of_restriction(n, *((arb(0), arb(0.5)) if first else (arb(0.5), arb(1))))


def _of_restriction(n, a, b):
    """Row i has the coefficients of `(1-a + a s)^(n-i) (1-b + b s)^i`, the blossom at a and b."""
    first, second = arb_poly([1 - a, a]), arb_poly([1 - b, b])
    firsts, seconds = [arb_poly([1])], [arb_poly([1])]
    for _ in range(n):
        firsts.append(firsts[-1] * first)
        seconds.append(seconds[-1] * second)
    rows = [(firsts[n - i] * seconds[i]).coeffs() for i in range(n + 1)]
    return arb_mat([row + [arb(0)] * (n + 1 - len(row)) for row in rows])


def _inside(range_, share):
    low, high = range_
    return (low + (high - low) * share[0]).lower(), (low + (high - low) * share[1]).upper()
