"""Small dense systems next to the circle for the kernel: those of one loop at several points at a time, one point per lane.

The result of a lane depends on no other lane.
"""

import numpy as np

from wavesweep.analysis.intervals.compiled.lanes import LANES, inverted, less, more, outgrown, put, times
from wavesweep.lifted.compiled.caching import compiled

WIDE = 2 * LANES  # numbers of a vector of lanes
PREFERRED = 0.1  # of the largest entry of a column, down to which a row stays the pivot row that all lanes prefer


@compiled
def _over(a, b):
    """Return a/b of complex numbers whose squares are in range; NaN if b = 0, for which numba would raise an error.

    Numba's own quotient takes several times as long, since it allows for squares that are out of range.
    """
    square = b.real * b.real + b.imag * b.imag
    return complex((a.real * b.real + a.imag * b.imag) / square, (a.imag * b.real - a.real * b.imag) / square)


@compiled
def _modulus(number):
    """Return the modulus of a complex number whose square is in range."""
    return np.sqrt(number.real * number.real + number.imag * number.imag)


@compiled
def _taxicab(number):
    """Return the sum of the sizes of both parts of a number, a measure of its size without a square root."""
    return abs(number.real) + abs(number.imag)


@compiled
def _largest(A, first, column):
    """Return the row, from the first on, whose entry in the column is the largest."""
    best, at = _taxicab(A[first, column]), first
    for i in range(first + 1, len(A)):
        size = _taxicab(A[i, column])
        if size > best:
            best, at = size, i
    return at


@compiled
def _swapped(A, k, at):
    """Exchange two rows."""
    for j in range(len(A) if at != k else 0):
        A[k, j], A[at, j] = A[at, j], A[k, j]


@compiled
def _order(A):
    """Return the rows of A in the order in which elimination with the largest pivots takes them; A is used up."""
    order = np.arange(len(A))
    for k in range(len(A)):
        at = _largest(A, k, k)
        order[k], order[at] = order[at], order[k]
        _swapped(A, k, at)
        pivot = _over(1.0 + 0j, A[k, k])
        for i in range(k + 1, len(A)):
            factor = A[i, k] * pivot
            for j in range(k + 1, len(A)):
                A[i, j] -= factor * A[k, j]
    return order


@compiled
def _room(n):
    """Return memory for systems of n equations.

    It has the factors; the row of the loop at each place in each lane; eight vectors of states; and the ones in all lanes, the
    point, and further vectors of three.
    """
    parts = np.zeros((7, 3 * WIDE))
    parts[0, :LANES] = 1.0
    return np.empty(n * n * WIDE), np.empty((n, LANES), np.int64), np.empty((8, n * WIDE)), parts


@compiled
def _filled(E, order, top, bottom, A, rows):
    """Store `top I - bottom E` in A, its rows in that order; top, bottom: a vector of lanes each."""
    n = len(E)
    for i in range(n):
        row = order[i]
        for lane in range(LANES):
            rows[i, lane] = row
        for j in range(n):
            put(A, i * n + j, -E[row, j], bottom, 0)
        more(A, i * n + row, 1.0, top, 0)


@compiled
def _factored(n, A, rows, most):
    """Factor the lanes of A in place, with the inverses of their pivots; rows are exchanged if a pivot is small."""
    for k in range(n):
        most[:LANES] = 0.0
        for i in range(k + 1, n):
            outgrown(most, 0, A, i * n + k)
        at = (k * n + k) * WIDE
        for lane in range(LANES):
            if abs(A[at + lane]) + abs(A[at + LANES + lane]) < PREFERRED * most[lane]:
                _exchanged(n, A, rows, k, lane)
        inverted(A, k * n + k)
        for i in range(k + 1, n):
            times(A, i * n + k, A, k * n + k)
            for j in range(k + 1, n):
                less(A, i * n + j, A, i * n + k, A, k * n + j)


@compiled
def _exchanged(n, A, rows, k, lane):
    """Exchange row k of a lane with the one of the largest entry in column k."""
    best, at = -1.0, k
    for i in range(k, n):
        place = (i * n + k) * WIDE + lane
        size = abs(A[place]) + abs(A[place + LANES])
        if size > best:
            best, at = size, i
    rows[k, lane], rows[at, lane] = rows[at, lane], rows[k, lane]
    for j in range(n):
        here, there = (k * n + j) * WIDE + lane, (at * n + j) * WIDE + lane
        A[here], A[there] = A[there], A[here]
        A[here + LANES], A[there + LANES] = A[there + LANES], A[here + LANES]


@compiled
def _solved(n, A, rows, b, x):
    """Set x to `A^-1 b`, A factored."""
    for i in range(n):
        for lane in range(LANES):
            place = rows[i, lane] * WIDE + lane
            x[i * WIDE + lane], x[i * WIDE + LANES + lane] = b[place], b[place + LANES]
    for k in range(n):
        for i in range(k + 1, n):
            less(x, i, A, i * n + k, x, k)
    for k in range(n - 1, -1, -1):
        times(x, k, A, k * n + k)
        for i in range(k):
            less(x, i, A, i * n + k, x, k)


@compiled
def _solved_transposed(n, A, rows, b, x):
    """Set x to `b A^-1`, A factored; b is used up."""
    for k in range(n):
        times(b, k, A, k * n + k)
        for i in range(k + 1, n):
            less(b, i, A, k * n + i, b, k)
    for k in range(n - 1, -1, -1):
        for i in range(k):
            less(b, i, A, k * n + i, b, k)
    for i in range(n):
        for lane in range(LANES):
            place = rows[i, lane] * WIDE + lane
            x[place], x[place + LANES] = b[i * WIDE + lane], b[i * WIDE + LANES + lane]


@compiled
def _missed(E, B, w, one, x, missed):
    """Store the residual of `(w I - E) x = B`."""
    n = len(E)
    for i in range(n):
        put(missed, i, B[i], one, 0)
        less(missed, i, w, 0, x, i)
        for j in range(n):
            more(missed, i, E[i, j], x, j)


@compiled
def _missed_transposed(E, w, left, c):
    """Replace c by the residual of `left (w I - E) = c`."""
    n = len(E)
    for j in range(n):
        less(c, j, w, 0, left, j)
        for i in range(n):
            more(c, j, E[i, j], left, i)


@compiled
def _states(E, B, order, room):
    """Store the factors of `w I - E` at the point, and in the first vector the states for a unit force, refined once."""
    n, (A, rows, vectors, parts) = len(E), room
    x, missed, step, one, w, most = vectors[0], vectors[1], vectors[2], parts[0], parts[1], parts[2]
    _filled(E, order, w, one, A, rows)
    _factored(n, A, rows, most)
    for i in range(n):
        put(missed, i, B[i], one, 0)
    _solved(n, A, rows, missed, x)
    _missed(E, B, w, one, x, missed)
    _solved(n, A, rows, missed, step)
    for i in range(n):
        more(x, i, 1.0, step, i)
