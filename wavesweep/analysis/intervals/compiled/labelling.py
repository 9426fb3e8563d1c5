"""Regions between crossings, their counts and the stable intervals, column by column, for the kernel; see `regions`.

If there is any doubt about a column, it is left to the code in numpy, so nothing here gives a reason.
"""

import numpy as np

from wavesweep.analysis.intervals.crossings import SLIVER
from wavesweep.analysis.intervals.regions import BEYOND_ORDER, NARROW, TRACE_ROUNDING
from wavesweep.lifted.compiled.caching import compiled
from wavesweep.lifted.cut import ADVANCE, OFFSET, V
from wavesweep.lifted.rounding import BALANCING

OPEN, EXCLUDED, LEFT = 0, 1, 2  # a column: to be done; unstable throughout, by its trace; left to numpy's way


@compiled
def _screened(E, B, C, D, integrates, along_k, owner, fixed, low, high):
    """Return OPEN, EXCLUDED or LEFT for each column; see `stable.trace_excludes_stability`."""
    loops, n = len(E), E.shape[1]
    order, state = n + integrates, np.zeros(len(fixed), np.int64)
    base, gain, finite = np.empty(loops), np.empty((loops, 2)), np.empty(loops, np.bool_)
    for loop in range(loops):
        finite[loop] = (
            np.isfinite(E[loop]).all()
            and np.isfinite(B[loop]).all()
            and np.isfinite(C[loop]).all()
            and np.isfinite(D[loop]).all()
        )
        trace, x, v = 0.0, D[loop, ADVANCE] if integrates else 0.0, 0.0
        for i in range(n):
            trace += E[loop, i, i]
            x += C[loop, OFFSET, i] * B[loop, i]
            v += C[loop, V, i] * B[loop, i]
        base[loop], gain[loop, 0], gain[loop, 1] = order + trace, x, v
    traces, through = np.empty(2), np.empty(2)
    for column in range(len(fixed)):
        loop, y, beyond = owner[column], fixed[column], True
        if not finite[loop]:
            state[column] = LEFT
            continue
        for side in range(2):
            end = high if side else low
            K, F = (end, y) if along_k else (y, end)
            through[side] = 1 - K * D[loop, OFFSET] - F * D[loop, V]
            added, size = K * gain[loop, 0] + F * gain[loop, 1], abs(K * gain[loop, 0]) + abs(F * gain[loop, 1])
            traces[side] = base[loop] + added / through[side]
            terms = abs(base[loop]) + size / abs(through[side])
            beyond &= abs(traces[side]) > max(BEYOND_ORDER * order, TRACE_ROUNDING * terms)
        if beyond and traces[0] * np.sign(traces[1]) > 0 and through[0] * through[1] > 0:
            state[column] = EXCLUDED
    return state


@compiled
def _cut(low, high, found, inner, ends, state):
    """Return the regions of all columns that are OPEN, and the first region of each column; see `regions.cut_span`.

    found, inner, ends: see `_crossings`. For each region the result has its ends, their angles, and zeros for the residuals of
    the equation at both, `(6, regions)`, and the growth of the count since the first region.
    """
    columns, at, region = len(state), 0, 0
    most = len(found) + 3 * columns
    bounds, rise, start = np.empty((6, most)), np.empty(most), np.empty(columns + 1, np.int64)
    sorted_ = np.empty((3, len(found) + 2))
    for column in range(columns):
        start[column], first = region, at
        while at < len(found) and found[at] == column:
            at += 1
        if state[column] != OPEN:
            continue
        count, at_low, at_high = _sorted(low, high, inner[:, first:at], ends[:, :, column], sorted_)
        risen = 0.0
        for i in range(count + 1):
            risen += sorted_[2, i - 1] if i else 0.0
            for side in range(2):
                if side <= i < count + side:
                    value, theta = sorted_[0, i - side], sorted_[1, i - side]
                else:
                    value, theta = (low, at_low) if side else (high, at_high)
                bounds[1 - side, region], bounds[3 - side, region], bounds[5 - side, region] = value, theta, 0.0
            rise[region] = risen
            region += 1
    start[columns] = region
    return bounds[:, :region], rise[:region], start


@compiled
def _sorted(low, high, inner, ends, found):
    """Store the crossings of a column inside the span, sorted, in `found`.

    Returns their number, and the angles of one at the low end of the span and of one at its high end.
    """
    count, at_low, at_high, arcs = 0, np.nan, np.nan, inner.shape[1]
    for i in range(arcs + 2):
        if i < arcs:
            p, theta, jump = inner[0, i], inner[1, i], inner[2, i]
        else:
            p, theta, jump = ends[0, i - arcs], np.pi * (i - arcs), ends[1, i - arcs]
        larger = max(abs(low), abs(p))
        if abs(p - low) <= max(SLIVER * (high - low), 4 * (np.nextafter(larger, np.inf) - larger)):
            at_low = theta
        elif abs(p - high) <= SLIVER * (high - low):
            at_high = theta
        elif low < p < high:
            place = count
            while place > 0 and found[0, place - 1] > p:
                for part in range(3):
                    found[part, place] = found[part, place - 1]
                place -= 1
            found[0, place], found[1, place], found[2, place] = p, theta, jump
            count += 1
    return count, at_low, at_high


@compiled
def _closed(E, B, C, D, integrates, along_k, owner, fixed, column, value):
    """`lifted.close` for the loops of these columns with their walls, `(columns, order, order)`.

    Returns zeros for a loop whose matrix is not finite, and whether each matrix is finite.
    """
    n, count = E.shape[1], len(column)
    A, known = np.zeros((count, n + integrates, n + integrates)), np.ones(count, np.bool_)
    for at in range(count):
        loop = owner[column[at]]
        K, F = (value[at], fixed[column[at]]) if along_k else (fixed[column[at]], value[at])
        through = 1 - K * D[loop, OFFSET] - F * D[loop, V]
        for i in range(n + integrates):
            own, driven = (E[loop, i], B[loop, i]) if i < n else (C[loop, ADVANCE], D[loop, ADVANCE])
            for j in range(n):
                A[at, i, j] = own[j] + driven * ((K * C[loop, OFFSET, j] + F * C[loop, V, j]) / through)
            if integrates:
                A[at, i, n] = driven * (K / through)
        if integrates and K == 0:
            A[at, n, n] = -1.0
        if not np.isfinite(A[at].sum()):
            A[at], known[at] = 0.0, False
    return A, known


@compiled
def _balanced_size(A):
    """Return the largest entry of a matrix in units that give rows and columns similar sizes, see `spectrum.balance`."""
    n, largest = len(A), 0.0
    for _ in range(BALANCING):
        for k in range(n):
            row = column = 0.0
            for j in range(n):
                if j != k:
                    row, column = row + abs(A[k, j]), column + abs(A[j, k])
            if not 0.5 <= row / column <= 2 and row > 0 and column > 0 and np.isfinite(row / column):  # or the factor is 1
                factor = 2.0 ** np.round(np.log2(row / column) / 2)
                for j in range(n):
                    A[j, k] *= factor
                    A[k, j] /= factor
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(A[i, j]))
    return largest


@compiled
def _alone(column, start, bounds, width, above):
    """Return whether the count of a column's first region cannot follow from that of other columns."""
    return np.isnan(above[column]) or bounds[1, start[column]] - bounds[0, start[column]] < NARROW * width


@compiled
def _asked(owner, state, start, bounds, width, above):
    """Return which columns have their first region counted: the first and last of each loop, and those that are `_alone`."""
    counted, last = np.zeros(len(owner), np.bool_), -1
    for column in range(len(owner)):
        if state[column] != OPEN:
            continue
        if _alone(column, start, bounds, width, above):
            counted[column] = True
            continue
        if last < 0 or owner[last] != owner[column]:
            counted[column] = True
            if last >= 0:
                counted[last] = True
        last = column
    if last >= 0:
        counted[last] = True
    return counted


@compiled
def _followed(owner, state, start, bounds, width, counted, seen, above, rise):
    """Return the unstable eigenvalues in the first region of each column, and the regions that are to be counted, in order.

    seen: counts of the columns that are counted, in order. Columns whose count is not known become LEFT.
    """
    columns = len(owner)
    begins, claimed, wanted, first = np.full(columns, -1), np.empty(len(rise), np.int64), 0, 0
    begins[counted] = seen
    while first < columns:
        after = first
        while after < columns and owner[after] == owner[first]:
            after += 1
        agreed = _agreed(first, after, start, bounds, width, counted, above, begins)
        for column in range(first, after):
            own = rise[start[column] : start[column + 1]]
            if state[column] == OPEN and not counted[column]:
                left = agreed - above[column]
                begins[column] = int(left) if left + own.min() >= 0 else -1
            if state[column] == OPEN and begins[column] < 0:
                state[column] = LEFT
            for i in range(1, len(own) if state[column] == OPEN else 0):
                region = start[column] + i
                narrow = bounds[1, region] - bounds[0, region] < NARROW * width
                if begins[column] + own[i] <= 0 and (counted[column] or narrow):
                    claimed[wanted] = region
                    wanted += 1
        first = after
    return begins, claimed[:wanted]


@compiled
def _agreed(first, after, start, bounds, width, counted, above, begins):
    """Return the count at infinite values if the first and the last column of a loop agree on it, NaN if they do not."""
    agreed, others = np.nan, False
    for column in range(first, after):
        if counted[column] and not _alone(column, start, bounds, width, above):
            grown = begins[column] + above[column] if begins[column] >= 0 else np.nan
            agreed = grown if not others or grown == agreed else np.nan
            others = True
    return agreed


@compiled
def _intervals(state, start, bounds, rise, begins):
    """Return stable intervals: column, index, count `(3, rows)`, and low, high, their angles and the residual `(5, rows)`.

    Columns with an end in doubt, or with a negative count of unstable eigenvalues, become LEFT.
    """
    columns, rows = len(state), 0
    whole, parts = np.empty((3, len(rise) + columns), np.int64), np.empty((5, len(rise) + columns))
    for column in range(columns):
        if state[column] == LEFT:
            continue
        before = rows
        for region in range(start[column], start[column + 1]):
            unstable, worst = begins[column] + rise[region], max(bounds[4, region], bounds[5, region])
            if unstable < 0 or (unstable == 0 and worst == np.inf):
                state[column], rows = LEFT, before
                break
            if unstable > 0:
                continue
            if region == start[column] or begins[column] + rise[region - 1] != 0:
                parts[:4, rows], parts[4, rows] = bounds[:4, region], worst
                whole[0, rows], whole[1, rows] = column, rows - before
                rows += 1
            else:
                parts[1, rows - 1], parts[3, rows - 1] = bounds[1, region], bounds[3, region]
                parts[4, rows - 1] = max(parts[4, rows - 1], worst)
        if state[column] != LEFT and rows == before:
            whole[0, rows], whole[1, rows], parts[:4, rows], parts[4, rows] = column, -1, np.nan, 0.0
            rows += 1
            whole[2, before] = 0
        elif rows > before:
            whole[2, before:rows] = rows - before
    return whole[:, :rows], parts[:, :rows]
