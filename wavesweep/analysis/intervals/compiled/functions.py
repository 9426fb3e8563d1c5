"""Characteristic polynomials and critical functions of frames, one after the other, for the kernel; see `critical`."""

import numpy as np

from wavesweep.analysis.intervals.compiled.solving import _largest, _swapped, _taxicab
from wavesweep.analysis.intervals.critical import MOST_ERROR, POWER, SQUARINGS, TINIEST, _powers
from wavesweep.analysis.intervals.interpolated import least_on_rim
from wavesweep.lifted.compiled.caching import compiled


@compiled
def _size(number):
    """Return the modulus of a number, whose square is in range if it is complex."""
    if number.imag == 0:
        return abs(number.real)
    return np.sqrt(number.real * number.real + number.imag * number.imag)


@compiled
def _characteristics(E, c, reach, size):
    """`critical.characteristic` into c, reach `(n + 1, matrices)` and size."""
    count, n, _ = E.shape
    A, leading = np.empty((n, n), E.dtype), np.empty((n + 1, n + 1), E.dtype)
    for at in range(count):
        largest = 1.0
        for i in range(n):
            for j in range(n):
                largest = max(largest, E[at, i, j].real ** 2 + E[at, i, j].imag ** 2)
        size[at] = 2.0 ** np.ceil(np.log2(largest) / 2)
        for i in range(n):
            for j in range(n):
                A[i, j] = E[at, i, j] * (1 / size[at])
        _hessenberg(A)
        _characteristic(A, leading)
        for k in range(n + 1):
            c[k, at] = leading[n, k]
            reach[k, at] = _size(leading[n, k]) + ((k + 1) * _size(leading[n, k + 1]) if k < n else 0.0)


@compiled
def _hessenberg(A):
    """Reduce A in place to Hessenberg form by elimination with row exchanges."""
    n = len(A)
    for k in range(1, n - 1):
        at = _largest(A, k, k - 1)
        if A[at, k - 1] == 0:
            continue
        _swapped(A, k, at)
        for i in range(n if at != k else 0):
            A[i, k], A[i, at] = A[i, at], A[i, k]
        inverse = 1 / A[k, k - 1]
        for i in range(k + 1, n):
            factor = A[i, k - 1] * inverse
            for j in range(k - 1, n):
                A[i, j] -= factor * A[k, j]
            for j in range(n):
                A[j, k] += A[j, i] * factor


@compiled
def _characteristic(H, leading):
    """Store the coefficients of `det(w I - H)` of the leading parts of H, that of the lowest power first, by rows."""
    leading[0, 0] = 1.0
    for j in range(len(H)):
        product = H[0, 0] * 0 + 1
        leading[j + 1, 0] = 0.0
        for k in range(j + 1):
            leading[j + 1, k + 1] = leading[j, k]
        for k in range(j + 1):
            leading[j + 1, k] -= H[j, j] * leading[j, k]
        for i in range(j - 1, -1, -1):
            product *= H[i + 1, i]
            factor = H[i, j] * product
            for k in range(i + 1):
                leading[j + 1, k] -= factor * leading[i, k]


@compiled
def _functions(c, reach, size, change, phase, log, error):
    """`critical._functions` into phase (complex), log and error, `(4, matrices)`; change: see `critical._powers`."""
    room = _room(c[:, 0])
    for at in range(c.shape[1]):
        _at_one(c[:, at], reach[:, at], size[at], change, room, phase[:, at], log[:, at], error[:, at])


@compiled
def _room(c):
    """Return memory for `_at_one`."""
    half = (len(c) - 1) // 2
    matrix, unsure = np.empty((2, half, half), c.dtype), np.empty((half, half))
    return (
        np.empty(len(c), c.dtype),
        np.empty(len(c)),
        matrix,
        unsure,
        (np.empty((2, 2 * POWER + 1), c.dtype), np.empty((2, 2 * POWER + 1))),
    )


@compiled
def _at_one(c, reach, size, change, room, phase, log, error):
    """`_functions` for one polynomial, `(4,)` each."""
    (q, missed, matrix, unsure_of, powers), n = room, len(c) - 1
    largest, weight = 0.0, 1.0
    q[:], missed[:] = 0.0, 0.0
    for k in range(n + 1):
        for i in range(k, n + 1):
            q[i] += change[i, k] * (c[k] * weight)
            missed[i] += abs(change[i, k]) * (reach[k] * weight)
        weight /= size
    for k in range(n + 1):
        largest = max(largest, _size(q[k])) if not np.isnan(_size(q[k])) else np.nan
    grown = n * np.log(size)
    _part(c[0], reach[0], grown, 1, phase, log, error)
    _part(q[n], missed[n], grown, 2, phase, log, error)
    _beyond(c, reach, size, powers, phase, log, error)
    scale = 1 / largest  # numba raises an error where a complex number is divided by zero
    for k in range(n + 1):
        q[k], missed[k] = q[k] * scale, missed[k] * scale
    phase[0], size_of, error[0] = _last_but_one(q, missed, matrix, unsure_of)
    log[0] = size_of + (n - 1) * (grown + np.log(largest) - n / 2 * np.log(2))


@compiled
def _beyond(c, reach, size, room, phase, log, error):
    """Store SURELY_UNSTABLE; see `critical._beyond`."""
    n, (a, off), now = len(c) - 1, room, 0
    for j in range(2 * POWER + 1):
        a[0, j], off[0, j] = 0.0, 0.0
    for j in range(min(n, 2 * POWER) + 1):
        weight, sign = 1.0, 1.0
        for d in range(j + 1):
            if d:
                weight, sign = weight * (n - j + d) / (d * size), -sign
            a[0, j] += sign * weight * c[n - j + d]
            off[0, j] += weight * reach[n - j + d]
    top = 2 * POWER
    for _ in range(SQUARINGS):
        top, later, outer = top // 2, 1 - now, 1.0
        for j in range(top + 1):
            size_of = _size(a[now, j])
            total, unsure, sign = a[now, j] * a[now, j], (2 * off[now, j] + size_of) * size_of, -2.0
            for i in range(1, j + 1):
                one, other = _size(a[now, j - i]), _size(a[now, j + i])
                total += sign * (a[now, j - i] * a[now, j + i])
                unsure += 2 * (one * (off[now, j + i] + other) + off[now, j - i] * other)
                sign = -sign
            a[later, j], off[later, j], outer = total * outer, unsure, -outer
        now = later
    pairs, least = max(n * (n - 1) / 2, 1.0), max(2 / size ** (2 * POWER), TINIEST)
    value = a[now, 1] ** 2 / n**2 + a[now, 2] / pairs - least
    whole = (2 * _size(a[now, 1]) * off[now, 1] + _size(a[now, 1]) ** 2) / n**2
    whole += (off[now, 2] + _size(a[now, 2])) / pairs + least
    _part(value, 4 * whole, 2 * POWER * np.log(size), 3, phase, log, error)


@compiled
def _part(value, reach, factor, row, phase, log, error):
    """Store phase, logarithm of the size and relative error of a number times exp(factor)."""
    size = abs(value)
    magnitude = max(size, 1e-300) if not np.isnan(size) else size
    phase[row], log[row] = value / magnitude, np.log(magnitude) + factor
    error[row] = reach / magnitude if size > 1e-290 else 1e300


@compiled
def _last_but_one(q, missed, room, error):
    """Return phase, logarithm and relative error of the last Hurwitz determinant but one; see `critical._last_but_one`."""
    matrix, inverse, n = room[0], room[1], len(q) - 1
    half = len(matrix)
    one = q[0] * 0 + 1
    if not half:
        return one, 0.0, 0.0
    for i in range(half):
        for j in range(half - 1, i - 1, -1):
            (e, de), (o, do) = _coefficient(q, missed, 2 * (j + 1)), _coefficient(q, missed, 2 * i + 1)
            (f, df), (p, dp) = _coefficient(q, missed, 2 * i), _coefficient(q, missed, 2 * (j + 1) + 1)
            value = e * o - f * p
            unsure = _size(e) * do + de * _size(o) + _size(f) * dp + df * _size(p)
            if i and j + 1 < half:
                value, unsure = value + matrix[i - 1, j + 1], unsure + error[i - 1, j + 1]
            matrix[i, j], error[i, j] = value, unsure
            matrix[j, i], error[j, i] = value, unsure
    if n % 2 == 0:  # of an even order the leading coefficient is a factor of the last column, and not one of the function
        for i in range(half):
            matrix[i, half - 1], error[i, half - 1] = q[2 * i + 1], missed[2 * i + 1]
    return _determinant(matrix, inverse, error)


@compiled
def _followed(piece, x, degree, coefficients, reach, beside, size, least, noisy, change, most, phase, log, error):
    """`critical.from_polynomials` of interpolants into phase, log and error, `(4, panels, points)`.

    See `InterpolatedLoop.polynomials`.

    piece: of each panel; x: `(panels, points)`, the position in it. least: by the degree, see `least_on_rim`. noisy: whether
    noise of the nodes grows (if x is complex). most: error of values that are not known.
    """
    panels, points = x.shape
    n = coefficients.shape[2]
    c, off = np.empty(n + 1, x.dtype), np.empty(n + 1)
    room = _room(c)
    for panel in range(panels):
        own, top = piece[panel], degree[piece[panel]]
        for point in range(points):
            at = x[panel, point]
            before, now = at * 0 + 1, at
            for j in range(n):
                c[j] = coefficients[own, 0, j] + at * coefficients[own, 1, j]
            for k in range(2, top + 1):
                before, now = now, 2 * at * now - before
                for j in range(n):
                    c[j] += now * coefficients[own, k, j]
            noise = max(2 * _size(now), 1.0) if noisy else 1.0
            missed = _size(at * now - before) / least[top]
            for j in range(n):
                off[j] = reach[own, j] * noise + beside[own, j] * missed
            c[n], off[n] = 1.0, 1.0
            _at_one(c, off, size[own], change, room, phase[:, panel, point], log[:, panel, point], error[:, panel, point])
            _known(np.isfinite(c).all(), most, phase[:, panel, point], log[:, panel, point], error[:, panel, point])


@compiled
def _known(finite, most, phase, log, error):
    """`critical._given` for one matrix."""
    for row in range(len(log)):
        known = finite and np.isfinite(log[row]) and np.isfinite(error[row])
        error[row] = min(error[row], most) if known else most
        if not finite:
            phase[row], log[row] = np.nan, np.inf
        elif not known:
            log[row] = -np.inf


@compiled
def _coefficient(q, missed, k):
    """Return the coefficient of a power and its error, 0 beyond the degree."""
    return (q[k], missed[k]) if k < len(q) else (q[0] * 0, 0.0)


@compiled
def _determinant(matrix, inverse, error):
    """Return phase and logarithm of the determinant, and the sum of `|inverse^T| error`; both matrices are used up.

    Gauss-Jordan elimination with row exchanges is used, since it gives the rows of the inverse's transpose at once.
    """
    n, phase, log, total = len(matrix), matrix[0, 0] * 0 + 1, 0.0, 0.0
    for i in range(n):
        for j in range(n):
            inverse[i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        at = _largest(matrix, k, k)
        if not _taxicab(matrix[at, k]) > 0:
            return phase, -690.0, np.inf
        _swapped(matrix, k, at)
        _swapped(inverse, k, at)
        pivot = matrix[k, k]
        size, back = abs(pivot), 1 / pivot
        phase, log = phase * (pivot / size) * (1.0 if at == k else -1.0), log + np.log(size)
        for j in range(n):
            matrix[k, j], inverse[k, j] = matrix[k, j] * back, inverse[k, j] * back
        for i in range(n):
            factor = matrix[i, k] * (i != k)
            for j in range(n):
                matrix[i, j] -= factor * matrix[k, j]
                inverse[i, j] -= factor * inverse[k, j]
    for i in range(n):
        for j in range(n):
            total += _size(inverse[j, i]) * error[i, j]
    return phase, log, total


def characteristic(E):
    """`critical.characteristic` by the kernel."""
    count, n, _ = E.shape
    c, reach, size = np.empty((n + 1, count), E.dtype), np.empty((n + 1, count)), np.empty(count)
    _characteristics(np.ascontiguousarray(E), c, reach, size)
    return c, reach, size


def functions(c, reach, size, change):
    """`critical._functions` by the kernel; change: see `critical._powers`."""
    phase, (log, error) = np.empty((4, size.size), c.dtype), np.empty((2, 4, size.size))
    _functions(*map(np.ascontiguousarray, (c, reach, size)), change, phase, log, error)
    return phase, log, error


def interpolated(pieces, piece, x):
    """`InterpolatedLoop.functions` by the kernel, at x, `(panels, points)`, of these pieces; not for rims."""
    phase, (log, error) = np.empty((4, *x.shape), complex), np.empty((2, 4, *x.shape))
    arrays = pieces.degree, pieces.coefficients, pieces.reach, pieces.beside, pieces.size
    change = _powers(pieces.reach.shape[-1])
    _followed(piece, x, *arrays, least_on_rim(), np.iscomplexobj(x), change, MOST_ERROR, phase, log, error)
    return phase, log, error
