"""Crossings along a wall parameter by a compiled kernel: the steps of `crossings` and `boundary`, loop by loop.

This package loads numba, which is an optional extra, and nothing imports it unless the kernel is chosen (`wavesweep.kernel`).
numpy's way is the reference: a column that this one does not prove is left to it.
"""

import numpy as np

from wavesweep.analysis.intervals.bernstein import MOST, change_of_basis, largest_bernstein
from wavesweep.analysis.intervals.boundary import K_VE
from wavesweep.analysis.intervals.compiled.curve import _at_end, _ends, _polished, _polynomial, _transform
from wavesweep.analysis.intervals.compiled.isolating import _roots
from wavesweep.analysis.intervals.compiled.solving import compiled
from wavesweep.analysis.intervals.crossings import FAR, SPARE, Crossings, warp_scale
from wavesweep.lifted.cut import Cut

NEAR_SEED = 1e-4  # of an angle, how far a polished one may be from its seed


def crossings(cut: Cut, owner, along: str, fixed, span) -> Crossings:
    """Crossings of the columns with the loops `cut.at(owner)` and the other wall parameter `fixed`; see `crossings.crossings`.

    Columns whose roots the signs of Bernstein coefficients do not prove are not complete.
    """
    n, loops = cut.order, cut.batch[0]
    scale = np.broadcast_to(warp_scale(cut), (loops,)).astype(float)
    change = change_of_basis(n) if 2 <= n <= MOST else np.zeros((0, 0))
    farthest = largest_bernstein(n - 1) if 2 <= n <= MOST else np.inf
    found, value, theta, jump, ends, signs, complete, above = _crossings(
        *_arrays(cut), cut.integrates, along == K_VE, owner.astype(np.int64), fixed, *map(float, span), scale, change, farthest
    )
    every = np.tile(np.arange(fixed.size), 2)
    column = np.concatenate([found, every])
    value, jump = np.concatenate([value, ends.ravel()]), np.concatenate([jump, signs.ravel()])
    theta = np.concatenate([theta, np.repeat([0.0, np.pi], fixed.size)])
    return Crossings(column, value, theta, jump, np.zeros(column.size, int), None, complete, above)


def ends(cut: Cut, owner, along: str, fixed, value, w, on_axis):
    """What `boundary.ends` gives, at crossings of the loops `cut.at(owner)`."""
    condition = np.broadcast_to(cut.condition, cut.batch).astype(float)
    return _ends(
        *_arrays(cut),
        condition,
        cut.integrates,
        along == K_VE,
        owner.astype(np.int64),
        fixed,
        value,
        w.astype(complex),
        on_axis,
    )


def _arrays(cut):
    """E `(loops, n, n)`, B `(loops, n)`, C `(loops, 3, n)` and D `(loops, 3)`."""
    batch, parts = cut.batch, (cut.E, cut.B[..., 0], cut.C, cut.D[..., 0])
    tails = (part.shape[len(part.shape) - axes :] for part, axes in zip(parts, (2, 1, 2, 1), strict=True))
    whole = ((part, (*batch, *tail)) for part, tail in zip(parts, tails, strict=True))
    return tuple(np.array(part if part.shape == shape else np.broadcast_to(part, shape), order="C") for part, shape in whole)


@compiled
def _crossings(E, B, C, D, integrates, along_k, owner, fixed, low, high, scale, change, farthest):
    order, n, columns, most = E.shape[1], E.shape[1] + integrates, len(fixed), max(abs(low), abs(high))
    curve, over, noise, transform = np.zeros((2, n)), np.zeros((3, n + 1)), np.zeros(5), _transform(n + SPARE)
    A, exchanged = np.empty((order, order), np.complex128), np.empty(order, np.int64)
    (x, turn), (G, dG) = np.empty((2, order), np.complex128), np.empty((2, 3), np.complex128)
    pieces = np.empty(64), np.empty(64), np.empty(64, np.int64), np.empty(64), np.empty((64, n))
    (c, values, slopes), (one, solved, other) = np.empty((3, n)), np.empty((3, 2))
    found, (value, theta, jump), total, current = np.empty(columns * n, np.int64), np.empty((3, columns * n)), 0, -1
    (ends, signs), complete, above = np.empty((2, 2, columns)), np.zeros(columns, np.bool_), np.zeros(columns)
    for column in range(columns):
        loop, y, roots = owner[column], fixed[column], -1
        own = E[loop], B[loop], C[loop], D[loop], integrates, along_k
        if loop != current:
            current = loop
            _polynomial(*own, scale[loop], transform, curve, over, noise)
            for side in range(2):
                one[side], solved[side], other[side] = _at_end(*own, -2.0 * side + 0j, G)
        size, at_one, at_minus_one = _coefficients(curve, y, c)
        ends[:, column] = (one - y * other) / solved
        if integrates:
            ends[0, column] = 0.0 if along_k else np.inf
        signs[0, column], signs[1, column] = np.sign(at_one), -np.sign(at_minus_one)
        if len(change) == n:
            roots = _roots(
                c, (noise[0] + abs(y) * noise[1]) * (n * (n + 1) / 2) / size, change, farthest, pieces, values, slopes
            )
        complete[column] = roots >= 0 and not np.isnan(ends[:, column]).any()
        for i in range(roots):
            side = _side(over, noise, y, values[i], low, high)
            if side:
                above[column] -= 2.0 * slopes[i] * (side > 0)
                continue
            seed = 2 * np.arctan2(scale[loop] * np.sqrt(1 - values[i]), np.sqrt(1 + values[i]))
            found[total], jump[total] = column, -2.0 * slopes[i]
            theta[total], value[total], good = _polished(*own, y, seed, most, A, exchanged, x, turn, G, dG)
            complete[column] &= good and abs(theta[total] - seed) <= NEAR_SEED * min(seed, np.pi - seed)
            above[column] += _growth(value[total], jump[total], low, most)
            total += 1
        for side in range(2):
            above[column] += _growth(ends[side, column], signs[side, column], low, most)
        if not complete[column]:
            above[column] = np.nan
    return found[:total], value[:total], theta[:total], jump[:total], ends, signs, complete, above


@compiled
def _coefficients(curve, y, c):
    """Those of a column in c, the largest of size 1; what they were divided by, and the polynomial at 1 and at -1."""
    size, at_one, at_minus_one = 0.0, 0.0, 0.0
    for k in range(len(c)):
        c[k] = curve[0, k] + y * curve[1, k]
        size = max(size, abs(c[k]))
    size = size if size > 0 else 1.0
    for k in range(len(c)):
        c[k] /= size
        at_one += c[k] * (k + 1)
        at_minus_one += c[k] * (k + 1) * (-1.0) ** k
    return size, at_one, at_minus_one


@compiled
def _side(over, noise, fixed, cosine, low, high):
    """1 or -1 for a root whose wall parameter is surely above or below the span, 0 for others."""
    before, now, weight = 0.0, 1.0, 0.0
    first = second = lower = 0.0
    for k in range(over.shape[1]):
        first, second, lower = first + over[0, k] * now, second + over[1, k] * now, lower + over[2, k] * now
        before, now, weight = now, 2 * cosine * now - before, weight + k + 1
    upper, unsure = first - fixed * second, weight * (noise[2] + abs(fixed) * noise[3])
    if upper - high * lower > unsure + weight * abs(high) * noise[4]:
        return 1
    return -1 if upper - low * lower < -(unsure + weight * abs(low) * noise[4]) else 0


@compiled
def _growth(value, jump, low, most):
    """What a crossing adds to the growth from the low end on; see `crossings._growth_above`."""
    size = abs(value)
    if np.isnan(value) or FAR * most < size < np.inf:
        return np.nan
    if size == np.inf:
        return min(jump, 0.0)
    larger = max(abs(low), size)
    near = abs(value - low) <= 4 * (np.nextafter(larger, np.inf) - larger)
    return jump if value > low and not near else 0.0
