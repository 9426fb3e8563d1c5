"""Crossings along a wall parameter by a compiled kernel: the steps of `crossings` and `boundary`, loop by loop.

This package loads numba, which is an optional extra, and nothing imports it unless the kernel is chosen (`wavesweep.kernel`).
The code in numpy is the reference: a column that the kernel does not prove is left to it.
"""

import numpy as np

from wavesweep.analysis.doubt import NONE
from wavesweep.analysis.intervals.bernstein import MOST, change_of_basis, largest_bernstein
from wavesweep.analysis.intervals.boundary import K_VE
from wavesweep.analysis.intervals.compiled.curve import (
    _at_ends,
    _judged,
    _polished,
    _polynomial,
    _row_order,
    _scale,
    _transform,
)
from wavesweep.analysis.intervals.compiled.isolating import _pieces, _roots
from wavesweep.analysis.intervals.compiled.labelling import (
    LEFT,
    OPEN,
    _asked,
    _closed,
    _cut,
    _followed,
    _intervals,
    _screened,
)
from wavesweep.analysis.intervals.compiled.lanes import LANES
from wavesweep.analysis.intervals.compiled.solving import _room
from wavesweep.analysis.intervals.crossings import FAR, NEAR_SEED, SLIVER, SPARE
from wavesweep.analysis.intervals.regions import SHARES
from wavesweep.analysis.intervals.stable import Intervals
from wavesweep.analysis.spectrum import count_outside
from wavesweep.lifted.compiled.caching import compiled
from wavesweep.lifted.cut import Cut


def proved(cut: Cut, owner, along: str, fixed, span) -> tuple[Intervals, np.ndarray]:
    """Return the intervals that the kernel proves, sorted, and the columns that it leaves.

    The columns have the loops `cut.at(owner)` and the other wall parameter `fixed`. owner: not falling.
    """
    n, loops, (low, high) = cut.order, cut.batch[0], map(float, span)
    arrays, facts = _arrays(cut), (cut.integrates, along == K_VE)
    columns = owner.astype(np.int64), np.ascontiguousarray(fixed)
    state = _screened(*arrays, *facts, *columns, low, high)
    if not 2 <= n <= MOST:
        state[state == OPEN] = LEFT
    change, farthest = (change_of_basis(n), largest_bernstein(n - 1)) if 2 <= n <= MOST else (np.zeros((0, 0)), np.inf)
    condition = np.broadcast_to(cut.condition, (loops,)).astype(float)
    *found, orders, above = _crossings(*arrays, *facts, *columns, low, high, change, farthest, state)
    bounds, rise, start = _cut(low, high, *found, state)
    width = high - low

    def counted(column, region):
        seen, open_ = np.full(region.size, -1), np.arange(region.size)
        for share in SHARES:
            some = region[open_]
            value = bounds[0, some] + share * (bounds[1, some] - bounds[0, some])
            A, known = _closed(*arrays, *facts, *columns, column[open_], value)
            count, sure = count_outside(A)
            seen[open_] = count = np.where(sure & known, count, -1)
            open_ = open_[count < 0]
            if not open_.size:
                break
        return seen

    asked = _asked(columns[0], state, start, bounds, width, above)
    at = np.flatnonzero(asked)
    seen = counted(at, start[at]) if at.size else at
    begins, claimed = _followed(columns[0], state, start, bounds, width, asked, seen, above, rise)
    if claimed.size:
        column = np.searchsorted(start, claimed, side="right") - 1
        state[column[counted(column, claimed) != begins[column] + rise[claimed]]] = LEFT
    _judged_ends(*arrays, *facts, orders, *columns, condition, width, state, start, bounds, rise, begins)
    (column, index, count), (*ends, low_theta, high_theta, residual) = _intervals(state, start, bounds, rise, begins)
    period = np.broadcast_to(cut.period, (loops,))[owner[column]]
    omega = low_theta / period, high_theta / period
    return Intervals(column, index, count, *ends, *omega, np.full(column.size, NONE), residual), np.flatnonzero(state == LEFT)


def _arrays(cut):
    """Return E `(loops, n, n)`, B `(loops, n)`, C `(loops, 3, n)` and D `(loops, 3)`."""
    batch, parts = cut.batch, (cut.E, cut.B[..., 0], cut.C, cut.D[..., 0])
    tails = (part.shape[len(part.shape) - axes :] for part, axes in zip(parts, (2, 1, 2, 1), strict=True))
    whole = ((part, (*batch, *tail)) for part, tail in zip(parts, tails, strict=True))
    return tuple(np.array(part if part.shape == shape else np.broadcast_to(part, shape), order="C") for part, shape in whole)


@compiled
def _crossings(E, B, C, D, integrates, along_k, owner, fixed, low, high, change, farthest, state):
    """Return the crossings of the columns that are OPEN; a column becomes LEFT if the signs do not prove them. See `crossings`.

    Returns the column of each crossing between z = 1 and -1, sorted; `(3, crossings)` of their value, angle and jump; `(2, 2,
    columns)` of the value and the jump of those at z = 1 and -1; `(loops, n)`, the order of rows of each loop; and `above`.
    """
    columns, n, orders = len(fixed), E.shape[1] + integrates, np.empty(E.shape[:2], np.int64)
    found, inner = np.empty(columns * n, np.int64), np.empty((3, columns * n))
    ends, above, room = np.empty((2, 2, columns)), np.zeros(columns), _room(E.shape[1])
    tables, first, total = (_transform(n + SPARE), change, farthest), 0, 0
    while first < columns:
        loop, after = owner[first], first + 1
        while after < columns and owner[after] == loop:
            after += 1
        if (state[first:after] == OPEN).any():
            scale = _scale(E[loop])
            orders[loop] = _row_order(E[loop], scale)
            own = E[loop], B[loop], C[loop], D[loop], integrates, along_k, orders[loop]
            here = state[first:after], fixed[first:after], ends[:, :, first:after], above[first:after]
            count = _of_loop(own, scale, low, high, tables, *here, found[total:], inner[:, total:], room)
            found[total : total + count] += first
            total += count
        first = after
    return found[:total], inner[:, :total], ends, orders, above


@compiled
def _of_loop(own, scale, low, high, tables, state, fixed, ends, above, found, inner, room):
    """Store the crossings of the columns of one loop, and return their number."""
    (transform, change, farthest), n, total, integrates = tables, len(own[0]) + own[4], 0, own[4]
    curve, over, noise, at_ends = np.zeros((2, n)), np.zeros((3, n + 1)), np.zeros(5), np.empty((2, 3))
    pieces = _pieces(n)
    c, values, slopes = np.empty((3, n))
    _polynomial(own, scale, transform, curve, over, noise, room)
    _at_ends(own, room, at_ends)
    for column in range(len(fixed)):
        if state[column] != OPEN:
            continue
        y, roots = fixed[column], -1
        size, at_one, at_minus_one = _coefficients(curve, y, c)
        for side in range(2):
            ends[0, side, column] = (at_ends[side, 0] - y * at_ends[side, 2]) / at_ends[side, 1]
        if integrates:
            ends[0, 0, column] = 0.0 if own[5] else np.inf
        ends[1, 0, column], ends[1, 1, column] = np.sign(at_one), -np.sign(at_minus_one)
        if len(change) == n:
            roots = _roots(
                c, (noise[0] + abs(y) * noise[1]) * (n * (n + 1) / 2) / size, change, farthest, 0.0, pieces, values, slopes
            )
        if roots < 0 or np.isnan(ends[0, :, column]).any():
            state[column] = LEFT
        for i in range(roots):
            side = _side(over, noise, y, values[i], low, high)
            if side:
                above[column] -= 2.0 * slopes[i] * (side > 0)
                continue
            found[total], inner[2, total] = column, -2.0 * slopes[i]
            inner[1, total] = 2 * np.arctan2(scale * np.sqrt(1 - values[i]), np.sqrt(1 + values[i]))
            total += 1
    _settled(own, low, high, state, fixed, above, found[:total], inner[:, :total], room)
    _add_growth(low, high, state, ends, above)
    return total


@compiled
def _add_growth(low, high, state, ends, above):
    """Add the parts of the crossings at z = 1 and -1."""
    for column in range(len(state)):
        for side in range(2 if state[column] == OPEN else 0):
            above[column] += _growth(ends[0, side, column], ends[1, side, column], low, high)


@compiled
def _settled(own, low, high, state, fixed, above, found, inner, room):
    """Polish the crossings between z = 1 and -1 from their seeds, a lane each."""
    most, (y, theta, seed, value), good = max(abs(low), abs(high)), np.empty((4, LANES)), np.empty(LANES, np.bool_)
    for first in range(0, len(found), LANES):
        count = min(LANES, len(found) - first)
        for lane in range(LANES):
            at = first + min(lane, count - 1)
            y[lane], theta[lane] = fixed[found[at]], inner[1, at]
        seed[:] = theta
        _polished(own, y, theta, value, good, most, room)
        for lane in range(count):
            at = first + lane
            column = found[at]
            inner[0, at], inner[1, at] = value[lane], theta[lane]
            if not (good[lane] and abs(theta[lane] - seed[lane]) <= NEAR_SEED * min(seed[lane], np.pi - seed[lane])):
                state[column] = LEFT
            above[column] += _growth(value[lane], inner[2, at], low, high)


@compiled
def _judged_ends(E, B, C, D, integrates, along_k, orders, owner, fixed, condition, width, state, start, bounds, rise, begins):
    """Store the residuals of the inner ends of stable regions in bounds (see `_cut`), a lane each; orders: see `_crossings`."""
    room, (y, value, theta, residual), places = _room(E.shape[1]), np.empty((4, LANES)), np.empty((2, LANES), np.int64)
    waiting, last = 0, len(fixed) - 1
    for column in range(len(fixed)):
        loop = owner[column]
        own = E[loop], B[loop], C[loop], D[loop], integrates, along_k, orders[loop]
        for region in range(start[column], start[column + 1] if state[column] == OPEN else start[column]):
            for side in range(2 if begins[column] + rise[region] == 0 else 0):
                if region == (start[column + 1] - 1 if side else start[column]):
                    continue
                places[0, waiting], places[1, waiting] = 4 + side, region
                y[waiting], value[waiting], theta[waiting] = fixed[column], bounds[side, region], bounds[2 + side, region]
                waiting += 1
                if waiting == LANES:
                    waiting = _judged_lanes(
                        own, condition[loop], y, value, theta, width, residual, room, waiting, places, bounds
                    )
        if waiting and (column == last or owner[column + 1] != loop):
            waiting = _judged_lanes(own, condition[loop], y, value, theta, width, residual, room, waiting, places, bounds)


@compiled
def _judged_lanes(own, condition, y, value, theta, width, residual, room, waiting, places, bounds):
    """Judge the crossings in the first lanes, store their residuals in bounds, and return 0, the number of those that wait."""
    y[waiting:], value[waiting:], theta[waiting:] = y[0], value[0], theta[0]
    _judged(own, condition, y, value, theta, width, residual, room)
    for lane in range(waiting):
        bounds[places[0, lane], places[1, lane]] = residual[lane]
    return 0


@compiled
def _coefficients(curve, y, c):
    """Store the coefficients of a column in c, the largest of size 1.

    Returns the number that they were divided by, and the polynomial at 1 and at -1.
    """
    size, at_one, at_minus_one, turn = 0.0, 0.0, 0.0, 1.0
    for k in range(len(c)):
        c[k] = curve[0, k] + y * curve[1, k]
        size = max(size, abs(c[k]))
    size = size if size > 0 else 1.0
    for k in range(len(c)):
        c[k] /= size
        at_one += c[k] * (k + 1)
        at_minus_one += turn * (c[k] * (k + 1))
        turn = -turn
    return size, at_one, at_minus_one


@compiled
def _side(over, noise, fixed, cosine, low, high):
    """Return 1 or -1 for a root whose wall parameter is surely above or below the span, 0 for others."""
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
def _growth(value, jump, low, high):
    """Return the part of a crossing in the growth from the low end on; see `crossings._growth_above`."""
    size = abs(value)
    if np.isnan(value) or FAR * max(abs(low), abs(high)) < size < np.inf:
        return np.nan
    if size == np.inf:
        return min(jump, 0.0)
    larger = max(abs(low), size)
    near = abs(value - low) <= max(SLIVER * (high - low), 4 * (np.nextafter(larger, np.inf) - larger))
    return jump if value > low and not near else 0.0
