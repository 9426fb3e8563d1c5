"""Stable intervals of loops of one drawing along any of their numbers, a batch at a time."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from wavesweep.engine.drawing.drawing import name_of
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loops.batch import Loops, distinct_rows
from wavesweep.engine.loops.dead_time import breaks, structure, timing
from wavesweep.engine.loops.domain import domains, refuse_unsuitable
from wavesweep.engine.loops.ports import feels
from wavesweep.engine.rows import different
from wavesweep.engine.search.interval_records import (
    FAILURES,
    FELT,
    LINES,
    RECORD,
    fill_in_felt,
    fill_in_lines,
    records_of,
    unanswered,
)
from wavesweep.engine.search.open_loops import Opened, by_slice, by_zeros, in_place, varied_beside
from wavesweep.engine.search.required_region import RequiredRegion
from wavesweep.engine.search.subloops import common, silent, subloops
from wavesweep.engine.stability.certificate import NONE
from wavesweep.engine.stability.intervals import Intervals, joined, without_seams
from wavesweep.engine.stability.radii import drift_of

LEAST_WORK = 1000  # of a piece of a range, in squares of states: some 60 ms

# From loops, the path of a number and the periods of their frames (s) to what `covering.proved_by_balls` asks; None: no prover.
Prover = Callable[[Loops, str, np.ndarray], Callable | None]

Groups = tuple[tuple[np.ndarray, Loops], ...]  # (members, loops) pairs, see `drawn_groups`


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """A search for the stable intervals of loops of one drawing along the number `along` within span = (low, high).

    groups: of the loops, which the members of all of them number. If the number is one scalar gain of a frame, it is cut out;
    otherwise its intervals are found by panels. felt: give the stiffness that a hand feels at the ends too. checked: whether
    the numbers are known to make loops. prover: is asked about columns in doubt. bound: on the
    eigenvalues of a frame, in place of the unit circle.
    """

    along: str
    span: tuple[float, float]
    groups: Groups
    felt: bool = True
    checked: bool = False
    prover: Prover | None = None
    bound: RequiredRegion | None = None

    def records(self) -> np.ndarray:
        """The intervals as records, with the stiffness that a hand feels."""
        parts, opened_groups = [], self.opened_groups()
        for members, loops, opened in opened_groups:
            found = self._in_pieces(loops, members.size) if self.in_pieces else self.between_breaks(loops, members.size, opened)
            parts.append(replace(found, column=members[found.column]))
        records = records_of(by_slice(parts))
        for name in (*FELT, *LINES):
            records[name] = np.nan
        for members, loops, opened in opened_groups if self.felt else ():  # curves leave out what is felt, and these lines
            if feels(loops.drawing):
                fill_in_felt(self, records, members, loops, opened)
            fill_in_lines(self, records, members, loops, opened)
        return records

    def opened_groups(self) -> list[tuple[np.ndarray, Loops, Opened | None]]:
        """The groups, and the loops of each without the number; those that such loops may have in common are one group."""
        for _, loops in () if self.checked else self.groups:
            refuse_unsuitable(*loops)
        whole = self._with_zeros()
        if whole:
            opened = self.opened(whole[1], whole[0].size)
            if opened and opened.loops.beside:
                return [(*whole, opened)]
        return [(members, loops, self.opened(loops, members.size)) for members, loops in self.groups]

    def _with_zeros(self):
        """Two groups as one, that are apart since a number which loops may be without is 0 in one of them; else None."""
        if len(self.groups) != 2:
            return None
        (first, loops), (second, others) = self.groups
        one, other = loops.values, others.values
        arrays = [path for path, v in one.items() if np.ndim(v)]
        zero = [path for path in arrays if np.any(one[path]) != np.any(other[path])]
        alike = all(one[path] == other[path] for path in one.keys() - {*arrays})
        if not alike or zero != [varied_beside(loops, self.number)]:
            return None
        if any(len(self._parts(each)) > 1 for each in (loops, others)):
            return None
        members = np.concatenate([first, second])
        order = np.argsort(members)
        return members[order], loops.changed({path: np.concatenate([one[path], other[path]])[order] for path in arrays})

    @property
    def number(self) -> str:
        """Name of the number in the drawing."""
        return name_of(self.along)

    @property
    def in_pieces(self) -> bool:
        """Whether loops are built in another way at other values of the number, as dead times of other whole ticks are."""
        return self.number in timing(self.groups[0][1].drawing)

    def _in_pieces(self, loops, size):
        """The intervals from parts of the range, in each of which the loops are built alike."""
        times = {path: v for path, v in loops.values.items() if np.ndim(v) and name_of(path) in timing(loops.drawing)}
        first, of = distinct_rows(times, size)
        parts = []
        for number, at in enumerate(first.tolist()):
            columns = np.flatnonzero(of == number)
            some, one = loops.some(columns), loops.some(at)
            ends = breaks(*one, self.along, self.span)
            whole = without_seams(joined([self._piece(piece, some, one, columns.size) for piece in pairwise(ends)]))
            parts.append(replace(whole, column=columns[whole.column]))
        return by_slice(parts)

    def _piece(self, piece, loops, one, size):
        """The intervals in a part of the range in which the loops are built as the loop `one` is."""
        return replace(self, span=piece).between_breaks(loops.changed(self._built(piece, one)), size, None)

    def _built(self, piece, one):
        """The whole numbers of ticks that the loop is built with in a part of the range."""
        return {path: int(each) for path, each in structure(*one.changed({self.along: sum(piece) / 2})).items()}

    def about(self, value: float, work: float) -> tuple[np.ndarray, tuple[float, float]]:
        """The intervals of a single loop about a value of the number as records, and the part of the range that was searched.

        It grows piece by piece, the nearest first, until the interval of the value has both of its ends, or the work is spent:
        a piece with n states takes LEAST_WORK + n n. It is counted, so that the result does not depend on the machine.
        """
        ((_, loop),) = self.groups
        ends = breaks(*loop, self.along, self.span)
        at = min(max(int(np.searchsorted(ends, value)) - 1, 0), len(ends) - 2)
        first, last, parts = at, at + 1, []
        while True:
            piece = ends[at : at + 2]
            parts.append(self._piece(piece, loop, loop, 1))
            work -= LEAST_WORK + len(drift_of(loop.changed(self._built(piece, loop))).states) ** 2
            records = records_of(without_seams(joined(parts)))
            inside = records[(records["low"] <= value) & (value <= records["high"])]
            known = [np.fmin(inside["low"], inside["open_low"]), np.fmax(inside["high"], inside["open_high"])]
            below = value - ends[first - 1] if first and (known[0] == ends[first]).all() else np.inf
            above = ends[last + 1] - value if last + 1 < len(ends) and (known[1] == ends[last]).all() else np.inf
            if np.isinf(min(below, above)) or work < 0:
                return records, (ends[first], ends[last])
            at = first - 1 if below < above else last
            first, last = min(first, at), max(last, at + 1)

    def between_breaks(self, loops, size, opened) -> Intervals:
        """The intervals of loops that are built alike at all values of the number; opened: as for `connected`."""
        if self.bound and self.bound.gain:
            from wavesweep.engine.search.by_frames import by_gain

            return by_gain(self, loops, replace(self, bound=self.bound.of_modes).between_breaks(loops, size, opened))
        parts = self._parts(loops)
        if len(parts) <= 1:
            return self.connected(loops, size, opened)
        if not self._drift_alike(loops, parts):  # a cut would leave out a mode that grows and that the number does not see
            return self.connected(loops, size, None)
        domains(*loops, self.along, self.span, size)  # of what leads from one part to another, too
        ticks, found = loops.drawn().ticks if self.bound else 0, []
        for part in (Loops(drawing, loops.values) for drawing in parts):
            own = replace(self, bound=self.bound.over(ticks // part.drawn().ticks)) if self.bound else self
            opened = None
            with suppress(IllPosedLoopError):  # they may have no solution at 0 of the number, which may be beyond the range
                opened = own.opened(part, size)
            found.append(own.connected(part, size, opened))
        return common(found)

    def _parts(self, loops):
        """The drawings of the parts of the loops, without terms whose gain is 0 in every loop."""
        return subloops(loops.drawing, silent(*loops.changed({self.along: 1.0}), self.number), every=self.bound is not None)

    def opened(self, loops, size: int) -> Opened | None:
        """The loops of `size` slices without the number, see `Opened`; None if it is not one scalar gain of a frame."""
        return Opened.of(loops, self.number, size, felt=self.felt)

    def _drift_alike(self, loops, parts):
        """Whether as many shifts of the parts are opposed by nothing as of the whole, and nothing else is left out of them.

        A block that reads a part, or a hand that moves it, may make a shift of it a mode that grows with time.
        """
        over = loops.changed({self.along: np.array(self.span)})
        whole, *drifts = (drift_of(Loops(drawing, over.values)) for drawing in (loops.drawing, *parts))
        unread, *others = ({each.states[state] for state in each.unobserved} for each in (whole, *drifts))
        shifts, *own = (len(each.constant) + len(each.varying) for each in (whole, *drifts))
        return shifts == sum(own) and unread >= set().union(*others)

    def connected(self, loops, size, opened) -> Intervals:
        """The intervals of loops that are one piece; opened: without the number, see `open_loops`.

        Columns in which the search along the circle leaves a doubt are searched by dominance.
        """
        if opened is None or opened.loops.cut is None or (self.bound and self.bound.cost):
            return self._from_frames(loops, size, opened)
        count = int(opened.which.max()) + 1
        cut = opened.loops.batch(count)
        found = opened.intervals(cut, self.span, self.bound)
        doubtful = different(found.column[found.doubt != NONE])
        if not opened.alone and size > 1:  # each by itself
            for part in by_zeros(loops, doubtful):
                columns = doubtful[part]
                few = loops.some(columns)
                alone = Opened.of_each(few, self.number, columns.size, felt=self.felt)
                found = in_place(found, columns, self.connected(few, columns.size, alone))
        elif doubtful.size:
            found = in_place(found, doubtful, self._from_frames(loops.some(doubtful), doubtful.size, None))
        return found

    def _from_frames(self, loops, size, opened) -> Intervals:
        from wavesweep.engine.search.by_frames import by_bound, by_dominance, by_lines

        if self.bound and self.bound.cost:
            found, of_size = by_bound(self, loops, size), self.bound.of_size
            return common([found, replace(self, bound=of_size).connected(loops, size, opened)]) if of_size else found
        return (by_lines if self.in_pieces else by_dominance)(self, loops, size)


@dataclass(frozen=True, slots=True, eq=False)
class Searches:
    """Searches for loops of different drawings along the same range, whose members number the loops of all."""

    searches: tuple[Search, ...]

    def records(self) -> np.ndarray:
        """The intervals of all loops as records, sorted by slice.

        Loops whose search fails in arithmetic are searched apart, and one that fails alone is in doubt everywhere.
        """
        try:
            return _by_slice([search.records() for search in self.searches])
        except FAILURES as error:
            parts = [(search, *group) for search in self.searches for group in search.groups]
            if len(parts) == 1:
                ((search, members, loops),) = parts
                if members.size == 1:
                    return unanswered(RECORD, int(members[0]), search.span, error)
                halves = np.array_split(np.arange(members.size), 2)
                parts = [(search, members[half], loops.some(half)) for half in halves]
        return _by_slice([Searches((replace(search, groups=(tuple(group),)),)).records() for search, *group in parts])


def _by_slice(parts):
    records = np.concatenate(parts)
    return records[np.argsort(records["slice"], kind="stable")]
