"""Stable intervals of columns: as rows, from regions, joined, and without some."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.columns import Rows
from wavesweep.stability.certificate import COUNTS, NONE
from wavesweep.stability.regions import Regions


@dataclass(frozen=True, slots=True)
class Intervals(Rows):
    """One element per stable interval, or one with index -1 for a column that has none; sorted by column, then value.

    column: index into the columns in C order, `slice * fixed.shape[-1] + position`. index: 0, 1, ... within the column. count:
    stable intervals of the column. low, high: ends (N/m or N*s/m), NaN without interval. low_omega, high_omega: rad/s of the
    oscillation that starts there, NaN if the range, or the known part of it, ends the interval. doubt: reason why the column is
    not certified, NONE if it is (codes of `wavesweep.stability.certificate`). residual: the largest relative residual of the
    characteristic equation at crossings of the interval, 0 if there are none.
    """

    column: np.ndarray
    index: np.ndarray
    count: np.ndarray
    low: np.ndarray
    high: np.ndarray
    low_omega: np.ndarray
    high_omega: np.ndarray
    doubt: np.ndarray
    residual: np.ndarray

    @property
    def certified(self) -> np.ndarray:
        """Whether each element's column is proved as a whole."""
        return self.doubt == NONE


def intervals_of(r: Regions, doubt, period) -> Intervals:
    """Return runs of regions with no unstable eigenvalue, and an empty row for columns without any.

    doubt: `(columns,)`, codes. period: of each column's frame, s.
    """
    stable = r.unstable == 0
    same = np.append(np.diff(r.column) == 0, False)  # the next region is in the same column
    begins = stable & ~np.append(False, (same & stable)[:-1])
    ends = stable & ~(same & np.append(stable[1:], False))
    first, last = np.flatnonzero(begins), np.flatnonzero(ends)
    count = np.bincount(r.column[first], minlength=period.size)
    none = np.flatnonzero(count == 0)
    column = np.concatenate([r.column[first], none])
    order = np.argsort(column, kind="stable")
    empty = np.full(none.size, np.nan)
    omega = [theta / period[r.column[at]] for theta, at in ((r.low_theta[first], first), (r.high_theta[last], last))]
    start = np.concatenate([[0], np.cumsum(np.maximum(count, 1))[:-1]])
    column = column[order]
    error = np.concatenate([np.maximum(r.residual[first], r.residual[last]), np.zeros(none.size)])[order]
    return Intervals(
        column,
        np.where(count[column] > 0, np.arange(column.size) - start[column], -1),
        count[column],
        *(np.concatenate([part, empty])[order] for part in (r.low[first], r.high[last], *omega)),
        doubt[column],
        error,
    )


def doubts_of(parts: Regions, doubt) -> np.ndarray:
    """Return the gravest doubt of each column: its own, and those of its regions.

    A region without a label leaves at least COUNTS.
    """
    doubt = np.array(doubt)
    np.maximum.at(doubt, parts.column, np.where(parts.unstable < 0, np.maximum(parts.doubt, COUNTS), parts.doubt))
    return doubt


def joined(parts) -> Intervals:
    """Return the intervals of parts, the same columns in neighbouring ranges; the gravest doubt is that of a whole column."""
    whole = Intervals.join(parts)
    whole = whole.take(np.lexsort((whole.low, whole.column)))  # NaN, of a range without an interval, goes last
    stable, size = whole.index >= 0, int(whole.column.max(initial=-1)) + 1
    count, doubt = np.bincount(whole.column[stable], minlength=size), np.zeros(size, int)
    np.maximum.at(doubt, whole.column, whole.doubt)
    first = np.append(True, np.diff(whole.column) != 0)[: whole.column.size]
    whole = whole.take(stable | (first & (count[whole.column] == 0)))
    column = whole.column
    index = np.arange(column.size) - np.searchsorted(column, column)
    return replace(whole, index=np.where(count[column] > 0, index, -1), count=count[column], doubt=doubt[column])


def without_seams(found: Intervals) -> Intervals:
    """Return intervals in which those are one that meet at an end where nothing crosses."""
    seam = (found.high[:-1] == found.low[1:]) & (found.column[:-1] == found.column[1:])
    seam &= np.isnan(found.high_omega[:-1]) & np.isnan(found.low_omega[1:])
    first, last = np.flatnonzero(np.append(True, ~seam)), np.flatnonzero(np.append(~seam, True))
    if first.size == found.column.size or not first.size:
        return found
    ends = {name: getattr(found, name)[last] for name in ("high", "high_omega")}
    column, stable = found.column[first], found.index[first] >= 0
    index = np.where(stable, np.arange(column.size) - np.searchsorted(column, column), -1)
    count, size = np.bincount(column[stable], minlength=column.max() + 1), np.maximum.reduceat(found.residual, first)
    return replace(found.take(first), **ends, index=index, count=count[column], residual=size)


def without_any(found: Intervals, columns, doubt: int = NONE) -> Intervals:
    """Return the intervals with none in some columns, a mask; doubt: the reason why nothing is known of them, if it is not."""
    some = columns[found.column]
    if not some.any():
        return found
    empty = found.take(some)
    empty = empty.take(np.unique(empty.column, return_index=True)[1])
    size = empty.column.size
    nothing = dict.fromkeys(("low", "high", "low_omega", "high_omega"), np.full(size, np.nan))
    none = {"index": np.full(size, -1), "count": np.zeros(size, int), "residual": np.zeros(size)}
    reasons = np.full(size, NONE) if doubt == NONE else np.maximum(empty.doubt, doubt)
    whole = Intervals.join([found.take(~some), replace(empty, **nothing, **none, doubt=reasons)])
    return whole.take(np.argsort(whole.column, kind="stable"))
