"""Real roots by the signs of Bernstein coefficients: all rows at once, no eigenvalues."""

from __future__ import annotations

from functools import cache
from math import comb
from typing import NamedTuple

import numpy as np

from wavesweep.engine.doubles import EPS

# coefficients; beyond, the change of basis costs more digits than the signs can spare
MOST_COEFFICIENTS = 16
# of a piece, where it is cut: not the middle, where symmetric loops put their roots
PIECE_CUT_AT = 0.4921875
# of a piece, a step of Newton that is the last: its error is the square of that
LAST_STEP_OF_PIECE = 1e-9


def roots_by_sign(
    coefficients: np.ndarray, noise: np.ndarray
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """Return the real roots in (-1, 1) of `sum_{k=1..n} c_k U_{k-1}(x)`, known on [-1, 1] to within
    `noise`, row by row.

    coefficients: `(rows, n)`, none much larger than 1; noise: `(rows,)`. Returns the roots as (row,
    value, distance within which no other root is, sign of the slope), sorted by row and value; and
    `(rows,)`, whether these are all roots of the row, for any polynomial within the noise. A row is
    cut in two until every piece shows by the signs of its Bernstein coefficients that it has no
    root, since they all have one sign, or exactly one, since they change it once (Descartes' rule;
    J. M. Lane, R. F. Riesenfeld, BIT 21, 1981). A sign counts if noise and rounding cannot change
    it. Noise changes the polynomial by at most its own size, and the coefficients on any piece by
    at most that size times the coefficients of a Chebyshev polynomial, which are the largest of all
    polynomials that keep to [-1, 1] (T. Lyche, K. Scherer, J. Comput. Appl. Math. 119, 2000).
    """
    rows, n = coefficients.shape
    complete = np.zeros(rows, bool)
    if n < 2 or n > MOST_COEFFICIENTS or not rows:
        return (np.zeros(0, int), *np.zeros((3, 0))), complete
    pieces, complete = _isolated(*_whole(coefficients), noise)
    value = pieces.low + (pieces.high - pieces.low) * _single_root(pieces.b)
    order = np.lexsort((value, pieces.row))
    pieces = pieces.some(order)
    value = value[order]
    first = np.diff(pieces.row, prepend=-1) != 0
    last = np.append(first[1:], True)[: order.size]
    before = np.where(first, -1.0, np.roll(pieces.high, 1))
    after = np.where(last, 1.0, np.roll(pieces.low, -1))
    apart = np.minimum(value - before, after - value)
    return (pieces.row, value, apart, np.sign(pieces.b[-1])), complete


class _Pieces(NamedTuple):
    """Pieces from low to high of rows, and their Bernstein coefficients b, `(n, pieces)`."""

    row: np.ndarray
    low: np.ndarray
    high: np.ndarray
    b: np.ndarray

    def some(self, index: np.ndarray) -> _Pieces:
        """Some of the pieces."""
        return _Pieces(self.row[index], self.low[index], self.high[index], self.b[:, index])


def _whole(coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the Bernstein coefficients on [-1, 1], `(n, rows)`, and a bound on their rounding."""
    c = np.ascontiguousarray(coefficients.T)
    change = change_of_basis(len(c))
    # Sums and not a matrix product, which BLAS may round differently in another batch.
    b = change[:, :1] * c[0]
    size = np.abs(b)
    for k in range(1, len(c)):
        term = change[:, k : k + 1] * c[k]
        b = b + term
        size = size + np.abs(term)
    return b, (len(c) + 2) * EPS * size.max(0)


def _isolated(b: np.ndarray, rounding: np.ndarray, noise: np.ndarray) -> tuple[_Pieces, np.ndarray]:
    """Return pieces with a single root, and which rows are completely decided."""
    n, rows = b.shape
    farthest = largest_bernstein(n - 1)
    # A root at an end itself is no matter of signs.
    at_ends = np.minimum(np.abs(b[0]), np.abs(b[-1]))
    complete = np.isfinite(b).all(0) & (at_ends > noise + rounding)
    pieces = _Pieces(np.arange(rows), np.full(rows, -1.0), np.full(rows, 1.0), b).some(complete)
    rounding = rounding[complete]
    found = []
    for _ in range(24):  # a piece this small that shows nothing is left to another method
        row, low, high, b = pieces
        level = noise[row]
        none = (b.min(0) > level + rounding) | (b.max(0) < -level - rounding)
        threshold = farthest * level + rounding
        sign = (b > threshold).astype(np.int8) - (b < -threshold)
        changes = (sign[1:] != sign[:-1]).sum(0)
        unknown = (sign == 0).sum(0)
        # The signs change once; one may be unknown if it is between the two.
        single = ~none & (sign[0] * sign[-1] == -1) & (unknown <= 1) & (changes == 1 + unknown)
        found.append(pieces.some(single))
        rest = ~none & ~single
        may_be_noise = rest & (np.abs(b).max(0) <= level + rounding)
        complete[row[may_be_noise]] = False
        rest = np.flatnonzero(rest & complete[row])
        if not rest.size:
            break
        row, low, high, b = pieces.some(rest)
        # The cut takes n - 1 steps, each rounded by EPS of the largest at most, taken four times.
        rounding = np.tile(rounding[rest] + 4 * n * EPS * np.abs(b).max(0), 2)
        middle = low + PIECE_CUT_AT * (high - low)
        halves = np.concatenate(_halves(b), axis=-1)
        pieces = _Pieces(np.tile(row, 2), np.append(low, middle), np.append(middle, high), halves)
    else:
        complete[pieces.row] = False
    joined = _Pieces(*(np.concatenate(arrays, axis=-1) for arrays in zip(*found, strict=True)))
    return joined.some(complete[joined.row]), complete


def _halves(b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients on either side of the cut (de Casteljau)."""
    work = b.copy()
    left = np.empty_like(b)
    left[0] = work[0]
    for k in range(1, len(b)):
        work[:-k] = (1 - PIECE_CUT_AT) * work[:-k] + PIECE_CUT_AT * work[1 : len(b) - k + 1]
        left[k] = work[0]
    return left, work


def _single_root(b: np.ndarray) -> np.ndarray:
    """Return the root in (0, 1) of every column of Bernstein coefficients that change their sign
    once.

    It is found by Newton's method between bounds.
    """
    n, count = b.shape
    b = b * np.sign(b[-1])
    # The control polygon, which rises through zero before coefficient `after`, starts it.
    after = (b <= 0).sum(0)
    before = np.take_along_axis(b, after[None] - 1, 0)[0]
    behind = np.take_along_axis(b, after[None], 0)[0]
    t = (after - 1 + before / (before - behind)) / (n - 1)
    low = np.zeros(count)
    high = np.ones(count)
    active = np.arange(count)
    for _ in range(60):  # Newton needs some 5; bisection alone would need 30
        if not active.size:
            break
        now = t[active]
        value, slope = _value_and_slope(b if active.size == count else b[:, active], now)
        low[active] = np.where(value <= 0, now, low[active])
        high[active] = np.where(value > 0, now, high[active])
        with np.errstate(divide="ignore", invalid="ignore"):
            step = -value / slope
        least = low[active]
        most = high[active]
        last = np.abs(step) <= LAST_STEP_OF_PIECE
        following = now + step
        inside = (following > least) & (following < most)
        instead = np.where(last, np.clip(following, least, most), (least + most) / 2)
        t[active] = np.where(inside, following, instead)
        active = active[~last]
    return t


def _value_and_slope(b: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the polynomial with these Bernstein coefficients, and its derivative, at t in [0,
    1] (Horner's rule)."""
    n = len(b)
    s = 1 - t
    power = np.ones_like(t)
    value = b[0]
    slope = b[1] - b[0]
    for k in range(1, n):
        power = power * t
        value = value * s + comb(n - 1, k) * b[k] * power
        if k < n - 1:
            slope = slope * s + comb(n - 2, k) * (b[k + 1] - b[k]) * power
    return value, (n - 1) * slope


@cache
def change_of_basis(n: int) -> np.ndarray:
    """Return the Bernstein coefficients on [-1, 1], of degree n - 1, of U_0 .. U_{n-1}: `(n,
    n)`, every entry rounded once."""
    top = n - 1
    change = np.empty((n, n))
    for i in range(n):
        for k in range(n):
            total = 0  # in whole numbers, which rounds only in the division
            for j in range(min(i, k) + 1):
                total += (-1) ** (k - j) * comb(2 * k + 2, 2 * j + 1) * comb(top - k, i - j)
            change[i, k] = total / (2 * comb(top, i))
    change.flags.writeable = False
    return change


@cache
def largest_bernstein(degree: int) -> float:
    """Return the largest Bernstein coefficient of the Chebyshev polynomial of that degree."""
    return max(comb(2 * degree, 2 * i) / comb(degree, i) for i in range(degree + 1))
