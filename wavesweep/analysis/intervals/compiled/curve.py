"""The boundary of a loop for the kernel: its polynomials, points on it, and the effect of rounding; see `boundary`.

own: the data of a loop that all functions take: (E, B, C, D, whether it integrates, whether the stiffness is swept, the order
of rows).
"""

import numpy as np

from wavesweep.analysis.intervals.boundary import LAST_STEP, NEAREST_END, ORDINARY, ROUNDS
from wavesweep.analysis.intervals.compiled.lanes import LANES, more, put, sized
from wavesweep.analysis.intervals.compiled.solving import (
    WIDE,
    _factored,
    _filled,
    _largest,
    _missed,
    _missed_transposed,
    _modulus,
    _order,
    _over,
    _solved,
    _solved_transposed,
    _states,
    _swapped,
)
from wavesweep.analysis.intervals.crossings import FARTHEST, NEAREST
from wavesweep.analysis.intervals.regions import FIRM, NEAR_ZERO, SMALL_RESIDUAL, USUAL
from wavesweep.lifted.compiled.caching import compiled
from wavesweep.lifted.cut import ADVANCE, OFFSET, V

EPS = float(np.finfo(float).eps)


@compiled
def _terms(integrates, along_k, w, G):
    """Return (one, term of the parameter that is solved for, that of the other)."""
    if integrates:
        one, x, v = w, G[ADVANCE] + w * G[OFFSET], w * G[V]
    else:
        one, x, v = w * 0 + 1, G[OFFSET], G[V]
    return (one, x, v) if along_k else (one, v, x)


@compiled
def _slopes(integrates, along_k, w, G, dG):
    """Return the derivatives of the terms by w."""
    if integrates:
        one, x, v = 1.0, dG[ADVANCE] + w * dG[OFFSET] + G[OFFSET], w * dG[V] + G[V]
    else:
        one, x, v = 0.0, dG[OFFSET] + 0j, dG[V] + 0j
    return (one, x, v) if along_k else (one, v, x)


@compiled
def _sines(samples, size, degree, transform, found):
    """Store the first coefficients of a sine polynomial in `found`, and return a bound on the error of each."""
    count, tail, whole = len(samples), 0.0, np.zeros(len(samples))
    for k in range(count):
        for d in range(count):
            whole[d] += samples[k] * transform[k, d]
    for d in range(count):
        if d < degree:
            found[d] = whole[d]
        else:
            tail = max(tail, abs(whole[d]))
    return 8 * tail + 4 * count * EPS * size


@compiled
def _transform(count):
    """Return the map from samples of a sine polynomial to its coefficients, `(count, count)`."""
    transform = np.empty((count, count))
    for k in range(count):
        for d in range(count):
            transform[k, d] = np.sin(np.pi * (k + 1) / (count + 1) * (d + 1)) * (2 / (count + 1))
    return transform


@compiled
def _scale(E):
    """Return the scale of the warp for a loop, see `crossings.warp_scale`."""
    A, n, log = E.copy(), len(E), 0.0
    for k in range(n):
        _swapped(A, k, _largest(A, k, k))
        log += np.log(np.abs(A[k, k]))
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= factor * A[k, j]
    mean = np.exp(-0.5 if log == -np.inf or np.isnan(log) else log / n)
    return min(max(mean, NEAREST), FARTHEST)


@compiled
def _row_order(E, r):
    """Return the order of rows that suits the middle of the warped circle; all points of the loop begin with it."""
    w = complex(np.cos(2 * np.arctan(r)), np.sin(2 * np.arctan(r))) - 1
    A = np.empty(E.shape, np.complex128)
    for i in range(len(E)):
        for j in range(len(E)):
            A[i, j] = -E[i, j]
        A[i, i] += w
    return _order(A)


@compiled
def _sampled(own, r, first, count, terms, weight, room):
    """Store the terms and the squared size of the pole polynomial's inverse at points of the warped circle; see `crossings`."""
    E, B, C, D, integrates, along_k, order = own
    A, rows, vectors, parts = room
    n, a, x, given, one, G = len(E), (1 - r) / (1 + r), vectors[0], vectors[1], parts[0], np.empty(3, np.complex128)
    tops, bottoms, most, shown = parts[1], parts[3], parts[2], parts[4]
    top, bottom = np.empty((2, LANES), np.complex128)
    for lane in range(LANES):
        phi = np.pi * (min(first + lane, count - 1) + 1) / (count + 1)
        zeta = complex(np.cos(phi), np.sin(phi))
        top[lane], bottom[lane] = (1 - a) * (zeta - 1), 1 + a * zeta
        tops[lane], tops[LANES + lane] = top[lane].real, top[lane].imag
        bottoms[lane], bottoms[LANES + lane] = bottom[lane].real, bottom[lane].imag
    _filled(E, order, tops, bottoms, A, rows)
    _factored(n, A, rows, most)
    for i in range(n):
        put(given, i, B[i], one, 0)
    _solved(n, A, rows, given, x)
    _seen(C, x, 1.0, shown)
    for lane in range(min(LANES, count - first)):
        point, square = first + lane, 1.0
        for i in range(n):
            at = (i * n + i) * WIDE + lane
            square *= A[at] * A[at] + A[at + LANES] * A[at + LANES]
        weight[point] = square
        for row in range(3):
            G[row] = bottom[lane] * complex(shown[row * WIDE + lane], shown[row * WIDE + LANES + lane]) + D[row]
        if integrates:
            value = top[lane], bottom[lane] * G[ADVANCE] + top[lane] * G[OFFSET], top[lane] * G[V]
        else:
            value = 1.0 + 0j, G[OFFSET], G[V]
        terms[0, point], terms[1, point], terms[2, point] = value if along_k else (value[0], value[2], value[1])


@compiled
def _seen(C, x, sign, G):
    """Store `sign C x` in the three vectors of G."""
    for row in range(3):
        put(G, row, sign * C[row, 0], x, 0)
        for i in range(1, C.shape[1]):
            more(G, row, sign * C[row, i], x, i)


@compiled
def _polynomial(own, r, transform, curve, over, noise, room):
    """Store the polynomials of a loop and their noise.

    curve: `(2, n)`, those of the curve. over: `(3, n + 1)`, those of the wall parameter.
    """
    count, size = len(transform), np.zeros(3)
    terms, weight, samples = np.empty((3, count), np.complex128), np.empty(count), np.empty((5, count))
    for first in range(0, count, LANES):
        _sampled(own, r, first, count, terms, weight, room)
    least = weight.min()
    for k in range(count):
        pole, solved, turn = least / weight[k], np.conj(terms[1, k]), np.sin(np.pi * (k + 1) / (count + 1))
        on_one, on_fixed = pole * terms[0, k] * solved, pole * terms[2, k] * solved
        square = pole * (solved.real**2 + solved.imag**2)
        size[0], size[1], size[2] = max(size[0], abs(on_one)), max(size[1], abs(on_fixed)), max(size[2], square)
        samples[0, k], samples[1, k] = on_one.imag, -on_fixed.imag
        samples[2, k], samples[3, k], samples[4, k] = on_one.real * turn, on_fixed.real * turn, square * turn
    degree = curve.shape[1]
    for part in range(2):
        noise[part] = _sines(samples[part], size[part], degree, transform, curve[part])
    for part in range(3):
        noise[2 + part] = _sines(samples[2 + part], size[part], degree + 1, transform, over[part])


@compiled
def _placed(theta, w):
    """Store the points `exp(j theta) - 1` in w, exactly at both ends of the circle."""
    for lane in range(LANES):
        half, at_end = np.sin(theta[lane] / 2), theta[lane] == np.pi or theta[lane] == 0.0
        w[lane], w[LANES + lane] = -2 * half * half, 0.0 if at_end else np.sin(theta[lane])


@compiled
def _responses(own, room):
    """Store the states at the points, the outputs, and their derivatives by w, in the third and fourth part of the room."""
    E, B, C, _, _, _, order = own
    A, rows, vectors, parts = room
    _states(E, B, order, room)
    _solved(len(E), A, rows, vectors[0], vectors[3])
    _seen(C, vectors[0], 1.0, parts[3])
    _seen(C, vectors[3], -1.0, parts[4])


@compiled
def _in_lane(own, room, lane, G, dG):
    """Return the point of a lane, the terms there and their derivatives."""
    _, _, _, D, integrates, along_k, _ = own
    _, _, _, parts = room
    w = complex(parts[1, lane], parts[1, LANES + lane])
    for row in range(3):
        at = row * WIDE + lane
        G[row] = complex(parts[3, at], parts[3, at + LANES]) + D[row]
        dG[row] = complex(parts[4, at], parts[4, at + LANES])
    return w, _terms(integrates, along_k, w, G), _slopes(integrates, along_k, w, G, dG)


@compiled
def _polished(own, y, theta, value, good, scale, room):
    """Solve `Im K(theta) = 0` by Newton's method from the seeds in theta, which it changes; see `boundary.polish`.

    value: K there. good: whether the iteration has converged. y, theta, value, good: `(LANES,)`.
    """
    G, dG = np.empty((2, 3), np.complex128)
    done = np.zeros(LANES, np.bool_)
    value[:], good[:] = np.nan, False
    for _ in range(ROUNDS):
        _placed(theta, room[3][1])
        _responses(own, room)
        for lane in range(LANES):
            if done[lane]:
                continue
            w, (one, solved, other), (d_one, d_solved, d_other) = _in_lane(own, room, lane, G, dG)
            now = _over(one - y[lane] * other, solved)
            slope = _over(d_one - y[lane] * d_other - now * d_solved, solved) * (1j * (1 + w))
            far = _modulus(now) > scale
            if far:
                now, slope = _over(1.0 + 0j, now), -_over(slope, now * now)
            step, at = -now.imag / slope.imag, theta[lane]
            if not np.isfinite(step):
                step = 0.0
            done[lane] = abs(step) <= LAST_STEP * min(at, np.pi - at)
            theta[lane] = min(max(at + step, NEAREST_END * at), np.pi - NEAREST_END * (np.pi - at))
            found = now.real + step * slope.real
            value[lane] = 1 / found if far else found
            good[lane] = done[lane] and slope.imag != 0
        if done.all():
            break


@compiled
def _at_ends(own, room, found):
    """Store the terms at z = 1 and at z = -1, `(2, 3)`."""
    G, dG = np.empty((2, 3), np.complex128)
    theta = np.full(LANES, np.pi)
    theta[0] = 0.0
    _placed(theta, room[3][1])
    _responses(own, room)
    for lane in range(2):
        _, (one, solved, other), _ = _in_lane(own, room, lane, G, dG)
        found[lane, 0], found[lane, 1], found[lane, 2] = one.real, solved.real, other.real


@compiled
def _judged(own, condition, y, p, theta, width, residual, room):
    """Store the residual of the equation at crossings, relative to its terms; all arrays are `(LANES,)`.

    It is infinite if it is more than rounding, or if rounding of the loop's entries moves the wall parameter p by more than is
    allowed.
    """
    (moved, usual), least = np.empty((2, LANES)), NEAR_ZERO * width
    _end(own, condition, y, p, theta, least, residual, moved, usual, room)
    for lane in range(LANES):
        firm = moved[lane] <= FIRM * (abs(p[lane]) + least)
        if not (residual[lane] <= USUAL * (usual[lane] + EPS) and residual[lane] <= SMALL_RESIDUAL and firm):
            residual[lane] = np.inf


@compiled
def _end(own, condition, y, p, theta, least, residual, moved, usual, room):
    """`boundary.end_errors` for lanes of crossings; all arrays are `(LANES,)`.

    An entry's change reaches the equation through one row, `exact` times that of the parameter solved for and y times that of
    the other: the bound is sharper than the sum over both.
    """
    E, B, C, _, integrates, along_k, _ = own
    A, rows, vectors, parts = room
    w, factors, x, left, (whole, moves) = parts[1], parts[5], vectors[0], vectors[5], np.empty((2, LANES))
    G, dG = np.empty((2, 3), np.complex128)
    _placed(theta, w)
    _responses(own, room)
    _missed(E, B, w, parts[0], x, vectors[1])
    for lane in range(LANES):
        at, (unit, solved, other), (d_unit, d_solved, d_other) = _in_lane(own, room, lane, G, dG)
        exact, on_axis = _over(unit - y[lane] * other, solved), theta[lane] == 0.0 or theta[lane] == np.pi
        turned = _over(d_unit - y[lane] * d_other - exact * d_solved, solved) * (1j * (1 + at))
        on_one, on_solved, on_other = _modulus(unit), _modulus(solved), abs(y[lane]) * _modulus(other)
        whole[lane] = on_one + on_other + (_modulus(exact) + least) * on_solved
        moves[lane] = (1.0 if on_axis else _modulus(turned) / abs(turned.imag)) / on_solved
        left_over = _modulus(unit - p[lane] * solved - y[lane] * other)
        residual[lane] = left_over / (on_one + (abs(p[lane]) + least) * on_solved + on_other)
        if integrates and at == 0:
            residual[lane] = 0.0  # the equation is 0 = 0 at K_VE = 0, by structure
        on_x, on_v = (exact, y[lane] + 0j) if along_k else (y[lane] + 0j, exact)
        for row, factor in ((ADVANCE, on_x * integrates), (OFFSET, on_x), (V, on_v)):
            turn = at if integrates and row != ADVANCE else 1.0 + 0j
            factors[row * WIDE + lane], factors[row * WIDE + LANES + lane] = (factor * turn).real, (factor * turn).imag
    _row_of_states(C, E, w, factors, A, rows, left, vectors[4], vectors[2])
    unsure = _rounding(own, room)
    for lane in range(LANES):
        usual[lane] = unsure[lane] / (whole[lane] if whole[lane] > 0 else 1.0)
        moved[lane] = max(1.0, condition / ORDINARY) * unsure[lane] * moves[lane]


@compiled
def _row_of_states(C, E, w, factors, A, rows, left, given, step):
    """Store in left the row that `factors` make of the three of C, times the inverse of `w I - E`, refined once."""
    _combined(C, factors, given)
    _solved_transposed(len(E), A, rows, given, left)
    _combined(C, factors, given)
    _missed_transposed(E, w, left, given)
    _solved_transposed(len(E), A, rows, given, step)
    for i in range(len(E)):
        more(left, i, 1.0, step, i)


@compiled
def _rounding(own, room):
    """Return the change of the equation if every entry of the loop is rounded, `(LANES,)`; the room is used up."""
    E, B, C, D, _, _, _ = own
    _, _, vectors, parts = room
    n, one, factors, direct, unsure = len(E), parts[0], parts[5], parts[6], np.zeros(LANES)
    x, missed, _, _, _, left, size, off = vectors
    for i in range(n):
        sized(size, i, x, i)
        sized(left, i, left, i)
        sized(missed, i, missed, i)
    for i in range(n):
        put(off, i, abs(B[i]), one, 0)
        for j in range(n):
            more(off, i, abs(E[i, j]), size, j)
    for row in range(3):
        sized(factors, row, factors, row)
        put(direct, row, abs(D[row]), one, 0)
        for i in range(n):
            more(direct, row, abs(C[row, i]), size, i)
    for lane in range(LANES):
        for row in range(3):
            unsure[lane] += EPS * factors[row * WIDE + lane] * direct[row * WIDE + lane]
        for i in range(n):
            at = i * WIDE + lane
            unsure[lane] += left[at] * (EPS * off[at] + missed[at])
    return unsure


@compiled
def _combined(C, factors, row):
    """Store in row the combination of the three rows of C with these factors."""
    for i in range(C.shape[1]):
        put(row, i, C[0, i], factors, 0)
        more(row, i, C[1, i], factors, 1)
        more(row, i, C[2, i], factors, 2)
