"""Real roots by the signs of Bernstein coefficients: all rows at once, no eigenvalues."""

from functools import cache
from math import comb

import numpy as np

MOST = 16  # coefficients; beyond, the change of basis costs more digits than the signs can spare
HALVINGS = 24  # a piece this small that shows nothing is left to another method
SHARE = 0.4921875  # of a piece, where it is cut: not the middle, where symmetric loops put their roots
STEPS = 60  # Newton needs some 5; bisection alone would need 30
CLOSE = 1e-9  # of a piece, a step of Newton that is the last: its error is the square of that


def roots_by_sign(coefficients, noise):
    """Return the real roots in (-1, 1) of `sum_{k=1..n} c_k U_{k-1}(x)`, known on [-1, 1] to within `noise`, row by row.

    coefficients: `(rows, n)`, none much larger than 1; noise: `(rows,)`. Returns the roots as (row, value, distance within
    which no other root is, sign of the slope), sorted by row and value; and `(rows,)`, whether these are all roots of the row,
    for any polynomial within the noise. A row is cut in two until every piece shows by the signs of its Bernstein coefficients
    that it has no root, since they all have one sign, or exactly one, since they change it once (Descartes' rule; J. M. Lane,
    R. F. Riesenfeld, BIT 21, 1981). A sign counts if noise and rounding cannot change it. Noise changes the polynomial by at
    most its own size, and the coefficients on any piece by at most that size times the coefficients of a Chebyshev polynomial,
    which are the largest of all polynomials that keep to [-1, 1] (T. Lyche, K. Scherer, J. Comput. Appl. Math. 119, 2000).
    """
    rows, n = coefficients.shape
    complete = np.zeros(rows, bool)
    if n < 2 or n > MOST or not rows:
        return (np.zeros(0, int), *np.zeros((3, 0))), complete
    (row, low, high, b), complete = _isolated(*_whole(coefficients), noise)
    value = low + (high - low) * _single_root(b)
    order = np.lexsort((value, row))
    row, value, low, high, slope = (array[order] for array in (row, value, low, high, np.sign(b[-1])))
    first = np.diff(row, prepend=-1) != 0
    last = np.append(first[1:], True)[: row.size]
    before, after = np.where(first, -1.0, np.roll(high, 1)), np.where(last, 1.0, np.roll(low, -1))
    return (row, value, np.minimum(value - before, after - value), slope), complete


def _whole(coefficients):
    """Return the Bernstein coefficients on [-1, 1], `(n, rows)`, and a bound on their rounding."""
    c, change = np.ascontiguousarray(coefficients.T), change_of_basis(coefficients.shape[1])
    # Sums and not a matrix product, which BLAS may round differently in another batch.
    b, size = change[:, :1] * c[0], np.abs(change[:, :1] * c[0])
    for k in range(1, len(c)):
        term = change[:, k : k + 1] * c[k]
        b, size = b + term, size + np.abs(term)
    return b, (len(c) + 2) * np.finfo(float).eps * size.max(0)


def _isolated(b, rounding, noise):
    """Return pieces with a single root, (row, low, high, Bernstein coefficients), and which rows are completely decided."""
    n, rows = b.shape
    row, low, high = np.arange(rows), np.full(rows, -1.0), np.full(rows, 1.0)
    farthest, pieces = largest_bernstein(n - 1), []
    # A root at an end itself is no matter of signs.
    complete = np.isfinite(b).all(0) & (np.minimum(np.abs(b[0]), np.abs(b[-1])) > noise + rounding)
    row, low, high, b, rounding = (array[..., complete] for array in (row, low, high, b, rounding))
    for _ in range(HALVINGS):
        level = noise[row]
        none = (b.min(0) > level + rounding) | (b.max(0) < -level - rounding)
        threshold = farthest * level + rounding
        sign = (b > threshold).astype(np.int8) - (b < -threshold)
        changes, unknown = (sign[1:] != sign[:-1]).sum(0), (sign == 0).sum(0)
        # The signs change once; one may be unknown if it is between the two.
        single = ~none & (sign[0] * sign[-1] == -1) & (unknown <= 1) & (changes == 1 + unknown)
        pieces.append(tuple(array[..., single] for array in (row, low, high, b)))
        rest = ~none & ~single
        complete[row[rest & (np.abs(b).max(0) <= level + rounding)]] = False  # a piece that noise alone may be
        rest = np.flatnonzero(rest & complete[row])
        if not rest.size:
            break
        row, low, high, b, rounding = (array[..., rest] for array in (row, low, high, b, rounding))
        rounding = rounding + 4 * n * np.finfo(float).eps * np.abs(b).max(0)
        middle = low + SHARE * (high - low)
        b = np.concatenate(_halves(b), axis=-1)
        row, rounding, low, high = np.tile(row, 2), np.tile(rounding, 2), np.append(low, middle), np.append(middle, high)
    else:
        complete[row] = False
    row, low, high, b = (np.concatenate(arrays, axis=-1) for arrays in zip(*pieces, strict=True))
    decided = complete[row]
    return (row[decided], low[decided], high[decided], b[:, decided]), complete


def _halves(b):
    """Return the coefficients on either side of the cut (de Casteljau)."""
    work, left = b.copy(), np.empty_like(b)
    left[0] = work[0]
    for k in range(1, len(b)):
        work[:-k] = (1 - SHARE) * work[:-k] + SHARE * work[1 : len(b) - k + 1]
        left[k] = work[0]
    return left, work


def _single_root(b):
    """Return the root in (0, 1) of every column of Bernstein coefficients that change their sign once.

    It is found by Newton's method between bounds.
    """
    n, count = b.shape
    b = b * np.sign(b[-1])
    after = (b <= 0).sum(0)  # the control polygon, which rises through zero before this coefficient, starts it
    before, behind = (np.take_along_axis(b, at[None], 0)[0] for at in (after - 1, after))
    t = (after - 1 + before / (before - behind)) / (n - 1)
    low, high, active = np.zeros(count), np.ones(count), np.arange(count)
    for _ in range(STEPS):
        if not active.size:
            break
        now = t[active]
        value, slope = _value_and_slope(b if active.size == count else b[:, active], now)
        low[active], high[active] = np.where(value <= 0, now, low[active]), np.where(value > 0, now, high[active])
        with np.errstate(divide="ignore", invalid="ignore"):
            step = -value / slope
        least, most, last = low[active], high[active], np.abs(step) <= CLOSE
        following = now + step
        inside = (following > least) & (following < most)
        following = np.where(inside, following, np.where(last, np.clip(following, least, most), (least + most) / 2))
        t[active], active = following, active[~last]
    return t


def _value_and_slope(b, t):
    """Return the polynomial with these Bernstein coefficients, and its derivative, at t in [0, 1] (Horner's rule)."""
    n, s = len(b), 1 - t
    power, value, slope = np.ones_like(t), b[0], b[1] - b[0]
    for k in range(1, n):
        power = power * t
        value = value * s + comb(n - 1, k) * b[k] * power
        if k < n - 1:
            slope = slope * s + comb(n - 2, k) * (b[k + 1] - b[k]) * power
    return value, (n - 1) * slope


@cache
def change_of_basis(n):
    """Return the Bernstein coefficients on [-1, 1], of degree n - 1, of U_0 .. U_{n-1}: `(n, n)`, every entry rounded once."""
    top = n - 1
    change = np.array(
        [
            [
                sum((-1) ** (k - j) * comb(2 * k + 2, 2 * j + 1) * comb(top - k, i - j) for j in range(min(i, k) + 1))
                / (2 * comb(top, i))
                for k in range(n)
            ]
            for i in range(n)
        ]
    )
    change.flags.writeable = False
    return change


@cache
def largest_bernstein(degree):
    """Return the largest Bernstein coefficient of the Chebyshev polynomial of that degree."""
    return max(comb(2 * degree, 2 * i) / comb(degree, i) for i in range(degree + 1))
