"""What a picture shows of the stable region of a plane: areas, lines along their boundary, bars,
and what is not known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from wavesweep.program.analyses.plane_columns import (
    KNOWN,
    NARROW,
    UNDECIDED,
    Interval,
    PlaneCurve,
    View,
)

Chain = list[tuple[float, Interval]]
"""An interval followed over neighbouring values of x."""
Line = list[tuple[float, float]]


@dataclass(frozen=True)
class Region:
    """What a picture shows of a curve.

    areas: outlines of what is stable. unproved: those of its parts that are not certified. certain,
    doubtful: lines along its boundary, with the unstable side at their left. felt: lines of the
    stiffness felt at upper limits. bars: (x, interval) at values of x whose neighbourhood is not
    known. unknown: (from, to) of x, and of the values there that are not known: those of open
    places, or all that are outside the areas; so are gaps that are not known where others are.
    """

    areas: list[Line]
    unproved: list[Line]
    certain: list[Line]
    doubtful: list[Line]
    felt: list[Line]
    bars: Chain
    unknown: list[tuple[float, float, float, float]]


class _Followed(NamedTuple):
    """The intervals of a curve followed over x, the lines across x where they jump, and those
    that nothing joins."""

    chains: list[Chain]
    across: list[tuple[Line, bool]]
    bars: Chain


def region_of(curve: PlaneCurve, view: View) -> Region:
    """The areas, lines and bars of a curve.

    In a narrow gap an interval or a hole may end, in its middle; all other ends go straight
    through. If more ends there, the intervals of both sides go on to its middle, and what only one
    side has ends in a line across x, unless other intervals may be missing: an interval that is not
    known has not ended.
    """
    followed = _followed(curve, view)
    edges = followed.across
    areas: list[Line] = []
    unproved: list[Line] = []
    felt: list[Line] = []
    for chain in followed.chains:
        if len(chain) > 1:
            areas.append(_outline(chain))
        unproved += [_outline(piece) for piece in _unproved(chain)]
        felt += _felt(chain)
        edges += _edges(chain)
    return Region(
        areas=areas,
        unproved=unproved,
        certain=_joined([line for line, certified in edges if certified]),
        doubtful=_joined([line for line, certified in edges if not certified]),
        felt=_joined(felt),
        bars=followed.bars,
        unknown=_unknown(curve, view),
    )


def _unknown(curve: PlaneCurve, view: View) -> list[tuple[float, float, float, float]]:
    """Rectangles (begin, end, low, high) that are not known: columns that are known in part, half way
    to their neighbours, and gaps. A gap counts only where others are known."""
    places = sorted(curve.columns)
    middles = [view.between(begin, end, 2)[0] for begin, end in pairwise(places)]
    begins = [places[0], *middles]
    ends = [*middles, places[-1]]
    unknown = []
    for x, begin, end in zip(places, begins, ends, strict=True):
        _, open_spans = curve.columns[x]
        unknown += [(begin, end, low, high) for low, high in open_spans]
    if curve.gaps:
        gaps = [gap for gap in pairwise(places) if gap not in curve.gaps]
        unknown += [(begin, end, -np.inf, np.inf) for begin, end in gaps]
    return unknown


def _followed(curve: PlaneCurve, view: View) -> _Followed:
    places = sorted(curve.columns)
    first = _points(places[0], curve.columns[places[0]][0])
    if len(places) == 1:
        return _Followed([[place] for place in first], [], first)
    chains: list[Chain] = [[place] for place in first]
    growing = list(chains)
    across: list[tuple[Line, bool]] = []
    bars: Chain = []
    joined_before = True  # the bars at `x_before` are not drawn yet
    for x_before, x_after in pairwise(places):
        state = curve.gaps.get((x_before, x_after), UNDECIDED)
        before, open_before = curve.columns[x_before]
        after, open_after = curve.columns[x_after]
        if state == KNOWN:
            _go_on(growing, x_after, after)
        elif state == NARROW:
            (middle,) = view.between(x_before, x_after, 2)
            is_open = bool(open_before or open_after)
            at_fold = None if is_open else _at_fold(before, after)
            ending, beginning = at_fold or (before, after)
            if not at_fold and not is_open:
                across += _jumps(middle, before, after)
            _go_on(growing, middle, ending)
            pairs = zip(beginning, after, strict=True)
            growing = [[(middle, first), (x_after, second)] for first, second in pairs]
            chains += growing
        else:
            if joined_before:
                bars += _points(x_before, before)
            starts = _points(x_after, after)
            bars += starts
            growing = [[start] for start in starts]
            chains += growing
        joined_before = state != UNDECIDED
    return _Followed(chains, across, bars)


def _points(x: float, intervals: Sequence[Interval]) -> Chain:
    """The intervals with the x at which they are."""
    return [(x, interval) for interval in intervals]


def _go_on(growing: Sequence[Chain], x: float, intervals: Sequence[Interval]) -> None:
    """Append an interval at x to each of the chains."""
    for chain, point in zip(growing, _points(x, intervals), strict=True):
        chain.append(point)


def _at_fold(
    before: Sequence[Interval], after: Sequence[Interval]
) -> tuple[list[Interval], list[Interval]] | None:
    """The intervals of both sides in the middle of a narrow gap, in which the boundary turns back
    at most once.

    There two neighbouring ends of one side meet, which are those of an interval or of a hole. The
    other ends are on both sides, and their means in the middle. None if more happens in the gap.
    """
    fewer, more = sorted((before, after), key=len)
    ends_of_fewer = np.array([(interval.low, interval.high) for interval in fewer]).ravel()
    ends_of_more = np.array([(interval.low, interval.high) for interval in more]).ravel()
    if len(fewer) == len(more):
        ends_at_fold = ends_of_more
        at_middle_of_more = (ends_of_more + ends_of_fewer) / 2
    elif len(fewer) + 1 == len(more):
        real = np.array([(interval.low_real, interval.high_real) for interval in more]).ravel()
        may_fold = np.flatnonzero(real[:-1] & real[1:])  # an end of the swept range turns nowhere
        if not may_fold.size:
            return None
        without = {int(i): np.delete(ends_of_more, (i, i + 1)) for i in may_fold}
        folds = min(without, key=lambda i: np.abs(without[i] - ends_of_fewer).sum())
        ends_at_fold = without[folds]
        tip = ends_of_more[folds : folds + 2].mean()
        at_middle_of_more = np.insert((ends_at_fold + ends_of_fewer) / 2, folds, (tip, tip))
    else:
        return None
    highest_low = np.maximum(ends_at_fold, ends_of_fewer)[0::2]
    lowest_high = np.minimum(ends_at_fold, ends_of_fewer)[1::2]
    if (highest_low >= lowest_high).any():
        return None  # one interval ends, and another begins
    at_middle_of_fewer = (ends_at_fold + ends_of_fewer) / 2
    middle_of_more = _moved(more, at_middle_of_more)
    middle_of_fewer = _moved(fewer, at_middle_of_fewer)
    if fewer is before:
        return middle_of_fewer, middle_of_more
    return middle_of_more, middle_of_fewer


def _moved(intervals: Sequence[Interval], ends: np.ndarray) -> list[Interval]:
    """The intervals with other ends, in the order low, high of each."""
    spans = ends.reshape(-1, 2).tolist()
    return [
        replace(interval, low=low, high=high)
        for interval, (low, high) in zip(intervals, spans, strict=True)
    ]


def _edges(chain: Chain) -> Iterator[tuple[Line, bool]]:
    """The steps along both real ends of an interval, and whether they are certified at both
    sides."""
    for (x_before, a), (x_after, b) in pairwise(chain):
        certified = a.certified and b.certified
        if a.low_real and b.low_real:
            yield [(x_after, b.low), (x_before, a.low)], certified
        if a.high_real and b.high_real:
            yield [(x_before, a.high), (x_after, b.high)], certified


def _felt(chain: Chain) -> Iterator[Line]:
    """The steps along the stiffness felt at the upper limit; there is none where the swept range
    ends the interval."""
    for (x_before, a), (x_after, b) in pairwise(chain):
        if a.high_real and b.high_real and not np.isnan(a.felt_high + b.felt_high):
            yield [(x_before, a.felt_high), (x_after, b.felt_high)]


def _jumps(
    x: float, before: Sequence[Interval], after: Sequence[Interval]
) -> Iterator[tuple[Line, bool]]:
    """Lines across x: down where the left side is stable alone, up where the right side is."""
    every = (*before, *after)
    ends = {interval.low for interval in every} | {interval.high for interval in every}
    for low, high in pairwise(sorted(ends)):
        stable_before = [
            interval for interval in before if interval.low <= low and interval.high >= high
        ]
        stable_after = [
            interval for interval in after if interval.low <= low and interval.high >= high
        ]
        if stable_before and not stable_after:
            yield [(x, high), (x, low)], stable_before[0].certified
        elif stable_after and not stable_before:
            yield [(x, low), (x, high)], stable_after[0].certified


def _joined(lines: Sequence[Line]) -> list[Line]:
    """The lines, each followed by that which begins where it ends: dashes and strokes run on
    along a boundary."""
    begins = {line[0]: line for line in reversed(lines)}
    ends = {line[-1] for line in lines}
    starts = [line for line in lines if line[0] not in ends]
    joined = []
    done: set[int] = set()
    for first in (*starts, *lines):  # a closed boundary begins anywhere
        path = [first[0]]
        line = first
        while line and id(line) not in done:
            done.add(id(line))
            path += line[1:]
            line = begins.get(path[-1], [])
        if len(path) > 1:
            joined.append(path)
    return joined


def _outline(chain: Chain) -> Line:
    return [(x, interval.high) for x, interval in chain] + [
        (x, interval.low) for x, interval in reversed(chain)
    ]


def _unproved(chain: Chain) -> Iterator[Chain]:
    """The parts of a chain between columns of which one at least is not certified there."""
    piece: Chain = []
    for before, after in pairwise(chain):
        if before[1].certified and after[1].certified:
            if piece:
                yield piece
            piece = []
        else:
            piece = [*(piece or [before]), after]
    if piece:
        yield piece
