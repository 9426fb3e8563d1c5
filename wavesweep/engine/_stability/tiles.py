"""What is known of the spans of columns, in parts: how many eigenvalues are outside the unit circle,
or that some cross it there; what ball arithmetic adds, and the regions that follow."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesweep.engine._stability.regions import Regions
from wavesweep.engine.doubles import FEW_ROUNDINGS
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.rows import Rows, different

UNKNOWN, WINDOW, OVERLAID = -1, -2, -3  # in place of the number of eigenvalues outside, see `Tiles`


@dataclass(frozen=True, slots=True)
class Tiles(Rows):
    """Parts of the spans of columns.

    outside: number of eigenvalues outside the unit circle, or at least so many; UNKNOWN; WINDOW if
    some cross there, or OVERLAID if another one is outside meanwhile. value, theta, miss, doubt: of
    a window: the crossing; the eigenvalue's angle there; to what its distance from the circle is
    known, relative to what that changes by with the parameter if this is more; Doubt.ROUNDING if
    the window is wider than ends may be off.
    """

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    outside: np.ndarray
    value: np.ndarray
    theta: np.ndarray
    miss: np.ndarray
    doubt: np.ndarray

    @property
    def is_counted(self) -> np.ndarray:
        """Whether the number of eigenvalues outside is known."""
        return self.outside >= 0

    @property
    def is_window(self) -> np.ndarray:
        """Whether eigenvalues cross there: WINDOW or OVERLAID."""
        return self.outside <= WINDOW

    @classmethod
    def of(
        cls,
        column: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
        outside: np.ndarray | int,
        doubt: int = Doubt.NONE,
    ) -> Tiles:
        nothing = np.full(column.size, np.nan)
        return cls(
            column, low, high, outside + 0 * column, nothing, nothing, 0 * low, doubt + 0 * column
        )


def _between_ends(tiles: Tiles, span: tuple[float, float], columns: int) -> Tiles:
    """The tiles in order, column by column, each with a tile at the low and one at the high end."""
    low_ends, high_ends = (
        Tiles.of(np.arange(columns), np.full(columns, end), np.full(columns, end), 1)
        for end in map(float, span)
    )
    tiles = tiles.take(np.lexsort((tiles.low, tiles.column)))
    joined = Tiles.join([low_ends, tiles, high_ends])
    return joined.take(np.argsort(joined.column, kind="stable"))


def _tried_by_balls(
    tiles: Tiles, outer: np.ndarray, attached: tuple[float, float]
) -> Iterator[tuple[int, int, int]]:
    """Yield the column of each stretch in doubt, and the tiles before and after it; if a column has
    more than eight, all of them together."""
    pairs = _in_doubt(tiles, outer, attached)
    of_pairs = tiles.column[pairs[:, 0]]
    for column in different(of_pairs).tolist():
        of_column = pairs[of_pairs == column]
        if len(of_column) > 8:
            of_column = np.array([[of_column[0, 0], of_column[-1, 1]]])
        for before, after in of_column.tolist():
            yield column, before, after


def proved_by_balls(
    tiles: Tiles,
    lost: tuple[np.ndarray, ...],
    span: tuple[float, float],
    columns: int,
    attached: tuple[float, float],
    balls: Callable[..., Any],
) -> tuple[Tiles, tuple[np.ndarray, ...]]:
    """Return the tiles, and the parts without panels, with stretches in doubt replaced by what is
    proved of these.

    balls(column, low, high): the stable intervals from low to high as (low, high, low_theta,
    high_theta), None if they stay in doubt; see `Tiles` for theta. lost, attached: see
    `regions_of`.
    """
    joined = _between_ends(tiles, span, columns)
    outer = np.isin(joined.low, span) & (joined.low == joined.high)
    remains = np.ones(joined.column.size, bool)
    new = []
    for column, before, after in _tried_by_balls(joined, outer, attached):
        a = float(joined.high[before])
        b = float(joined.low[after])
        intervals = balls(column, a, b)
        if intervals is None:
            continue
        begins = bool(intervals) and intervals[0][0] == a
        stops = bool(intervals) and intervals[-1][1] == b
        # What contradicts a neighbour, stable or not, is not taken for proved.
        if not outer[before] and (joined.outside[before] == 0) != begins:
            continue
        if not outer[after] and (joined.outside[after] == 0) != stops:
            continue
        remains[before + 1 : after] = False
        if a < b:  # else windows lie between two unstable stretches that meet
            new.append(_tiles_of_intervals(column, a, b, intervals))
        elsewhere = (lost[0] != column) | (lost[2] <= a) | (lost[1] >= b)
        lost = tuple(fact[elsewhere] for fact in lost)
    return Tiles.join([joined.take(remains & ~outer), *new]), lost


def _in_doubt(joined: Tiles, outer: np.ndarray, attached: tuple[float, float]) -> np.ndarray:
    """Pairs of neighbouring tiles whose number outside is known, between which something is in
    doubt, `(pairs, 2)`.

    joined: tiles by column and place, with one of no width at each end of the span, outer.
    """
    sure = np.flatnonzero(joined.is_counted)
    first = sure[:-1]
    last = sure[1:]
    # 0 stable, 1 not
    label_before = np.minimum(joined.outside[first], 1)
    label_after = np.minimum(joined.outside[last], 1)
    window = joined.is_window
    plain = joined.outside == WINDOW
    rough = joined.doubt != Doubt.NONE

    def between(size: np.ndarray) -> np.ndarray:
        """The sum over the windows between each two neighbours of `sure`."""
        total = np.append(0.0, np.cumsum(np.where(window, size, 0.0)))
        return total[last] - total[first + 1]

    low = joined.high[first]
    high = joined.low[last]
    at_end = outer[first] | outer[last]
    attached_there = np.where(outer[first], *attached) * at_end  # at the low end, or the high one
    slack = FEW_ROUNDINGS * np.abs(high) + attached_there
    uncovered = high - low - between(joined.high - joined.low)
    open_ = uncovered > slack
    doubtful = open_ | (between(plain & rough) > 0)
    one_stable = label_before * label_after == 0
    doubtful |= one_stable & (between(rough) > 0)
    same = label_before == label_after
    crossings = last - first > 1
    returning = same & crossings & ((label_before == 0) | (between(plain) > 0))
    without_crossing = ~crossings & ~same
    doubtful |= ~at_end & (returning | without_crossing)
    doubtful &= joined.column[first] == joined.column[last]
    return np.stack([first, last], 1)[doubtful]


def _tiles_of_intervals(
    column: int, a: float, b: float, intervals: list[tuple[float, float, float, float]]
) -> Tiles:
    """Tiles from a to b: stable intervals, with unstable ones between, and windows without width
    where one begins or ends."""
    rows = []
    place = a
    for low, high, *theta in intervals:
        if low > a:
            rows.append((place, low, 1, np.nan, np.nan))
            rows.append((low, low, WINDOW, low, theta[0]))
        rows.append((low, high, 0, np.nan, np.nan))
        if high < b:
            rows.append((high, high, WINDOW, high, theta[1]))
        place = high
    if place < b:
        rows.append((place, b, 1, np.nan, np.nan))
    lows, highs, outside, values, thetas = map(np.array, zip(*rows, strict=True))
    columns = np.full(lows.size, column)
    doubt = np.full(lows.size, Doubt.NONE)
    return Tiles(columns, lows, highs, outside, values, thetas, 0 * lows, doubt)


def regions_of(
    tiles: Tiles,
    lost: tuple[np.ndarray, ...],
    span: tuple[float, float],
    columns: int,
    attached: tuple[float, float],
) -> Regions:
    """Return the parts of the spans in which the loops are stable, unstable or not known; all of a
    column have its doubt.

    lost: parts without panels, see `panels_of`. attached: from each end of the span, how far what
    is not known may reach without a doubt, since a crossing there is given as at the end itself.
    """
    tiles = Tiles.join([tiles, _gaps(tiles, span, columns, attached)])
    tiles = tiles.take(np.lexsort((tiles.low, tiles.column)))
    doubt = np.full(columns, Doubt.NONE)

    def doubted(column: np.ndarray, reason: np.ndarray | int) -> None:
        np.maximum.at(doubt, column, reason)

    owner, low, high, overflown = lost
    searched = (high > span[0] + attached[0]) & (low < span[1] - attached[1])
    doubted(
        owner[searched].astype(int), np.where(overflown[searched] > 0, Doubt.OVERFLOW, Doubt.SEARCH)
    )
    doubted(tiles.column, np.where(tiles.outside == UNKNOWN, Doubt.CROWDED, Doubt.NONE))
    # Inside a plain window all may be stable, also at an end of the span.
    doubted(tiles.column, np.where(tiles.outside == WINDOW, tiles.doubt, Doubt.NONE))

    plain = np.flatnonzero(~tiles.is_window)
    regions = tiles.take(plain)
    column = regions.column
    label = np.sign(regions.outside)
    first = np.append(True, np.diff(column) != 0)
    last = np.append(first[1:], True)
    # The tile before each part, and that after it: of neighbours it is the same.
    neighbours = tiles.take(
        np.clip(np.concatenate([plain - 1, plain[-1:] + 1]), 0, tiles.column.size - 1)
    )
    is_window = neighbours.is_window
    before = neighbours.take(slice(None, -1))
    after = neighbours.take(slice(1, None))
    crossed = is_window[:-1] & (before.column == column)
    ending = is_window[1:] & (after.column == column)
    low = np.where(first, span[0], np.where(crossed, before.value, regions.low))
    high = np.where(last, span[1], np.append(low[1:], span[1]))
    theta_low = np.where(crossed, before.theta, np.nan)
    theta_high = np.where(ending, after.theta, np.nan)
    miss_low = np.where(crossed, before.miss, 0.0)
    miss_high = np.where(ending, after.miss, 0.0)
    rough = np.maximum(
        np.where(crossed, before.doubt, Doubt.NONE), np.where(ending, after.doubt, Doubt.NONE)
    )
    doubted(column, np.where(label == 0, rough, Doubt.NONE))

    label_before = np.where(first, UNKNOWN, np.append(UNKNOWN, label[:-1]))
    same = ~first & (label_before == label)
    # Between parts alike eigenvalues may touch the circle, or cross and return; without a crossing
    # the counts agree.
    unsure = crossed & same & ((label == 0) | (before.outside == WINDOW))
    uncrossed = ~crossed & ~same & (np.minimum(label, label_before) >= 0)
    doubted(column[~first & (unsure | uncrossed)], Doubt.COUNTS)

    begin = np.flatnonzero(~same)
    end = np.flatnonzero(np.append(~same[1:], True))
    miss = np.maximum(miss_low[begin], miss_high[end])
    ends = low[begin], high[end], theta_low[begin], theta_high[end]
    return Regions(column[begin], *ends, label[begin], doubt[column[begin]], miss)


def _gaps(
    tiles: Tiles, span: tuple[float, float], columns: int, attached: tuple[float, float]
) -> Tiles:
    """What is between the tiles of each column, and before and behind them."""
    tiles = tiles.take(np.lexsort((tiles.low, tiles.column)))
    every = np.arange(columns)
    low, high = (np.full(columns, float(end)) for end in span)
    column = np.concatenate([every, tiles.column, every])
    begins = np.concatenate([low, tiles.low, high])
    ends = np.concatenate([low, tiles.high, high])
    order = np.lexsort((ends, begins, column))
    column = column[order]
    begins = begins[order]
    ends = ends[order]
    gap = np.flatnonzero((np.diff(column) == 0) & (begins[1:] > ends[:-1]))
    gaps = Tiles.of(column[gap], ends[gap], begins[gap + 1], UNKNOWN)
    everything = (gaps.low == span[0]) & (gaps.high == span[1])
    inside = (gaps.high > span[0] + attached[0]) & (gaps.low < span[1] - attached[1])
    return gaps.take(everything | inside)
