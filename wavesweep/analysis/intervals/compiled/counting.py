"""Eigenvalues outside the unit circle by signs, for the kernel: no eigenvalue is computed, and every number has a bound.

Each number stands for a midpoint and a radius that bounds its error (midpoint-radius arithmetic, S. M. Rump, BIT 39, 1999), to
first order in the rounding of the radii themselves.
"""

import numpy as np

from wavesweep.analysis.intervals.compiled.labelling import _balanced_size
from wavesweep.analysis.intervals.compiled.solving import _largest, _swapped
from wavesweep.analysis.intervals.critical import _powers
from wavesweep.analysis.spectrum import ROUNDINGS
from wavesweep.lifted.compiled.caching import compiled

EPS = float(np.finfo(float).eps)


@compiled
def _less(a, da, f, df, b, db):
    """Return `a - f b`, and its radius."""
    product = f * b
    return a - product, da + abs(f) * db + df * (abs(b) + db) + EPS * (abs(a) + 2 * abs(product))


@compiled
def _quotient(a, da, b, db):
    """Return a/b, and its radius, which is infinite if b may be zero."""
    if not abs(b) > db:
        return 0.0, np.inf
    found = a / b
    return found, (da + abs(found) * db) / (abs(b) - db) + EPS * abs(found)


@compiled
def _counts(E, change):
    """Return the number of eigenvalues of `I + E` outside the circle, `(matrices,)`, -1 if rounding could change it."""
    n, counts = E.shape[1], np.full(len(E), -1)
    A, R = np.empty((2, n, n))
    leading, beside = np.empty((2, n + 1, n + 1))
    for at in range(len(E)):
        A[:] = E[at]
        size = 2.0 ** np.ceil(np.log2(max(1.0, _balanced_size(A))))
        A /= size
        R[:] = ROUNDINGS * EPS
        if _hessenberg(A, R):
            _characteristic(A, R, leading, beside)
            counts[at] = _changes(leading, beside, size, change)
    return counts


@compiled
def _hessenberg(A, R):
    """Reduce A, radius R, in place to Hessenberg form by elimination with row exchanges; return whether no pivot may be 0."""
    n = len(A)
    for k in range(1, n - 1):
        at = _largest(A, k, k - 1)
        if not abs(A[at, k - 1]) > R[at, k - 1]:
            return False
        for part in (A, R):
            _swapped(part, k, at)
            for i in range(n if at != k else 0):
                part[i, k], part[i, at] = part[i, at], part[i, k]
        for i in range(k + 1, n):
            factor, off = _quotient(A[i, k - 1], R[i, k - 1], A[k, k - 1], R[k, k - 1])
            A[i, k - 1], R[i, k - 1] = 0.0, 0.0
            for j in range(k, n):
                A[i, j], R[i, j] = _less(A[i, j], R[i, j], factor, off, A[k, j], R[k, j])
            for j in range(n):
                A[j, k], R[j, k] = _less(A[j, k], R[j, k], -factor, off, A[j, i], R[j, i])
    return True


@compiled
def _characteristic(H, R, leading, beside):
    """Store the coefficients of `det(w I - H)` of the leading parts of H, and their radii, that of the lowest power first."""
    leading[0, 0], beside[0, 0] = 1.0, 0.0
    for j in range(len(H)):
        product, off = 1.0, 0.0
        leading[j + 1, 0], beside[j + 1, 0] = 0.0, 0.0
        for k in range(j + 1):
            leading[j + 1, k + 1], beside[j + 1, k + 1] = leading[j, k], beside[j, k]
        for i in range(j, -1, -1):
            if i < j:
                product, off = _less(0.0, 0.0, -product, off, H[i + 1, i], R[i + 1, i])
            factor, unsure = _less(0.0, 0.0, -product, off, H[i, j], R[i, j])
            for k in range(i + 1):
                now = leading[j + 1, k], beside[j + 1, k]
                leading[j + 1, k], beside[j + 1, k] = _less(*now, factor, unsure, leading[i, k], beside[i, k])


@compiled
def _changes(leading, beside, size, change):
    """Return the number of roots outside the circle of the last polynomial in `w/size`, -1 if it is not sure.

    With `s = w/(2 + w)` they are the roots with a positive real part, and their number is that of the changes of sign in the
    first column of Routh's array (F. R. Gantmacher, The Theory of Matrices, volume 2, 1959, chapter 15). change: see
    `critical._powers`.
    """
    n, weight = len(leading) - 1, 1.0
    rows, off, changes, before = np.zeros((2, n + 2)), np.zeros((2, n + 2)), 0, 0.0
    for k in range(n + 1):
        for i in range(k, n + 1):
            part, place = (n - i) % 2, (n - i) // 2
            now = rows[part, place], off[part, place]
            c, unsure = leading[n, k] * weight, beside[n, k] * weight
            rows[part, place], off[part, place] = _less(*now, -change[i, k], 0.0, c, unsure)
        weight /= size
    for k in range(n + 1):
        upper, lower, above, below = rows[k % 2], rows[(k + 1) % 2], off[k % 2], off[(k + 1) % 2]
        if not abs(upper[0]) > above[0]:  # it may be NaN
            return -1
        changes, before = changes + (before * upper[0] < 0), np.sign(upper[0])
        if k == n:
            return changes
        factor, unsure = _quotient(upper[0], above[0], lower[0], below[0])
        for i in range(n // 2 + 1):
            upper[i], above[i] = _less(upper[i + 1], above[i + 1], factor, unsure, lower[i + 1], below[i + 1])
    return changes


def count_outside(E):
    """Return the number of eigenvalues of `I + E` outside the unit circle for each matrix, -1 if it is not sure.

    E: `(matrices, n, n)`, real. The numbers that are sure hold for all matrices whose entries, in units in which they are
    balanced, differ from these by no more than ROUNDINGS roundings of the largest one.
    """
    return _counts(np.ascontiguousarray(E), _powers(E.shape[-1]))
