"""Stable intervals of columns and the places where nothing is known: from regions, joined, and as rows of a table."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from wavesweep.engine.doubts import Doubt
from wavesweep.engine.rows import Rows
from wavesweep.engine.stability.regions import Regions


@dataclass(frozen=True, slots=True)
class Intervals(Rows):
    """One element per stable interval and per open place, where nothing is known; one for a column that has neither.

    They are sorted by column, then value. column: index into the columns in C order, `slice * fixed.shape[-1] + position`.
    index: 0, 1, ... of the stable intervals of the column, -1 of other elements. count: stable intervals of the column. low,
    high: ends (N/m or N*s/m), NaN of a column with no other element. low_omega, high_omega: rad/s of the oscillation that
    starts there, NaN if the range ends the interval, or an open place begins there. doubt: reason why the column is not
    certified, NONE if it is (numbers of `doubts.Doubt`). residual: the largest relative residual of the
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
        """Whether all of each element's column is proved."""
        return self.doubt == Doubt.NONE


def intervals_of(r: Regions, doubt, period) -> Intervals:
    """Return runs of regions with no unstable eigenvalue, those that are not known, and an empty row for columns without any.

    doubt: `(columns,)`, codes. period: of each column's frame, s.
    """
    label, same = np.sign(r.unstable), np.diff(r.column) == 0
    alike = same & (label[1:] == label[:-1])
    first, last = (np.flatnonzero(edge & (label < 1)) for edge in (np.append(True, ~alike), np.append(~alike, True)))
    before = same & (np.minimum(label[1:], label[:-1]) < 0)  # what is next to an open place has no end there
    thetas = (r.low_theta, np.append(False, before), first), (r.high_theta, np.append(before, False), last)
    omega = [np.where(open_, np.nan, theta)[at] / period[r.column[at]] for theta, open_, at in thetas]
    stable, none = label[first] == 0, np.flatnonzero(np.bincount(r.column[first], minlength=period.size) == 0)
    error = np.where(stable, np.maximum(r.residual[first], r.residual[last]), 0.0)
    nothing, zero = np.full(none.size, np.nan), np.zeros(none.size, int)
    rows = r.column[first], stable - 1, 0 * first, r.low[first], r.high[last], *omega, doubt[r.column[first]], error
    empty = none, zero - 1, zero, nothing, nothing, nothing, nothing, doubt[none], 0.0 * zero
    located = Intervals(*map(np.concatenate, zip(rows, empty, strict=True)))
    return _numbered(located.take(np.argsort(located.column, kind="stable")))


def _numbered(rows: Intervals) -> Intervals:
    """The intervals with index and count of each column; sorted, an index of 0 or more stands for a stable one."""
    stable, column = rows.index >= 0, rows.column
    count = np.bincount(column[stable], minlength=int(column.max(initial=-1)) + 1)
    index = np.where(stable, np.cumsum(stable) - 1 - (np.cumsum(count) - count)[column], -1)
    return replace(rows, index=index, count=count[column])


def doubts_of(regions: Regions, doubt) -> np.ndarray:
    """Return the gravest doubt of each column, of the given one and those of its regions.

    A region without a label leaves at least COUNTS.
    """
    doubt = np.array(doubt)
    np.maximum.at(doubt, regions.column, np.where(regions.unstable < 0, np.maximum(regions.doubt, Doubt.COUNTS), regions.doubt))
    return doubt


def joined(intervals) -> Intervals:
    """Return the intervals of parts, the same columns in neighbouring ranges; the gravest doubt is that of a whole column."""
    merged = Intervals.join(intervals)
    merged = merged.take(np.lexsort((merged.low, merged.column)))  # NaN, of a range with nothing to say, goes last
    doubt = np.zeros(int(merged.column.max(initial=-1)) + 1, int)
    np.maximum.at(doubt, merged.column, merged.doubt)
    first = np.append(True, np.diff(merged.column) != 0)[: merged.column.size]
    merged = merged.take(first | ~np.isnan(merged.low))
    return _numbered(replace(merged, doubt=doubt[merged.column]))


def _touching(rows: Intervals) -> np.ndarray:
    """Which elements the next one begins at, without a crossing between."""
    seam = (rows.high[:-1] == rows.low[1:]) & (rows.column[:-1] == rows.column[1:])
    return seam & np.isnan(rows.high_omega[:-1]) & np.isnan(rows.low_omega[1:])


def without_seams(rows: Intervals) -> Intervals:
    """Return intervals in which those are one that meet at an end where nothing crosses, and open places likewise."""
    stable = rows.index >= 0
    seam = _touching(rows) & (stable[:-1] == stable[1:])
    first, last = np.flatnonzero(np.append(True, ~seam)), np.flatnonzero(np.append(~seam, True))
    if first.size == rows.column.size or not first.size:
        return rows
    ends = {name: getattr(rows, name)[last] for name in ("high", "high_omega")}
    return _numbered(replace(rows.take(first), **ends, residual=np.maximum.reduceat(rows.residual, first)))


@dataclass(frozen=True, slots=True)
class OpenPlaces:
    """Of each row of a table, the places where nothing is known: how many, where the first begins, where the last ends."""

    places: np.ndarray
    low: np.ndarray
    high: np.ndarray


def in_rows(intervals: Intervals) -> tuple[Intervals, OpenPlaces]:
    """Return the intervals as rows, and the open places of each: what only these keep apart is one interval in doubt.

    It goes from its first to its last place that is known to be stable, and has no residual if one of these is not its end. An
    open place between unstable values belongs to the interval below, or else above, or to the empty row of its column.
    """
    at, column, stable = np.arange(intervals.column.size), intervals.column, intervals.index >= 0
    open_ = ~stable & ~np.isnan(intervals.low)
    if not open_.any():
        return intervals, OpenPlaces(0 * at, *np.full((2, at.size), np.nan))
    linked = _touching(intervals) & (open_[:-1] | open_[1:])
    chain = np.append(0, np.cumsum(~linked))
    begin = np.flatnonzero(np.diff(chain, prepend=-1))
    is_stable, of, number = np.logical_or.reduceat(stable, begin), column[begin], np.arange(begin.size)
    below = np.maximum.accumulate(np.where(is_stable, number, 0))
    above = np.minimum.accumulate(np.where(is_stable, number, number.size - 1)[::-1])[::-1]
    owner = np.searchsorted(of, of)
    for neighbour in (above, below):
        owner = np.where(is_stable[neighbour] & (of[neighbour] == of), neighbour, owner)
    begin = np.flatnonzero(np.diff(owner[chain], prepend=-1))
    last = np.maximum.reduceat(np.where(stable, at, -1), begin)
    has_stable = last >= 0
    first = np.where(has_stable, np.minimum.reduceat(np.where(stable, at, at.size), begin), begin)
    last = np.where(has_stable, last, begin)
    ended = ~(np.append(False, linked)[first] | np.append(linked, False)[last]) | ~has_stable
    rows = replace(intervals.take(first), high=intervals.high[last], high_omega=intervals.high_omega[last])
    low, high = (np.where(has_stable, end, np.nan) for end in (rows.low, rows.high))
    rows = replace(rows, low=low, high=high, residual=np.where(ended, np.maximum.reduceat(intervals.residual, begin), np.nan))
    places = np.add.reduceat(open_ & ~np.append(False, linked & open_[:-1]), begin)
    low, high = (np.where(open_, end, np.nan) for end in (intervals.low, intervals.high))
    return _numbered(rows), OpenPlaces(places, np.fmin.reduceat(low, begin), np.fmax.reduceat(high, begin))


def without_any(intervals: Intervals, columns, span=None, doubt: int = Doubt.NONE) -> Intervals:
    """Return the intervals with none in some columns, a mask; doubt: the reason why nothing is known of their whole span."""
    index = columns[intervals.column]
    if not index.any():
        return intervals
    empty = intervals.take(index)
    empty = empty.take(np.unique(empty.column, return_index=True)[1])
    size = empty.column.size
    ends = (np.full(size, float(end)) for end in ((np.nan, np.nan) if doubt == Doubt.NONE else span))
    nothing = dict(zip(("low", "high"), ends, strict=True)) | dict.fromkeys(("low_omega", "high_omega"), np.full(size, np.nan))
    none = {"index": np.full(size, -1), "count": np.zeros(size, int), "residual": np.zeros(size)}
    reasons = np.full(size, Doubt.NONE) if doubt == Doubt.NONE else np.maximum(empty.doubt, doubt)
    remaining = Intervals.join([intervals.take(~index), replace(empty, **nothing, **none, doubt=reasons)])
    return remaining.take(np.argsort(remaining.column, kind="stable"))


def by_slice(batches: Sequence[Intervals]) -> Intervals:
    """Intervals of several batches in one, sorted by slice."""
    joined = Intervals.join(batches)
    return joined.take(np.argsort(joined.column, kind="stable"))


def in_place(intervals: Intervals, columns: np.ndarray, others: Intervals) -> Intervals:
    """Intervals with others in place of those of some columns, which `others` numbers from 0."""
    rest = intervals.take(~np.isin(intervals.column, columns))
    return by_slice([rest, replace(others, column=columns[others.column])])


def common(loops: Sequence[Intervals]) -> Intervals:
    """Return the intervals in which all of several loops are stable, for every column.

    loops: of each, the same columns. A doubt of one is one of the column, unless the others are never stable together.
    """
    of_loops, rows = [_by_column(intervals) for intervals in loops], []
    for column in of_loops[0]:
        pieces, doubt = _common_in_column([columns[column] for columns in of_loops])
        stable = [piece.stable for piece in pieces]
        for place, piece in enumerate(pieces or [_Piece(np.nan, np.nan, np.nan, np.nan, 0.0, False)]):
            index = sum(stable[:place]) if piece.stable else -1
            rows.append((column, index, sum(stable), *piece[:4], doubt, piece.residual))
    facts = zip(*rows, strict=True) if rows else [()] * len(fields(Intervals))
    named = zip(fields(Intervals), facts, strict=True)
    return Intervals(*(np.array(values, getattr(loops[0], field.name).dtype) for field, values in named))


class _Piece(NamedTuple):
    """A stable interval, or an open place, of one column."""

    low: float
    high: float
    low_omega: float
    high_omega: float
    residual: float
    stable: bool


def _by_column(intervals):
    """Column -> its pieces, and its doubt."""
    columns = {}
    for place in range(intervals.column.size):
        pieces, _ = columns.setdefault(int(intervals.column[place]), ([], int(intervals.doubt[place])))
        if not np.isnan(intervals.low[place]):
            ends = (float(getattr(intervals, name)[place]) for name in _Piece._fields[:5])
            pieces.append(_Piece(*ends, bool(intervals.index[place] >= 0)))
    return dict(sorted(columns.items()))


def _common_in_column(loops):
    """What the loops of a column have in common, and the doubt of that; loops: pieces and doubt of each."""
    certain = [pieces for pieces, doubt in loops if doubt == Doubt.NONE]
    shared = _of_all(certain)
    if len(certain) == len(loops) or (certain and not shared):
        return shared, Doubt.NONE
    return _of_all([pieces for pieces, _ in loops]), max(doubt for _, doubt in loops)


def _of_all(loops):
    """What several lists of pieces have in common, in order."""
    shared = loops[0] if loops else []
    for pieces in loops[1:]:
        shared = [both for first in shared for second in pieces if (both := _overlap(first, second)) is not None]
    return shared


def _overlap(first, second):
    """The values that two pieces have in common, each end with its frequency, open if one is; None if there are none."""
    begins = max(first, second, key=lambda piece: piece.low)
    ends = min(first, second, key=lambda piece: piece.high)
    if begins.low >= ends.high:
        return None
    stable = first.stable and second.stable
    omegas = (begins.low_omega, ends.high_omega) if stable else (np.nan, np.nan)
    return _Piece(begins.low, ends.high, *omegas, max(first.residual, second.residual) * stable, stable)
