"""Intervals that hold for all values of numbers that are not known, but constant: searched, then
proved."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from wavesweep.engine.drawing import name_of
from wavesweep.engine.intervals import Resolution, Search
from wavesweep.engine.intervals import Side as Expressed
from wavesweep.engine.loop import Loops
from wavesweep.engine.rows import distinct
from wavesweep.engine.sets import Sides
from wavesweep.engine.switched import (
    ALWAYS,
    INWARD,
    Growth,
    LeftOpen,
    constant_frames,
    corners_of,
    cover,
    left_open,
    on_edges_of,
)
from wavesweep.program.analyses.interval_jobs import ball_prover
from wavesweep.program.reading.axes import Axis

# what a proof has reached, which a command shows
PROOF_LOGGER = logging.getLogger("wavesweep.proof")
SO_FAR = "%s proved from %.4g to %.4g on %.0f %% of the box so far"
MEMBERS_MET = 8  # unstable members that a climb has found, whose exact intervals are computed
SAME_END = 1e-9  # relative: ends that are as near are found again
OPERATIONS_OF_CASE = 3e11  # operations that the proofs of a case may take
# of the high end, from which on is proved what begins at 0, where a mode may stand still: parts of a
# box pile up there, 70 % of them below 1e-3
PROVED_FROM_ZERO = 1e-3


@dataclass(frozen=True, slots=True)
class Part:
    """An interval that no number which was looked at refutes, by which numbers each end is set,
    none at the range's, and the oscillation that starts there (rad/s)."""

    low: float
    high: float
    low_by: Mapping[str, float] | None = None
    high_by: Mapping[str, float] | None = None
    low_omega: float = np.nan
    high_omega: float = np.nan

    def within(self, near: float) -> tuple[float, float]:
        """The interval that is tried to be proved: from ends that are refuted it is away by this
        share of the end, at most of the interval; and from PROVED_FROM_ZERO on in place of 0."""
        wide = self.high - self.low
        away = [
            near * min(max(abs(end), PROVED_FROM_ZERO * wide), wide)
            for end in (self.low, self.high)
        ]
        low = self.low if self.low_by is None else self.low + away[0]
        high = self.high if self.high_by is None else self.high - away[1]
        return (PROVED_FROM_ZERO * high if low == 0 else low), high


def shared(parts: Sequence[Part], second_parts: Sequence[Part]) -> list[Part]:
    """The parts that two sets of intervals have in common, each end with the numbers that set
    it."""
    overlaps = []
    for interval in parts:
        for second in second_parts:
            low = max(interval, second, key=lambda part: part.low)
            high = min(interval, second, key=lambda part: part.high)
            if low.low < high.high:
                overlaps.append(
                    Part(
                        low.low, high.high, low.low_by, high.high_by, low.low_omega, high.high_omega
                    )
                )
    return overlaps


def searched(cases: Sequence["Case"], span: tuple[float, float]) -> list[Part]:
    """The intervals that nothing which is looked at in any of the cases refutes."""
    intervals = [Part(*span)]
    for case in cases:
        intervals = shared(intervals, case.parts())
    return intervals


@dataclass(frozen=True, slots=True)
class Proved:
    """What is proved of a box: all from low to high of the number along which it is, or of the
    first range without one.

    open: what holds the proof up next to `high`, or to `low`; None if nothing does. unstable:
    points that a proof has met and that seem unstable, with the number first. whole: whether all is
    proved.
    """

    low: float
    high: float
    open: LeftOpen | None = None
    unstable: tuple[tuple[float, ...], ...] = ()
    whole: bool = True

    @property
    def stopped(self) -> bool:
        """Whether something holds the proof up."""
        return bool(self.open or self.unstable)


def proofs(
    cases: Sequence["Case"], span: tuple[float, float], near: float
) -> Iterator[tuple[Part, Proved | None]]:
    """Yield the intervals that no loop met so far refutes, in order, and what is proved of each,
    None without.

    The proof comes first: worse numbers are searched where it leaves something open, and it goes on
    from there. near: share of an end that is refuted, by which what is tried to be proved stays
    away from it.
    """
    # Four rounds of a search after a proof that has not ended.
    waiting = [(interval, 4, {}) for interval in searched(cases, span)]
    while waiting:
        part, rounds, proved_before = waiting.pop(0)
        if not any(case.ranges for case in cases):  # the exact intervals of each case are its proof
            yield part, Proved(part.low, part.high)
            continue
        low, high = part.within(near)
        if not low < high:
            yield part, None
            continue
        covers = [case.cover(low, high, proved_before.get(case)) for case in cases]
        intervals = [part]
        for case, covered in zip(cases, covers, strict=True):
            if covered.unstable:
                intervals = case.met(intervals, np.array(covered.unstable)[:, 1:])
            if not covered.whole:
                intervals = case.narrowed(intervals)
        if intervals != [part] and rounds:
            proved_before = dict(zip(cases, covers, strict=True))
            waiting = [(narrower, rounds - 1, proved_before) for narrower in intervals] + waiting
            continue
        lowest = max(covers, key=lambda part_of_case: part_of_case.low)
        highest = min(covers, key=lambda part_of_case: part_of_case.high)
        for interval in intervals:
            inner = interval.within(near)
            low = max(lowest.low, inner[0])
            high = min(highest.high, inner[1])
            yield interval, Proved(low, high, highest.open or lowest.open) if low < high else None


class Case:
    """Loops whose numbers have ranges, along another number.

    loop: with the others' values; values: all of them, read or not. along: empty for none. fixed:
    those among the values that are named with the numbers of an end. bound: on the eigenvalues of
    their frames, by the radius of these; None for stability. certified: whether all intervals that were
    looked at are. left: operations that proofs may take.
    """

    def __init__(
        self,
        loop: Loops,
        along: str,
        span: tuple[float, float],
        ranges: Sequence[Axis],
        fixed: Mapping[str, object] = MappingProxyType({}),
        bound: Any = None,
    ):
        self.along = along
        self.span = span
        self.fixed = dict(fixed)
        self.loop = loop.read
        self.values = dict(loop.values)
        self.ranges = [axis for axis in ranges if axis.path in loop.drawing.reads]
        self.box = np.array(
            [[axis.start for axis in self.ranges], [axis.stop for axis in self.ranges]], float
        )
        self.bound = bound
        self.radius = 1.0
        if bound:
            drawn = self.loop.drawn()
            self.radius = float(bound.radius_of(np.real(drawn.period) * drawn.ticks))
        self.certified = True
        self.left = OPERATIONS_OF_CASE

    def parts(self) -> list[Part]:
        """What none of the numbers that are tried in any case refutes."""
        return self.met([Part(*self.span)], self._starts)

    def narrowed(self, parts: list[Part]) -> list[Part]:
        """What is left of the parts after climbs, over all numbers and along the parts, to
        members that are unstable there."""
        growth = self._growth
        # Up to 8 rounds of climbs for worse numbers, each within what the last one left.
        for _ in range(8 if self.ranges else 0):
            before = parts
            for part in before:
                low, high = part.within(0.0)  # all of it, but for what is next to 0
                box = np.column_stack([[low, high], self.box])
                starts = [np.insert(self._starts, 0, end, axis=1) for end in (low, high)]
                starts += [[[low, *point]] for point in self._setting(part.low_by)]
                starts += [[[high, *point]] for point in self._setting(part.high_by)]
                members = growth.climb(box, np.concatenate(starts)).unstable[:MEMBERS_MET, 1:]
                parts = self.met(parts, np.unique(members, axis=0))
            if _alike(parts, before):
                parts = self._narrowed_by_edges(parts, growth)
            if _alike(parts, before):
                break
        return parts

    def _narrowed_by_edges(self, parts, growth):
        """What is left of the parts after climbs from members on all edges of the box, at both ends
        of each part.

        A light hand is unstable in a few per cent of its range, where it swings at half the rate:
        no climb that begins elsewhere gets there.
        """
        # Members on each edge of a box, once a climb finds nothing.
        on_edges = on_edges_of(self.box)
        for part in list(parts):
            box = np.column_stack([part.within(0.0), self.box])
            members = np.concatenate([np.insert(on_edges, 0, end, axis=1) for end in box[:, 0]])
            found = growth.climb(box, members).unstable[:MEMBERS_MET, 1:]
            parts = self.met(parts, found)
        return parts

    def _setting(self, by):
        """The point of the box with the numbers that set an end, and its own for those that only
        this case has; none if others are fixed here."""
        if by is None or not self.fixed.items() <= by.items():
            return []
        return [[by.get(axis.path, self.values[axis.path]) for axis in self.ranges]]

    @cached_property
    def _starts(self):
        """Members that are tried in any case: those that are tried first, and the extremes of
        expressions."""
        if not self.ranges:
            return self._first
        extremes = Resolution(*self.loop, [Expressed(axis.path) for axis in self.ranges]).extremes(
            self.box
        )
        return np.concatenate([self._first, extremes])

    @property
    def _first(self):
        """The spec's own member, the corners and the middle."""
        nominal = np.clip([[float(self.values[axis.path]) for axis in self.ranges]], *self.box)
        if self.ranges:
            return np.concatenate([nominal, corners_of(self.box)])
        return nominal

    def met(self, parts: Sequence[Part], points: np.ndarray) -> list[Part]:
        """What is left of the parts after the exact intervals at points of the box."""
        for point, exact in zip(points, self._exact(points), strict=True):
            by = self.named(point)
            intervals = []
            for low, high, certain, causes, *omegas in exact:
                below, above = (by | dict.fromkeys(cause) for cause in causes)
                below = below if certain[0] and low > self.span[0] else None
                above = above if certain[1] and high < self.span[1] else None
                intervals.append(Part(low, high, below, above, *omegas))
            parts = shared(parts, intervals)
        return list(parts)

    def _exact(self, points):
        """The stable intervals at each point, with whether what lies below and above is known to
        be unstable, and the words of what else than a mode sets these ends."""
        words = [[], *([word] for word in (self.bound.set_by if self.bound else []))]
        intervals = [[] for _ in points]
        for members, loops in self._built(points):
            records = Search(
                self.along,
                self.span,
                ((np.arange(members.size), loops),),
                lines=False,
                checked=True,
                prover=ball_prover,
                bound=self.bound,
            ).records()
            self.certified &= bool(records["certified"].all())
            for record in records[records["intervals"] > 0]:
                low, high, *omegas = (
                    float(record[name]) for name in ("low", "high", "low_omega", "high_omega")
                )
                certain = not record["open_low"] < low, not record["open_high"] > high
                causes = words[record["low_cause"]], words[record["high_cause"]]
                intervals[members[record["slice"]]].append((low, high, certain, causes, *omegas))
        return intervals

    def _built(self, points):
        """Yield members of the box that are built alike, as indices and loops, with the whole
        ticks of their dead times."""
        unbuilt = self.loop.unbuilt
        for alike in distinct(list((points == 0).T), len(points)):
            arrays = {
                axis.path: np.ascontiguousarray(points[alike, i])
                for i, axis in enumerate(self.ranges)
            }
            if unbuilt == self.loop:
                yield alike, self.loop.changed(arrays)
            else:
                yield from unbuilt.changed(arrays).built_alike(alike)

    def cover(
        self, low: float = 0.0, high: float = 0.0, proved_before: Proved | None = None
    ) -> Proved:
        """What is proved of all loops of the box, from low to high of the number if there is one:
        up and down from between.

        proved_before: what is proved already, of a part from which the proof goes on.
        """
        paths = [axis.path for axis in self.ranges]
        box = self.box
        if self.along:
            paths = [self.along, *paths]
            box = np.column_stack([[low, high], box])
        sides = Sides.of(self.loop, paths, box, swept=bool(self.along))
        whole = sides.places(box)
        frames = constant_frames(self.loop, sides, whole, radius=self.radius)
        if not self.along:
            return self._covered(frames, sides, whole, self.left, lambda share: share, up=True)
        begun = np.full(2, low + 0.4 * (high - low))  # where a proof begins
        if proved_before is not None and max(low, proved_before.low) < min(
            high, proved_before.high
        ):
            begun = np.clip([proved_before.low, proved_before.high], low, high)
        lower = whole.copy()
        upper = whole.copy()
        lower[1, 0], upper[0, 0] = sides[0].place(begun)
        above = below = Proved(float(low), float(high))
        # Which share of all of it is proved with a share of the upper or of the lower part.
        bottom, low_begun, high_begun, top = *lower[:, 0], *upper[:, 0]
        if high_begun < top:
            above = self._covered(
                frames,
                sides,
                upper,
                self.left / 2,
                lambda share: (
                    (high_begun - low_begun + share * (top - high_begun)) / (top - bottom)
                ),
                up=True,
            )
        if bottom < low_begun:
            below = self._covered(
                frames,
                sides,
                lower,
                self.left,
                lambda share: (top - low_begun + share * (low_begun - bottom)) / (top - bottom),
                up=False,
            )
        return Proved(
            below.low if below.stopped else float(low),
            above.high if above.stopped else float(high),
            above.open or below.open,
            above.unstable + below.unstable,
            above.whole and below.whole,
        )

    def _covered(self, frames, sides, box, work, share_of_all, *, up):
        """What is proved of a box of sides from its low end on, or from its high end on down.

        share_of_all: of all that is to be proved, from that of this box.
        """
        first = sides[0]
        begun = float(first.number(box[1 - up, 0]))

        def report(reached, share):
            ends = sorted((begun, float(first.number(reached))))
            if ends[0] == ends[1]:  # nothing is proved yet
                return
            PROOF_LOGGER.info(SO_FAR, name_of(first.path), *ends, 100 * share_of_all(share))

        covering = cover(frames, box, ALWAYS, work, up, report=report)
        self.left -= covering.used
        end = float(first.number(covering.end))
        if covering.open:
            end += INWARD * abs(end) * (-1 if up else 1)
        low, high = (begun, end) if up else (end, begun)
        open_ = None if covering.word else left_open(covering, sides, box, up=up)
        return Proved(low, high, open_, _met(covering, sides), not covering.open)

    @property
    def _growth(self):
        """The growth of members, by their numbers, that along which they are first."""
        paths = [axis.path for axis in self.ranges]
        if self.along:
            paths = [self.along, *paths]
        return Growth.of_loops(self.loop, paths, self.radius)

    def begins_unstable(self) -> bool:
        """Whether one of the members that are tried first is not stable, or not known to be."""
        return not (self._growth.of(self._first) < 1).all()

    def contradicts(self, low: float = 0.0, high: float = 0.0) -> bool:
        """Whether some member grows though all are proved, from low to high of the number: see
        `Growth.contradicts`."""
        box = np.column_stack([[low, high], self.box]) if self.along else self.box
        return self._growth.contradicts(box)

    def unstable(self, starts: Sequence[Sequence[float]] = ()) -> Mapping[str, float] | None:
        """Numbers with which the loop is not stable, or not known to be, where a climb finds some;
        None without.

        starts: places of the box at which it begins too.
        """
        growth = self._growth
        for tried in (
            (self._first, self._starts) if self.ranges else (self._first,)
        ):  # extremes take longer to find
            begun = np.concatenate([tried, np.reshape(starts, (len(starts), len(self.ranges)))])
            unstable = growth.climb(self.box, begun).unstable
            if len(unstable):
                return self.named(unstable[0])
        return None

    def named(self, point) -> dict[str, float]:
        """The numbers of a point of the box."""
        return self.fixed | dict(
            zip((axis.path for axis in self.ranges), np.asarray(point).tolist(), strict=True)
        )


def _alike(parts, second_parts):
    """Whether parts have the same ends, but for rounding."""
    if len(parts) != len(second_parts):
        return False
    for part, second_part in zip(parts, second_parts, strict=True):
        for first, second in ((part.low, second_part.low), (part.high, second_part.high)):
            if abs(first - second) > SAME_END * max(abs(first), abs(second)):
                return False
    return True


def _met(covering, sides):
    """The point at which a proof has found no form, as numbers."""
    if covering.word:
        return (tuple(sides.numbers(covering.point).tolist()),)
    return ()
