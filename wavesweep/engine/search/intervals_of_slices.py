"""Intervals of slices put together: from batches, in place of others, and where several loops are stable at once."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wavesweep.engine.stability.certificate import NONE
from wavesweep.engine.stability.intervals import Intervals


def by_slice(batches: Sequence[Intervals]) -> Intervals:
    """Intervals of several batches in one, sorted by slice."""
    joined = Intervals.join(batches)
    return joined.take(np.argsort(joined.column, kind="stable"))


def in_place(intervals: Intervals, columns: np.ndarray, others: Intervals) -> Intervals:
    """Intervals with others in place of those of some columns, which `others` numbers from 0."""
    beside = intervals.take(~np.isin(intervals.column, columns))
    return by_slice([beside, replace(others, column=columns[others.column])])


def common(loops: Sequence[Intervals]) -> Intervals:
    """Return the intervals in which all of several loops are stable, for every column.

    loops: of each, the same columns. A doubt of one is one of the column, unless the others are never stable together.
    """
    of_loops = [_by_column(intervals) for intervals in loops]
    rows = {name: [] for name in ("column", "index", "count", "low", "high", "low_omega", "high_omega", "doubt", "residual")}
    for column in of_loops[0]:
        elements = [columns[column] for columns in of_loops]
        certain = [intervals for intervals, doubt in elements if doubt == NONE]
        shared, doubt = _of_all(certain), NONE
        if len(certain) < len(elements) and not (certain and not shared):
            shared, doubt = _of_all([intervals for intervals, _ in elements]), max(doubt for _, doubt in elements)
        stable = [is_stable for *_, is_stable in shared]
        for place, (*ends, residual, is_stable) in enumerate(shared or [(np.nan, np.nan, np.nan, np.nan, 0.0, False)]):
            index = sum(stable[:place]) if is_stable else -1
            for name, value in zip(rows, (column, index, sum(stable), *ends, doubt, residual), strict=True):
                rows[name].append(value)
    kinds = {name: getattr(loops[0], name).dtype for name in rows}
    return Intervals(**{name: np.array(values, kinds[name]) for name, values in rows.items()})


def _by_column(intervals):
    """Column -> its elements as (low, high, low_omega, high_omega, residual, known to be stable), and its doubt."""
    columns = {}
    for place in range(intervals.column.size):
        elements, _ = columns.setdefault(int(intervals.column[place]), ([], int(intervals.doubt[place])))
        if not np.isnan(intervals.low[place]):
            ends = (float(getattr(intervals, name)[place]) for name in ("low", "high", "low_omega", "high_omega", "residual"))
            elements.append((*ends, bool(intervals.index[place] >= 0)))
    return dict(sorted(columns.items()))


def _of_all(loops):
    """What several lists have in common, in order."""
    shared = loops[0] if loops else []
    for others in loops[1:]:
        shared = [both for first in shared for second in others if (both := _overlap(first, second)) is not None]
    return shared


def _overlap(first, second):
    """The values that two elements have in common, each end with its frequency, open if one is; None if there are none."""
    begins = max(first, second, key=lambda element: element[0])
    ends = min(first, second, key=lambda element: element[1])
    if begins[0] >= ends[1]:
        return None
    stable = first[5] and second[5]
    omegas = (begins[2], ends[3]) if stable else (np.nan, np.nan)
    return begins[0], ends[1], *omegas, max(first[4], second[4]) * stable, stable
