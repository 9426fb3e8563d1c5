"""Real roots by the signs of Bernstein coefficients, column by column, for the kernel; see `bernstein`."""

import numpy as np

from wavesweep.analysis.intervals.bernstein import HALVINGS, SHARE, STEPS, change_of_basis
from wavesweep.lifted.compiled.caching import compiled

HALF = 0.5  # of the distance to the next root
CUBIC = 1e-5  # of a piece, a step of Halley's method that is the last: its error is the third power of that
EPS = float(np.finfo(float).eps)


@compiled
def _whole(c, change, b):
    """Store the Bernstein coefficients on [-1, 1] in b, and return a bound on their rounding."""
    n, most = len(c), 0.0
    for i in range(n):
        total, size = 0.0, 0.0
        for k in range(n):
            total += change[i, k] * c[k]
            size += abs(change[i, k] * c[k])
        b[i], most = total, max(most, size)
    return (n + 2) * EPS * most


@compiled
def _halved(b, left):
    """Store the coefficients on either side of the cut in left and, for the right side, in b (de Casteljau)."""
    left[0] = b[0]
    for k in range(1, len(b)):
        for i in range(len(b) - k):
            b[i] = (1 - SHARE) * b[i] + SHARE * b[i + 1]
        left[k] = b[0]


@compiled
def _once(b, threshold):
    """Return whether the coefficients' signs change exactly once; one sign may be unknown if it is between the two signs."""
    changes, unknown, before = 0, 0, 0
    for i in range(len(b)):
        sign = (b[i] > threshold) - (b[i] < -threshold)
        unknown += sign == 0
        changes += i > 0 and sign != before
        before = sign
    ends = ((b[0] > threshold) - (b[0] < -threshold)) * before
    return ends == -1 and unknown <= 1 and changes == 1 + unknown


@compiled
def _monotone(b, width, noise, rounding, steep):
    """Return whether the polynomial on a piece of that width has different signs at its ends, and a slope of one sign.

    The slope counts if noise whose slope is at most `steep` times its size cannot reverse it.
    """
    n = len(b)
    if not (min(abs(b[0]), abs(b[n - 1])) > noise + rounding and b[0] * b[n - 1] < 0):
        return False
    least, turn = steep * width * noise / (n - 1) + 2 * rounding, np.sign(b[n - 1])
    return bool((turn * (b[1:] - b[:-1]) > least).all())


@compiled
def _pieces(n):
    """Return memory for `_roots` of n coefficients: ends, depth, rounding and coefficients of pieces; weights; binomials."""
    binomials = np.ones((3, n))
    for row in range(3):
        for k in range(1, n - row):
            binomials[row, k] = binomials[row, k - 1] * (n - row - k) / k
    return np.empty(64), np.empty(64), np.empty(64, np.int64), np.empty(64), np.empty((64, n)), np.empty((3, n)), binomials


@compiled
def _at(weights, n, t):
    """Return the polynomial in t with the first n weights, binomials times Bernstein coefficients (Horner's rule)."""
    power, value, s = 1.0, weights[0], 1 - t
    for k in range(1, n):
        power *= t
        value = value * s + weights[k] * power
    return value


@compiled
def _root(b, weights, binomials):
    """Return the root in (0, 1) of Bernstein coefficients that change their sign once, by Halley's method between bounds."""
    n, turn, after = len(b), np.sign(b[-1]), 0
    for k in range(n):
        after += turn * b[k] <= 0
        weights[0, k] = turn * binomials[0, k] * b[k]
    for k in range(n - 1):
        weights[1, k] = turn * binomials[1, k] * (b[k + 1] - b[k]) * (n - 1)
    weights[2, 0] = 0.0
    for k in range(n - 2):
        weights[2, k] = turn * binomials[2, k] * (b[k + 2] - 2 * b[k + 1] + b[k]) * ((n - 1) * (n - 2))
    before, behind = turn * b[after - 1], turn * b[after]
    t, low, high = (after - 1 + before / (before - behind)) / (n - 1), 0.0, 1.0
    for _ in range(STEPS):
        value, slope, bend = _at(weights[0], n, t), _at(weights[1], n - 1, t), _at(weights[2], n - 2, t)
        if value <= 0:
            low = t
        else:
            high = t
        step = -2 * value * slope / (2 * slope * slope - value * bend)
        last, following = abs(step) <= CUBIC, t + step
        if not low < following < high:
            following = min(max(following, low), high) if last else (low + high) / 2
        t = following
        if last:
            break
    return t


@compiled
def _roots(c, noise, change, farthest, steep, pieces, values, slopes):
    """Store the roots in (-1, 1) of a column's polynomial in `values`, and return their number; -1 if signs do not decide.

    farthest: if the noise is a polynomial of the same degree, the largest change of Bernstein coefficients by it, over its
    size. steep: if only the slope of the noise is known, the largest slope over its size. The other of the two is 0.
    """
    n, found, open_ = len(c), 0, 1
    low, high, depth, unsure, b, weights, binomials = pieces
    low[0], high[0], depth[0], unsure[0] = -1.0, 1.0, 0, _whole(c, change, b[0])
    if not (np.isfinite(unsure[0]) and min(abs(b[0, 0]), abs(b[0, n - 1])) > noise + unsure[0]):
        return -1
    while open_:
        at = open_ - 1
        piece, left, right, rounding = b[at], low[at], high[at], unsure[at]
        least = most = piece[0]
        for i in range(1, n):
            least, most = min(least, piece[i]), max(most, piece[i])
        if least > noise + rounding or most < -noise - rounding:
            open_ -= 1
        elif found < len(values) and (
            _monotone(piece, right - left, noise, rounding, steep) if steep else _once(piece, farthest * noise + rounding)
        ):
            values[found], slopes[found] = left + (right - left) * _root(piece, weights, binomials), np.sign(piece[n - 1])
            found, open_ = found + 1, open_ - 1
        elif depth[at] == HALVINGS - 1 or max(-least, most) <= noise + rounding:
            return -1
        else:
            _halved(piece, b[at + 1])
            middle, rounding = left + SHARE * (right - left), rounding + 4 * n * EPS * max(-least, most)
            low[at], low[at + 1], high[at + 1], unsure[at], unsure[at + 1] = middle, left, middle, rounding, rounding
            depth[at], depth[at + 1], open_ = depth[at] + 1, depth[at] + 1, open_ + 1
    return found


@compiled
def _of_rows(c, noise, change, steep, values, within, slopes, counts):
    """Store the roots of every row, distances within which no other root is, and their number; -1 if signs do not decide."""
    n = c.shape[1]
    pieces, (found, slope) = _pieces(n), np.empty((2, n))
    for row in range(len(c)):
        counts[row] = _roots(c[row], noise[row], change, 0.0, steep, pieces, found, slope)
        order = np.argsort(found[: max(counts[row], 0)])
        for at in range(len(order)):
            value = found[order[at]]
            before = found[order[at - 1]] if at else -1.0
            after = found[order[at + 1]] if at + 1 < len(order) else 1.0
            values[row, at], slopes[row, at] = value, slope[order[at]]
            within[row, at] = HALF * min(value - before, after - value)


def rows_by_sign(coefficients, noise, steep):
    """`bernstein.roots_by_sign`, with the roots of a row in a row of the result.

    Returns values, distances within which no other root is, slopes, `(rows, n)` each, and the number of roots; -1 for rows that
    are not decided. steep: largest slope of the noise, over its size.
    """
    rows, n = coefficients.shape
    (values, within, slopes), counts = np.zeros((3, rows, n)), np.empty(rows, np.int64)
    if rows:
        arrays = np.ascontiguousarray(coefficients), np.ascontiguousarray(noise), change_of_basis(n)
        _of_rows(*arrays, float(steep), values, within, slopes, counts)
    return values, within, slopes, counts
