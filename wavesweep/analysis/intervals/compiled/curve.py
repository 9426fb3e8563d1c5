"""The boundary of a loop for the kernel: its polynomials, points on it, and what rounding does to them; see `boundary`."""

import numpy as np

from wavesweep.analysis.intervals.boundary import ORDINARY, ROUNDS
from wavesweep.analysis.intervals.compiled.solving import _factored, _over, _solve, _solve_transposed, _states, compiled
from wavesweep.lifted.cut import ADVANCE, OFFSET, V

EPS = float(np.finfo(float).eps)


@compiled
def _terms(integrates, along_k, w, G):
    """(one, term of the parameter that is solved for, that of the other)."""
    if integrates:
        one, x, v = w, G[ADVANCE] + w * G[OFFSET], w * G[V]
    else:
        one, x, v = w * 0 + 1, G[OFFSET], G[V]
    return (one, x, v) if along_k else (one, v, x)


@compiled
def _slopes(integrates, along_k, w, G, dG):
    """Their derivatives by w."""
    if integrates:
        one, x, v = 1.0, dG[ADVANCE] + w * dG[OFFSET] + G[OFFSET], w * dG[V] + G[V]
    else:
        one, x, v = 0.0, dG[OFFSET] + 0j, dG[V] + 0j
    return (one, x, v) if along_k else (one, v, x)


@compiled
def _sines(samples, size, degree, transform, found):
    """The first coefficients of a sine polynomial in `found`, and a bound on the error of each."""
    count, tail = len(samples), 0.0
    for d in range(count):
        total = 0.0
        for k in range(count):
            total += samples[k] * transform[k, d]
        if d < degree:
            found[d] = total
        else:
            tail = max(tail, abs(total))
    return 8 * tail + 4 * count * EPS * size


@compiled
def _transform(count):
    """What takes samples of a sine polynomial to its coefficients, `(count, count)`."""
    transform = np.empty((count, count))
    for k in range(count):
        for d in range(count):
            transform[k, d] = np.sin(np.pi * (k + 1) / (count + 1) * (d + 1)) * (2 / (count + 1))
    return transform


@compiled
def _sampled(E, B, C, D, integrates, along_k, r, phi, A, exchanged, x, G):
    """One point of the warped circle: phase and logarithm of the pole polynomial, and the terms over it; see `crossings`."""
    a, zeta = (1 - r) / (1 + r), complex(np.cos(phi), np.sin(phi))
    top, bottom, log = (1 - a) * (zeta - 1), 1 + a * zeta, 0.0
    for i in range(len(E)):
        for j in range(len(E)):
            A[i, j] = -bottom * E[i, j]
        A[i, i] += top
        x[i] = B[i]
    phase = _factored(A, exchanged) + 0j
    for i in range(len(E)):
        inverse = abs(A[i, i])  # of a pivot
        phase, log = phase * _over(np.conj(A[i, i]), inverse + 0j), log - np.log(inverse)
    _solve(A, exchanged, x)
    for row in range(3):
        total = 0j
        for i in range(len(E)):
            total += C[row, i] * x[i]
        G[row] = bottom * total + D[row]
    if integrates:
        one, x_term, v_term = top, bottom * G[ADVANCE] + top * G[OFFSET], top * G[V]
    else:
        one, x_term, v_term = 1.0 + 0j, G[OFFSET], G[V]
    return (phase, log, one, x_term, v_term) if along_k else (phase, log, one, v_term, x_term)


@compiled
def _polynomial(E, B, C, D, integrates, along_k, r, transform, curve, over, noise):
    """The polynomials of a loop: those of the curve `(2, n)` and those of the wall parameter `(3, n + 1)`, and their noise."""
    n, count, size = len(E), len(transform), np.zeros(3)
    A, exchanged, x, G = (
        np.empty((n, n), np.complex128),
        np.empty(n, np.int64),
        np.empty(n, np.complex128),
        np.empty(3, np.complex128),
    )
    terms, logs, samples = np.empty((3, count), np.complex128), np.empty(count), np.empty((5, count))
    for k in range(count):
        phi = np.pi * (k + 1) / (count + 1)
        phase, logs[k], one, solved, fixed = _sampled(E, B, C, D, integrates, along_k, r, phi, A, exchanged, x, G)
        terms[0, k], terms[1, k], terms[2, k] = phase * one, phase * solved, phase * fixed
    most = logs.max()
    for k in range(count):
        pole, weight = np.exp(logs[k] - most), np.sin(np.pi * (k + 1) / (count + 1))
        solved = np.conj(pole * terms[1, k])
        on_one, on_fixed, square = pole * terms[0, k] * solved, pole * terms[2, k] * solved, solved.real**2 + solved.imag**2
        size[0], size[1], size[2] = max(size[0], abs(on_one)), max(size[1], abs(on_fixed)), max(size[2], square)
        samples[0, k], samples[1, k] = on_one.imag, -on_fixed.imag
        samples[2, k], samples[3, k], samples[4, k] = on_one.real * weight, on_fixed.real * weight, square * weight
    degree = curve.shape[1]
    for part in range(2):
        noise[part] = _sines(samples[part], size[part], degree, transform, curve[part])
    for part in range(3):
        noise[2 + part] = _sines(samples[2 + part], size[part], degree + 1, transform, over[part])


@compiled
def _polished(E, B, C, D, integrates, along_k, fixed, theta, scale, A, exchanged, x, turn, G, dG):
    """Newton on `Im K(theta) = 0` from a seed; see `boundary.polish`. Returns theta, the value, and whether all is well."""
    value = np.nan
    for _ in range(ROUNDS):
        half = np.sin(theta / 2)
        w = complex(-2 * half * half, np.sin(theta))
        _states(E, B, w, A, exchanged, x, turn)
        for i in range(len(x)):
            turn[i] = x[i]
        _solve(A, exchanged, turn)
        for row in range(3):
            shown, slope = D[row] + 0j, 0j
            for i in range(len(x)):
                shown += C[row, i] * x[i]
                slope -= C[row, i] * turn[i]
            G[row], dG[row] = shown, slope
        one, solved, other = _terms(integrates, along_k, w, G)
        d_one, d_solved, d_other = _slopes(integrates, along_k, w, G, dG)
        now = _over(one - fixed * other, solved)
        slope = _over(d_one - fixed * d_other - now * d_solved, solved) * (1j * (1 + w))
        far = abs(now) > scale
        if far:
            now, slope = _over(1.0 + 0j, now), -_over(slope, now * now)
        step = -now.imag / slope.imag
        if not np.isfinite(step):
            step = 0.0
        small = abs(step) <= 1e-9 * min(theta, np.pi - theta)
        theta = min(max(theta + step, 1e-3 * theta), np.pi - 1e-3 * (np.pi - theta))
        value = now.real + step * slope.real
        if far:
            value = 1 / value
        if small:
            return theta, value, slope.imag != 0
    return theta, value, False


@compiled
def _at_end(E, B, C, D, integrates, along_k, w, G):
    """The terms at z = 1 or -1, `w` being 0 or -2."""
    n = len(E)
    A, exchanged, (x, rest) = np.empty((n, n), np.complex128), np.empty(n, np.int64), np.empty((2, n), np.complex128)
    _states(E, B, w, A, exchanged, x, rest)
    for row in range(3):
        shown = D[row] + 0j
        for i in range(n):
            shown += C[row, i] * x[i]
        G[row] = shown
    one, solved, other = _terms(integrates, along_k, w, G)
    return one.real, solved.real, other.real


@compiled
def _ends(E, B, C, D, condition, integrates, along_k, owner, fixed, value, place, on_axis):
    n, points = E.shape[1], len(place)
    A, exchanged, (x, rest, left) = np.empty((n, n), np.complex128), np.empty(n, np.int64), np.empty((3, n), np.complex128)
    (G, dG), (off, size), error = np.empty((2, 3), np.complex128), np.empty((2, n)), np.empty(3)
    residual, moved, usual = np.empty((3, points))
    for point in range(points):
        loop, w, y, p = owner[point], place[point], fixed[point], value[point]
        _states(E[loop], B[loop], w, A, exchanged, x, rest)
        for i in range(n):
            size[i] = abs(x[i])
        for i in range(n):
            missed, terms = B[loop, i] - w * x[i], abs(B[loop, i])
            for j in range(n):
                missed += E[loop, i, j] * x[j]
                terms += abs(E[loop, i, j]) * size[j]
            off[i] = EPS * terms + abs(missed)
        for row in range(3):
            for i in range(n):
                left[i] = C[loop, row, i]
            _solve_transposed(A, exchanged, left)
            for j in range(n):
                missed = C[loop, row, j] - w * left[j]
                for i in range(n):
                    missed += left[i] * E[loop, i, j]
                rest[j] = missed
            _solve_transposed(A, exchanged, rest)
            shown, slope, error[row] = D[loop, row] + 0j, 0j, EPS * abs(D[loop, row])
            for i in range(n):
                left[i] += rest[i]
                shown += C[loop, row, i] * x[i]
                slope -= left[i] * x[i]
                error[row] += abs(left[i]) * off[i] + EPS * abs(C[loop, row, i]) * size[i]
            G[row], dG[row] = shown, slope
        one, solved, other = _terms(integrates, along_k, w, G)
        d_one, d_solved, d_other = _slopes(integrates, along_k, w, G, dG)
        _, of_solved, of_other = _terms(integrates, along_k, abs(w), error)
        exact = _over(one - y * other, solved)
        turned = _over(d_one - y * d_other - exact * d_solved, solved) * (1j * (1 + w))
        unsure = abs(y) * of_other + abs(exact) * of_solved
        grazing = 1.0 if on_axis[point] else abs(turned) / abs(turned.imag)
        whole = abs(one) + abs(y * other) + abs(exact * solved)
        usual[point] = unsure / (whole if whole > 0 else 1.0)
        moved[point] = max(1.0, condition[loop] / ORDINARY) * unsure / abs(solved) * grazing
        residual[point] = abs(one - p * solved - y * other) / (abs(one) + abs(p * solved) + abs(y * other))
    return residual, moved, usual
