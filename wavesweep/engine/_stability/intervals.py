"""Stable intervals of columns and the places where nothing is known: from regions, joined, and
as rows of a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from wavesweep.engine._stability.regions import Regions
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.rows import Rows


@dataclass(frozen=True, slots=True)
class Intervals(Rows):
    """One element per stable interval and per open place, where nothing is known; one for a column
    that has neither.

    They are sorted by column, then value. column: index into the columns in C order, `slice *
    fixed.shape[-1] + position`. index: 0, 1, ... of the stable intervals of the column, -1 of other
    elements. count: stable intervals of the column. low, high: ends (N/m or N*s/m), NaN of a column
    with no other element. low_omega, high_omega: rad/s of the oscillation that starts there, NaN if
    the range ends the interval, or an open place begins there. doubt: reason why the column is not
    certified, NONE if it is (numbers of `doubts.Doubt`). residual: the largest relative residual of
    the characteristic equation at crossings of the interval, 0 if there are none. low_cause,
    high_cause: what sets an end, 0 for a mode or nothing, n for the n-th bound on a gain. argument: of
    the column, by what bounds no crossing of it can be missed: ENCLOSED, enclosures alone; of others
    some hold to FIRST_ORDER in a rounding, or are SAMPLED with a margin; 0 if nothing is said.
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
    low_cause: np.ndarray
    high_cause: np.ndarray
    argument: np.ndarray
    ENCLOSED: ClassVar[int] = 1
    FIRST_ORDER: ClassVar[int] = 2
    SAMPLED: ClassVar[int] = 3

    @property
    def certified(self) -> np.ndarray:
        """Whether all of each element's column is proved."""
        return self.doubt == Doubt.NONE


def intervals_of(
    r: Regions, doubt: np.ndarray, period: np.ndarray, argument: np.ndarray
) -> Intervals:
    """Return runs of regions with no unstable eigenvalue, those that are not known, and an empty
    row for columns without any.

    doubt, argument: `(columns,)`, codes. period: of each column's frame, s.
    """
    label = np.sign(r.unstable)
    same = np.diff(r.column) == 0
    alike = same & (label[1:] == label[:-1])
    first = np.flatnonzero(np.append(True, ~alike) & (label < 1))
    last = np.flatnonzero(np.append(~alike, True) & (label < 1))
    column = r.column[first]
    unknown = same & (
        np.minimum(label[1:], label[:-1]) < 0
    )  # what is next to an open place has no end there
    low_theta = np.where(np.append(False, unknown), np.nan, r.low_theta)
    high_theta = np.where(np.append(unknown, False), np.nan, r.high_theta)
    stable = label[first] == 0
    rows = Intervals(
        column=column,
        index=stable - 1,
        count=0 * first,
        low=r.low[first],
        high=r.high[last],
        low_omega=low_theta[first] / period[column],
        high_omega=high_theta[last] / period[column],
        doubt=doubt[column],
        residual=np.where(stable, np.maximum(r.residual[first], r.residual[last]), 0.0),
        low_cause=0 * first,
        high_cause=0 * first,
        argument=argument[column],
    )
    none = np.flatnonzero(np.bincount(column, minlength=period.size) == 0)
    located = Intervals.join([rows, _empty(none, doubt[none], argument[none])])
    return _numbered(located.take(np.argsort(located.column, kind="stable")))


def _empty(
    column: np.ndarray,
    doubt: np.ndarray,
    argument: np.ndarray,
    span: tuple[float, float] = (np.nan, np.nan),
) -> Intervals:
    """Rows of columns that have no stable interval; span: of which nothing is known."""
    size = column.size
    nothing = np.full(size, np.nan)
    return Intervals(
        column=column,
        index=np.full(size, -1),
        count=np.zeros(size, int),
        low=np.full(size, float(span[0])),
        high=np.full(size, float(span[1])),
        low_omega=nothing,
        high_omega=nothing,
        doubt=doubt,
        residual=np.zeros(size),
        low_cause=np.zeros(size, int),
        high_cause=np.zeros(size, int),
        argument=argument,
    )


def _numbered(rows: Intervals) -> Intervals:
    """The intervals with index and count of each column; sorted, an index of 0 or more stands
    for a stable one."""
    stable = rows.index >= 0
    column = rows.column
    count = np.bincount(column[stable], minlength=int(column.max(initial=-1)) + 1)
    before = np.cumsum(count) - count
    index = np.where(stable, np.cumsum(stable) - 1 - before[column], -1)
    return replace(rows, index=index, count=count[column])


def doubts_of(regions: Regions, doubt: np.ndarray) -> np.ndarray:
    """Return the gravest doubt of each column, of the given one and those of its regions.

    A region without a label leaves at least COUNTS.
    """
    doubt = np.array(doubt)
    at_least = np.where(regions.unstable < 0, Doubt.COUNTS, Doubt.NONE)
    np.maximum.at(doubt, regions.column, np.maximum(regions.doubt, at_least))
    return doubt


def joined(intervals: Sequence[Intervals]) -> Intervals:
    """Return the intervals of parts, the same columns in neighbouring ranges; the gravest doubt
    is that of a whole column."""
    merged = Intervals.join(intervals)
    merged = merged.take(
        np.lexsort((merged.low, merged.column))
    )  # NaN, of a range with nothing to say, goes last
    doubt, argument = np.zeros((2, int(merged.column.max(initial=-1)) + 1), int)
    np.maximum.at(doubt, merged.column, merged.doubt)
    np.maximum.at(argument, merged.column, merged.argument)
    first = np.append(True, np.diff(merged.column) != 0)[: merged.column.size]
    merged = merged.take(first | ~np.isnan(merged.low))
    column = merged.column
    return _numbered(replace(merged, doubt=doubt[column], argument=argument[column]))


def _touching(rows: Intervals) -> np.ndarray:
    """Which elements the next one begins at, without a crossing between."""
    seam = (rows.high[:-1] == rows.low[1:]) & (rows.column[:-1] == rows.column[1:])
    return seam & np.isnan(rows.high_omega[:-1]) & np.isnan(rows.low_omega[1:])


def without_seams(rows: Intervals) -> Intervals:
    """Return intervals in which those are one that meet at an end where nothing crosses, and
    open places likewise."""
    stable = rows.index >= 0
    seam = _touching(rows) & (stable[:-1] == stable[1:])
    first = np.flatnonzero(np.append(True, ~seam))
    last = np.flatnonzero(np.append(~seam, True))
    if first.size == rows.column.size or not first.size:
        return rows
    whole = replace(
        rows.take(first),
        high=rows.high[last],
        high_omega=rows.high_omega[last],
        high_cause=rows.high_cause[last],
        residual=np.maximum.reduceat(rows.residual, first),
    )
    return _numbered(whole)


@dataclass(frozen=True, slots=True)
class OpenPlaces:
    """Of each row of a table, the places where nothing is known: how many, where the first
    begins, where the last ends."""

    places: np.ndarray
    low: np.ndarray
    high: np.ndarray


def _owners(column: np.ndarray, is_stable: np.ndarray) -> np.ndarray:
    """Return the chain to which each chain of places belongs, by number: to itself if it is stable,
    else to the stable one below or above in its column, else to the first of the column."""
    number = np.arange(column.size)
    below = np.maximum.accumulate(np.where(is_stable, number, 0))
    above = np.minimum.accumulate(np.where(is_stable, number, number.size - 1)[::-1])[::-1]
    owner = np.searchsorted(column, column)
    for neighbour in (above, below):
        is_near = is_stable[neighbour] & (column[neighbour] == column)
        owner = np.where(is_near, neighbour, owner)
    return owner


def in_rows(intervals: Intervals) -> tuple[Intervals, OpenPlaces]:
    """Return the intervals as rows, and the open places of each: what only these keep apart is one
    interval in doubt.

    It goes from its first to its last place that is known to be stable, and has no residual if one
    of these is not its end. An open place between unstable values belongs to the interval below, or
    else above, or to the empty row of its column.
    """
    index = np.arange(intervals.column.size)
    stable = intervals.index >= 0
    open_ = ~stable & ~np.isnan(intervals.low)
    if not open_.any():
        return intervals, OpenPlaces(0 * index, *np.full((2, index.size), np.nan))
    linked = _touching(intervals) & (open_[:-1] | open_[1:])
    chain = np.append(0, np.cumsum(~linked))
    begin = np.flatnonzero(np.diff(chain, prepend=-1))
    is_stable = np.logical_or.reduceat(stable, begin)
    owner = _owners(intervals.column[begin], is_stable)
    begin = np.flatnonzero(np.diff(owner[chain], prepend=-1))
    last = np.maximum.reduceat(np.where(stable, index, -1), begin)
    has_stable = last >= 0
    first = np.minimum.reduceat(np.where(stable, index, index.size), begin)
    first = np.where(has_stable, first, begin)
    last = np.where(has_stable, last, begin)
    ended = ~(np.append(False, linked)[first] | np.append(linked, False)[last]) | ~has_stable
    rows = replace(
        intervals.take(first),
        low=np.where(has_stable, intervals.low[first], np.nan),
        high=np.where(has_stable, intervals.high[last], np.nan),
        high_omega=intervals.high_omega[last],
        high_cause=intervals.high_cause[last],
        residual=np.where(ended, np.maximum.reduceat(intervals.residual, begin), np.nan),
    )
    places = np.add.reduceat(open_ & ~np.append(False, linked & open_[:-1]), begin)
    open_low = np.where(open_, intervals.low, np.nan)
    open_high = np.where(open_, intervals.high, np.nan)
    return _numbered(rows), OpenPlaces(
        places, np.fmin.reduceat(open_low, begin), np.fmax.reduceat(open_high, begin)
    )


def without_any(
    intervals: Intervals,
    columns: np.ndarray,
    span: tuple[float, float] = (np.nan, np.nan),
    doubt: int = Doubt.NONE,
) -> Intervals:
    """Return the intervals with none in some columns, a mask; doubt: the reason why nothing is
    known of their whole span."""
    index = columns[intervals.column]
    if not index.any():
        return intervals
    empty = intervals.take(index)
    empty = empty.take(np.unique(empty.column, return_index=True)[1])
    if doubt == Doubt.NONE:
        without = _empty(empty.column, np.full(empty.column.size, Doubt.NONE), empty.argument)
    else:
        without = _empty(empty.column, np.maximum(empty.doubt, doubt), empty.argument, span)
    remaining = Intervals.join([intervals.take(~index), without])
    return remaining.take(np.argsort(remaining.column, kind="stable"))


def by_slice(batches: Sequence[Intervals]) -> Intervals:
    """Intervals of several batches in one, sorted by slice."""
    joined = Intervals.join(batches)
    return joined.take(np.argsort(joined.column, kind="stable"))


def in_place(intervals: Intervals, columns: np.ndarray, replacements: Intervals) -> Intervals:
    """Intervals with others in place of those of some columns, which `replacements` numbers from 0."""
    unchanged = intervals.take(~np.isin(intervals.column, columns))
    return by_slice([unchanged, replace(replacements, column=columns[replacements.column])])


def common(loops: Sequence[Intervals]) -> Intervals:
    """Return the intervals in which all of several loops are stable, for every column.

    loops: of each, the same columns. A doubt of one is one of the column, unless the others are
    never stable together.
    """
    of_loops = [_by_column(intervals) for intervals in loops]
    arguments = np.concatenate([intervals.argument for intervals in loops])
    owners = np.concatenate([intervals.column for intervals in loops])
    rows = []
    for column in of_loops[0]:
        pieces, doubt = _common_in_column([columns[column] for columns in of_loops])
        count = sum(piece.stable for piece in pieces)
        argument = arguments[owners == column].max()
        before = 0
        for piece in pieces or [_Piece(np.nan, np.nan, np.nan, np.nan, 0, 0, 0.0, False)]:
            index = before if piece.stable else -1
            before += piece.stable
            facts_of_piece = piece.residual, piece.low_cause, piece.high_cause, argument
            rows.append((column, index, count, *piece[:4], doubt, *facts_of_piece))
    facts = zip(*rows, strict=True) if rows else [()] * len(fields(Intervals))
    named = zip(fields(Intervals), facts, strict=True)
    return Intervals(
        *(np.array(values, getattr(loops[0], field.name).dtype) for field, values in named)
    )


class _Piece(NamedTuple):
    """A stable interval, or an open place, of one column."""

    low: float
    high: float
    low_omega: float
    high_omega: float
    low_cause: int
    high_cause: int
    residual: float
    stable: bool


def _by_column(intervals: Intervals) -> dict[int, tuple[list[Any], int]]:
    """Column -> its pieces, and its doubt."""
    columns: dict[int, tuple[list[_Piece], int]] = {}
    for place in range(intervals.column.size):
        pieces, _ = columns.setdefault(
            int(intervals.column[place]), ([], int(intervals.doubt[place]))
        )
        if not np.isnan(intervals.low[place]):
            ends = (getattr(intervals, name)[place].item() for name in _Piece._fields[:7])
            pieces.append(_Piece._make([*ends, bool(intervals.index[place] >= 0)]))
    return dict(sorted(columns.items()))


def _common_in_column(loops: list[tuple[list[Any], int]]) -> tuple[list[_Piece], int]:
    """What the loops of a column have in common, and the doubt of that; loops: pieces and doubt
    of each."""
    certain = [pieces for pieces, doubt in loops if doubt == Doubt.NONE]
    shared = _of_all(certain)
    if len(certain) == len(loops) or (certain and not shared):
        return shared, Doubt.NONE
    return _of_all([pieces for pieces, _ in loops]), max(doubt for _, doubt in loops)


def _of_all(loops: list[list[_Piece]]) -> list[_Piece]:
    """What several lists of pieces have in common, in order."""
    shared = loops[0] if loops else []
    for pieces in loops[1:]:
        overlaps = [_overlap(first, second) for first in shared for second in pieces]
        shared = [both for both in overlaps if both is not None]
    return shared


def _overlap(first: _Piece, second: _Piece) -> _Piece | None:
    """The values that two pieces have in common, each end with its frequency, open if one is;
    None if there are none."""
    begins = max(first, second, key=lambda piece: piece.low)
    ends = min(first, second, key=lambda piece: piece.high)
    if begins.low >= ends.high:
        return None
    stable = first.stable and second.stable
    omegas = (begins.low_omega, ends.high_omega) if stable else (np.nan, np.nan)
    causes = (begins.low_cause, ends.high_cause) if stable else (0, 0)
    return _Piece(
        begins.low,
        ends.high,
        *omegas,
        *causes,
        max(first.residual, second.residual) * stable,
        stable,
    )
