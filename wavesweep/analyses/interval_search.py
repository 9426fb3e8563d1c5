"""Stable intervals of loops of one drawing along any of their numbers, a batch at a time."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import prod

import numpy as np

from wavesweep.analyses.bound import Bound
from wavesweep.analyses.interval_records import FELT, LINES, felt_at_ends, records_of
from wavesweep.analyses.lines import lines_in_loops, strongest_in_cut
from wavesweep.analyses.loops import drift_of, feels, felt_of, hand_of, named_loops, watched_drift
from wavesweep.analyses.open_loops import Opened, by_slice, in_place, varied_beside, with_intervals
from wavesweep.analyses.proving import settling
from wavesweep.analyses.subloops import common, subloops
from wavesweep.controllers import WALL
from wavesweep.errors import IllPosedLoopError
from wavesweep.loops.dead_time import breaks, structure, timing
from wavesweep.loops.domain import bends_at_zero, domains, guards_at
from wavesweep.loops.from_drawing import FACTOR, PRODUCT, rate_of, refuse_unsuitable, scalar_place, seen_by_hand, silent
from wavesweep.monodromy.cut import with_batch
from wavesweep.monodromy.drift import TickDrift, closed, errors_of_closed, filled, without_drift
from wavesweep.monodromy.open_ticks import OpenTicks, facts_of
from wavesweep.monodromy.periodic import ticks_of
from wavesweep.monodromy.radius import errors_within, within
from wavesweep.response.resting import Resting, resting
from wavesweep.spec.drawing import name_of
from wavesweep.stability import Circle, Intervals, Spiral, along_by_discs, joined, stable_along_any
from wavesweep.stability.along_any import BENT, FROM_ZERO
from wavesweep.stability.by_lines import LONG, unstable_counts
from wavesweep.stability.certificate import NONE
from wavesweep.stability.crossings import SLIVER
from wavesweep.stability.frames import Frames
from wavesweep.stability.intervals import without_seams
from wavesweep.sweep.grid import Loops, distinct, distinct_rows

Groups = tuple[tuple[np.ndarray, Loops], ...]  # (members, loops) pairs, see `drawn_groups`
BATCH = 256  # modes that are followed through their frames at once
TINY = 1e-300  # in place of a zero, which would take a state out of the loop


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """A search for the stable intervals of loops of one drawing along the number `along` within span = (low, high).

    groups: of the loops, which the members of all of them number. If the number is one scalar gain of a frame, it is cut out;
    otherwise its intervals are found by panels. felt: give the stiffness that a hand feels at the ends too. checked: whether
    the numbers are known to make loops. prove: operations of ball arithmetic that each column in doubt may take. bound: on the
    eigenvalues of a frame, in place of the unit circle.
    """

    along: str
    span: tuple[float, float]
    groups: Groups
    felt: bool = True
    checked: bool = False
    prove: float = 0.0
    bound: Bound | None = None

    def records(self) -> np.ndarray:
        """The intervals as records, with the stiffness that a hand feels."""
        return self.records_of(self.opened_groups())

    def records_of(self, opened_groups) -> np.ndarray:
        """The same; opened_groups: see there."""
        parts = []
        for members, loops, opened in opened_groups:
            found = self._intervals(loops, members.size, opened)
            parts.append(replace(found, column=members[found.column]))
        found = by_slice(parts)
        records = records_of(found)
        for name in (*FELT, *LINES):
            records[name] = np.nan
        for members, loops, opened in opened_groups if self.felt else ():  # curves leave out what is felt, and these lines
            if feels(loops.drawing):
                self._fill_in_felt(records, members, loops, opened)
            self._fill_in_lines(records, members, loops, opened)
        return records

    def _fill_in_felt(self, records, members, loops, opened) -> None:
        """Fill in the stiffness felt at both ends of the intervals of the loops `members`."""
        rows = np.flatnonzero(records["intervals"] > 0)
        rows = rows[np.isin(records["slice"][rows], members)] if len(self.groups) > 1 else rows
        at = np.searchsorted(members, records["slice"][rows])
        known = opened if opened and opened.loops.at_rest else self._resting(loops)
        if known is not None:
            ends = np.concatenate([records[end][rows] for end in ("low", "high")])
            both = known.stiffness(np.tile(at, 2), ends)
            if known is opened and opened.loops.beside and np.isnan(both).any():
                both = self._felt_alone(loops, np.tile(at, 2), ends, both)
            for name, part in zip(FELT, np.split(both, 2), strict=True):
                records[name][rows] = part
            unknown = np.flatnonzero(np.isnan([records[name][rows] for name in FELT]).any(0))
            rows, at = rows[unknown], at[unknown]

        def stiffness(some, p):
            found, columns = np.empty(p.size), at[some]
            alone = self.in_pieces  # each is built in its own way
            varied = self._without_building(loops) if alone else loops
            parts = np.arange(p.size)[:, None] if alone else _alike(loops, columns)
            for part in parts:
                found[part] = felt_of(varied.some(columns[part]).changed({self.along: p[part]}), part.size)
            return found

        if rows.size:
            felt_at_ends(records, rows, stiffness)

    def _fill_in_lines(self, records, members, loops, opened) -> None:
        """Fill in the strongest line (Hz) of the oscillation that starts at each end, of the loops `members`."""
        few, bound = 1 if self.in_pieces else BATCH, self.bound or Bound()
        for end, name in zip(("low", "high"), LINES, strict=True):
            rows = np.flatnonzero(~np.isnan(records[f"{end}_omega"]) & np.isin(records["slice"], members))
            at, p, omega = np.searchsorted(members, records["slice"][rows]), records[end][rows], records[f"{end}_omega"][rows]
            if opened and opened.loops.cut and not bound.damping_ratio:
                records[name][rows] = strongest_in_cut(loops.drawing, opened, at, omega, bound)
                continue
            for part in (slice(first, first + few) for first in range(0, rows.size, few)):
                records[name][rows[part]] = self._strongest(loops, at[part], p[part], omega[part], bound)

    def _strongest(self, loops, at, p, omega, bound):
        """The strongest line (Hz) of the modes of frequency omega of the slices `at`, if the number has the values p."""
        varied = (self._without_building(loops) if self.in_pieces else loops).some(at)
        varied = varied.changed({self.along: np.where(p == 0, TINY, p)})
        with suppress(IllPosedLoopError):
            drawn = varied.drawn()
            period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), p.shape)
            if drawn.ticks > 1:
                return lines_in_loops(varied, bound.logarithms(period, omega))[:, 0]
        return omega / (2 * np.pi)

    def _without_building(self, loops):
        """The loops without the numbers of ticks of their dead times, which follow from the others."""
        return Loops(loops.drawing, {path: v for path, v in loops.values.items() if path not in loops.drawing.building})

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

    def _felt_alone(self, loops, at, ends, known):
        """The stiffness felt of slices `at` if the number has these values, from their own loops where it is not known yet."""
        unknown = np.flatnonzero(np.isnan(known) & ~np.isnan(ends))
        for columns in _by_zeros(loops, np.unique(at[unknown])):
            alone, some = self._alone(loops.some(columns), columns.size), unknown[np.isin(at[unknown], columns)]
            if alone and alone.loops.at_rest:
                known[some] = alone.stiffness(np.searchsorted(columns, at[some]), ends[some])
        return known

    @property
    def number(self) -> str:
        """Name of the number in the drawing."""
        return name_of(self.along)

    def _resting(self, loops) -> Resting | None:
        """The loops at rest, if the number is one scalar gain of them."""
        if not scalar_place(loops.drawing, self.number) or seen_by_hand(loops.drawing, self.number):
            return None
        with suppress(IllPosedLoopError):
            drift = watched_drift(self._over_range(loops))
            if not (drift.moved or drift.folded):
                one = loops.changed({self.along: 1.0})
                return resting(one.drawn(self.number), hand_of(loops.drawing), PRODUCT, FACTOR)
        return None

    @property
    def in_pieces(self) -> bool:
        """Whether loops are built in another way at other values of the number, as dead times of other whole ticks are."""
        return self.number in timing(self.groups[0][1].drawing)

    def _intervals(self, loops, size, opened):
        return self._in_pieces(loops, size) if self.in_pieces else self.between_breaks(loops, size, opened)

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
        middle = one.changed({self.along: sum(piece) / 2})
        built = {path: int(each) for path, each in structure(*middle).items()}
        return replace(self, span=piece).between_breaks(loops.changed(built), size, None)

    def about(self, value: float, enough: Callable[[], bool]) -> tuple[np.ndarray, tuple[float, float]]:
        """The intervals of a single loop about a value of the number as records, and the part of the range that was searched.

        It grows piece by piece, the nearest first, until it is `enough` or the interval of the value has both of its ends.
        """
        ((_, loop),) = self.groups
        ends = breaks(*loop, self.along, self.span)
        first = min(max(int(np.searchsorted(ends, value)) - 1, 0), len(ends) - 2)
        last, parts = first + 1, [self._piece(ends[first : first + 2], loop, loop, 1)]
        while True:
            found = without_seams(joined(parts))
            inside = (found.low <= value) & (value <= found.high)
            below = value - ends[first - 1] if first and (found.low[inside] == ends[first]).all() else np.inf
            above = ends[last + 1] - value if last + 1 < len(ends) and (found.high[inside] == ends[last]).all() else np.inf
            if np.isinf(min(below, above)) or enough():
                return records_of(found), (ends[first], ends[last])
            at = first - 1 if below < above else last
            first, last = min(first, at), max(last, at + 1)
            parts.append(self._piece(ends[at : at + 2], loop, loop, 1))

    def between_breaks(self, loops, size, opened) -> Intervals:
        """The intervals of loops that are built alike at all values of the number; opened: as for `connected`."""
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

    def _over_range(self, loops):
        """The loops with all of the range of the number."""
        return loops.changed({self.along: np.array(self.span)})

    def opened(self, loops, size: int) -> Opened | None:
        """The loops of `size` slices without the number, see `Opened`; None if it is not one scalar gain of a frame."""
        return Opened.of(loops, self.number, size, felt=self.felt)

    def _alone(self, loops, size):
        """The same, a loop for every slice."""
        return Opened.of_each(loops, self.number, size, felt=self.felt)

    def _drift_alike(self, loops, parts):
        """Whether as many shifts of the parts are opposed by nothing as of the whole, and nothing else is left out of them.

        A block that reads a part, or a hand that moves it, may make a shift of it a mode that grows with time.
        """
        over = self._over_range(loops)
        whole, *drifts = (drift_of(Loops(drawing, over.values)) for drawing in (loops.drawing, *parts))
        unread, *others = ({each.states[state] for state in each.unread} for each in (whole, *drifts))
        shifts, *own = (len(each.moved) + len(each.folded) for each in (whole, *drifts))
        return shifts == sum(own) and unread >= set().union(*others)

    def connected(self, loops, size, opened) -> Intervals:
        """The intervals of loops that are one piece; opened: without the number, see `open_loops`.

        Columns in which the search along the circle leaves a doubt are searched by panels.
        """
        if self.bound and (self.bound.damping_ratio or self.bound.bounded):
            found, of_size = self._by_discs(loops, size), self.bound.of_size
            return common([found, replace(self, bound=of_size).connected(loops, size, opened)]) if of_size else found
        if opened is None or opened.loops.cut is None:
            return self._by_lines(loops, size) if self.in_pieces else self._by_panels(loops, size)
        found = opened.known
        if found is None:
            count = int(opened.which.max()) + 1
            cut = opened.loops.alone if count == 1 else with_batch(opened.loops.cut, count)
            found = opened.intervals(cut, self.span, self.bound)
        doubtful = np.unique(found.column[found.doubt != NONE])
        if not doubtful.size:
            return found
        if not opened.alone and size > 1:  # each by itself
            for columns in _by_zeros(loops, doubtful):
                few = loops.some(columns)
                found = in_place(found, columns, self.connected(few, columns.size, self._alone(few, columns.size)))
            return found
        return in_place(found, doubtful, self._by_panels(loops.some(doubtful), doubtful.size))

    def _by_lines(self, loops, size):
        """The intervals by panels, but in columns with long dead times in which nothing crosses."""
        late = max(loops.values.get(f"block.{name}.ticks", 0) for name in loops.drawing.dead_times)
        if self.bound or late < LONG:
            return self._by_panels(loops, size)
        batch, bounds = self._batch(loops), np.stack(domains(*loops, self.along, self.span, size))
        unstable = unstable_counts(batch.frames, batch.errors, self.span, size, bounds)
        column, others = np.flatnonzero(unstable >= 0), np.flatnonzero(unstable < 0)
        stable, nowhere = unstable[column] == 0, np.full(column.size, np.nan)
        ends, zero = (np.where(stable, end, np.nan) for end in self.span), np.zeros(column.size, int)
        found = Intervals(column, stable - 1, 1 * stable, *ends, nowhere, nowhere, zero + NONE, 0.0 * zero)
        return in_place(found, others, self._by_panels(loops.some(others), others.size)) if others.size else found

    def _by_panels(self, loops, size):
        drawn = loops.drawn()
        period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,))
        batch = replace(self._batch(loops), radius=self.bound and self.bound.radius_of(period))
        bounds = domains(*loops, self.along, self.span, size)
        variable = FROM_ZERO if self.span[0] == 0 and bends_at_zero(loops.drawing, self.along) else ""
        variable = BENT if self.along in WALL and self.span[0] >= 0 else variable
        settle = settling(loops, self.along, period, self.prove) if self.prove and not self.bound else None
        found = stable_along_any(batch.frames, self.span, size, period, bounds, variable, batch.errors, settle)
        if self.span[0] <= 0 <= self.span[1]:
            found = self._meeting_one_at_zero(found, loops)
        return self._in_own_time(found, loops)

    def _by_discs(self, loops, size):
        """The intervals in which every mode has the damping ratio that is required, or is bounded in a loop that conserves."""
        drawn, batch = loops.drawn(), self._batch(loops)
        period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,))
        bounds = domains(*loops, self.along, self.span, size)
        place = Circle() if self.bound.bounded else Spiral(self.bound.damping_ratio)
        found = along_by_discs(batch.frames, batch.errors, self.span, size, period, bounds, place)
        return self._in_own_time(found, loops)

    def _in_own_time(self, found, loops):
        """Intervals whose omegas are of the rate at their ends, if the number is one that the rate of the tick follows from."""
        if self.number not in loops.drawing.rating:
            return found
        some, changed = loops.some(found.column), {}
        for end in ("low", "high"):
            there = rate_of(*some.changed({self.along: getattr(found, end)}))
            changed[f"{end}_omega"] = getattr(found, f"{end}_omega") * (there / rate_of(*some))
        return replace(found, **changed)

    def _meeting_one_at_zero(self, found, loops):
        """Intervals that end at 0 with an eigenvalue 1, if a drift of the loop is stopped by the number alone.

        An end is there if it is as near as ends are promised.
        """
        nothing = SLIVER * (self.span[1] - self.span[0])
        near = {end: np.abs(getattr(found, end)) <= nothing for end in ("low", "high")}
        if self.bound or not any(map(np.any, near.values())):
            return found
        held, free = (drift_of(each) for each in (self._over_range(loops), loops.changed({self.along: 0.0})))
        if len(free.moved) + len(free.folded) <= len(held.moved) + len(held.folded):
            return found
        changed = {}
        for end, at in near.items():
            omega = getattr(found, f"{end}_omega")
            changed[end] = np.where(at, 0.0, getattr(found, end))
            changed[f"{end}_omega"] = np.where(at & ~(omega > 0), 0.0, omega)  # another mode may cross there as well
        return replace(found, **changed)

    def _batch(self, loops) -> "_Batch":
        """The loops at values of the number, without it in their ticks if it is one scalar gain of them."""
        open_ticks, shared = None, ""
        if scalar_place(loops.drawing, self.number):
            with suppress(IllPosedLoopError), np.errstate(all="ignore"):
                one = loops.changed({self.along: 1.0})
                open_ticks = OpenTicks.of(one.drawn(self.number), one.drawn(), PRODUCT, FACTOR)
        if open_ticks is None:
            others = [path for path, v in loops.values.items() if np.ndim(v) and path != self.along]
            shared = next((path for path in others if scalar_place(loops.drawing, name_of(path))), "")
        return _Batch(loops, self.along, drift_of(self._over_range(loops)), open_ticks, shared)


@dataclass(frozen=True, slots=True, eq=False)
class Searches:
    """Searches for loops of different drawings along the same range, whose members number the loops of all.

    order: the number of states to which loops are filled up, so that all are computed in one call; 0 if they are not.
    """

    searches: tuple[Search, ...]
    order: int = 0

    def records(self) -> np.ndarray:
        """The intervals of all loops as records, sorted by slice."""
        opened = [search.opened_groups() for search in self.searches]
        if self.order:
            known = iter(with_intervals([each for groups in opened for *_, each in groups], self.order, self.searches[0].span))
            opened = [[(members, loops, next(known)) for members, loops, _ in groups] for groups in opened]
        records = np.concatenate([search.records_of(each) for search, each in zip(self.searches, opened, strict=True)])
        return records[np.argsort(records["slice"], kind="stable")]


@dataclass(frozen=True, slots=True, eq=False)
class _Batch:
    """Loops of a batch at values p of the number `along`; `number` says which of the loops.

    open_ticks: the loops without the number in their ticks, if it is one scalar gain of them. shared: path of another number
    that is one, in which loops differ: without it in their ticks these are the same loops. radius: of each loop, a circle in
    place of the unit circle.
    """

    loops: Loops
    along: str
    drift: TickDrift
    open_ticks: OpenTicks | None
    shared: str = ""
    radius: np.ndarray | None = None

    def _at(self, number, p):
        return self.loops.some(number).changed({self.along: p})

    def frames(self, number, p) -> Frames:
        """The frames, number and p being broadcast together; NaN for loops of direct terms without a solution."""
        p = np.where(p == 0, TINY, p)
        varied, shape = self._at(number, p), p.shape
        if self.open_ticks is None:
            found = self._shared(number, p) if self.shared else None
            found = frames_where_solvable(varied, self.drift, shape) if found is None else found
        else:
            E, *facts = self.open_ticks.frames(number, p)
            found = _frames(filled(without_drift(E, self.drift)), facts, shape)
        if self.radius is not None:
            found = replace(found, E=within(found.E, np.broadcast_to(self.radius[number], shape).ravel()))
        divisors = guards_at(*varied, self.along, shape)
        return replace(found, pivots=np.concatenate([found.pivots, divisors.reshape(p.size, -1)], axis=-1))

    def _shared(self, number, p):
        """The frames from ticks without the shared number; None if too few loops share them, or some have no solution."""
        number, p = (each.ravel() for each in np.broadcast_arrays(number, p))
        others = {path: v[number] for path, v in self.loops.values.items() if np.ndim(v) and path != self.shared}
        first, of = distinct_rows(others | {"real": p.real, "imag": p.imag}, p.size)
        if 2 * first.size > p.size:
            return None
        one = self._at(number[first], p[first]).changed({self.shared: 1.0})
        with suppress(IllPosedLoopError), np.errstate(all="ignore"):
            ticks = OpenTicks.of(one.drawn(name_of(self.shared)), one.drawn(), PRODUCT, FACTOR)
            E, *facts = ticks.frames(of, self.loops.values[self.shared][number])
            return _frames(filled(without_drift(E, self.drift)), facts, p.shape)
        return None

    def errors(self, number, p) -> tuple[np.ndarray, np.ndarray]:
        """Frames at values p, `(n,)`, and bounds on the errors of their entries; NaN for loops without a solution."""
        p = np.where(p == 0, TINY, p)
        try:
            at = self._at(number, p)
            ticks = self.open_ticks.closed(number, p, terms=True) if self.open_ticks else _ticks(at, terms=True)
        except IllPosedLoopError:
            if p.size == 1:
                return (np.full((1, max(2, len(self.drift.kept)), max(2, len(self.drift.kept))), np.nan),) * 2
            ones = zip(*(part.reshape(-1, 1) for part in np.broadcast_arrays(number, p)), strict=True)
            return tuple(np.concatenate(part) for part in zip(*(self.errors(*one) for one in ones), strict=True))
        with np.errstate(all="ignore"):
            E, dE = (np.broadcast_to(part, (p.size, *part.shape[-2:])) for part in errors_of_closed(ticks, self.drift))
        if self.radius is None:
            return E, dE
        radius = np.broadcast_to(self.radius[number], p.shape)
        return within(E, radius), errors_within(E, dE, radius)


def _alike(loops, columns):
    """Places of the columns whose numbers are zero alike, together."""
    return distinct([v[columns] == 0 for v in loops.values.values() if np.ndim(v)], columns.size)


def _by_zeros(loops, columns):
    """The columns whose numbers are zero alike, together."""
    return [columns[part] for part in _alike(loops, columns)]


def _frames(E, facts, shape):
    """Frames of a batch of that shape, which E, pivots and conditions broadcast to, one after the other."""
    size, (pivot, condition) = prod(shape), facts
    whole = zip((E, np.asarray(pivot)[..., None], condition), (E.shape[-2:], (1,), ()), strict=True)
    return Frames(*(np.broadcast_to(part, (*shape, *tail)).reshape(size, *tail) for part, tail in whole))


def _ticks(loops, *, terms=False):
    drawn = loops.drawn()
    with named_loops(drawn), np.errstate(all="ignore"):
        return ticks_of(drawn, alone=True, terms=terms)


def frames_where_solvable(loops: Loops, drift: TickDrift, shape: tuple[int, ...]) -> Frames:
    """The frames of a batch of that shape, which the numbers broadcast to, one after the other.

    They are NaN for loops of direct terms without a solution, which a search may come across.
    """
    size = prod(shape)
    try:
        ticks = _ticks(loops)
        with np.errstate(all="ignore"):
            return _frames(closed(ticks, drift), facts_of(ticks.maps), shape)
    except IllPosedLoopError:
        if size == 1:
            order = max(2, len(drift.kept))
            return Frames(np.full((1, order, order), np.nan), np.zeros((1, 1)), np.full(1, np.inf))
    loops = loops.changed({path: np.broadcast_to(v, shape).ravel() for path, v in loops.values.items() if np.ndim(v)})
    halves = np.array_split(np.arange(size), 2)
    return Frames.join([frames_where_solvable(loops.some(half), drift, half.shape) for half in halves])


def loop_by_loop(parts: Groups, along: str, of_loop: Callable[[Loops], np.ndarray]) -> np.ndarray:
    """Records of intervals along a number, sorted by slice, with what the hand feels at their ends.

    of_loop: gives the records of one loop.
    """
    found = {}
    for members, loops in parts:
        for place, number in enumerate(members.tolist()):
            loop = loops.one(place)
            found[number] = records = of_loop(loop)
            records["slice"] = number
            if feels(loop.drawing) and records["intervals"][0]:
                felt_at_ends(records, np.arange(records.size), partial(_felt_along, loop, along))
    return np.concatenate([found[number] for number in sorted(found)])


def _felt_along(loop, along, _, p):
    return felt_of(loop.changed({along: p}), p.size)
