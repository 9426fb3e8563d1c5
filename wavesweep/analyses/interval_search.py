"""Stable intervals of loops that a spec draws, along any of their numbers, a batch at a time."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import prod

import numpy as np

from wavesweep.analyses.bound import Bound
from wavesweep.analyses.interval_records import FELT, LINES, felt_at_ends, records_of
from wavesweep.analyses.lines import lines_in_loops, strongest_in_cut
from wavesweep.analyses.loops import Groups, drift_of, feels, felt_of, hand_of, named_loops, one_loop, watched_drift
from wavesweep.analyses.open_loops import Opened, varied_beside, with_intervals
from wavesweep.analyses.proving import with_proofs
from wavesweep.analyses.subloops import apart, common
from wavesweep.controllers import WALL
from wavesweep.errors import IllPosedLoopError
from wavesweep.loops.dead_time import breaks, structure, timing
from wavesweep.loops.domain import bends_at_zero, domains, guards_at
from wavesweep.loops.from_drawing import (
    FACTOR,
    PRODUCT,
    assembled,
    rate_of,
    refuse_unsuitable,
    scalar_place,
    seen_by_hand,
    silent,
)
from wavesweep.monodromy.cut import with_batch
from wavesweep.monodromy.drift import TickDrift, closed, errors_of_closed, filled, without_drift
from wavesweep.monodromy.open_ticks import OpenTicks, facts_of
from wavesweep.monodromy.periodic import ticks_of
from wavesweep.monodromy.radius import errors_within, within
from wavesweep.response.resting import Resting, resting
from wavesweep.spec.drawing import Drawing, name_of
from wavesweep.stability import Circle, Intervals, Spiral, along_by_discs, joined, stable_along_any
from wavesweep.stability.along_any import BENT, FROM_ZERO
from wavesweep.stability.by_lines import LONG, unstable_counts
from wavesweep.stability.certificate import COUNTS, CROWDED, NONE
from wavesweep.stability.crossings import SLIVER
from wavesweep.stability.frames import Frames
from wavesweep.stability.intervals import without_seams
from wavesweep.sweep.grid import distinct, distinct_rows, selected

Parts = tuple[tuple[np.ndarray, Drawing, Mapping[str, object]], ...]  # (members, drawing, values), see `drawn_groups`
BATCH = 256  # modes that are followed through their frames at once
TINY = 1e-300  # in place of a zero, which would take a state out of the loop


@dataclass(frozen=True, slots=True, eq=False)
class DrawnTask:
    """Stable intervals of drawn loops along the number `along` within span = (low, high).

    groups: (members, values) pairs, see `groups`; the members of all of them number the loops. If the number is one scalar gain
    of a frame, it is cut out; otherwise its intervals are found by panels. felt: give the stiffness that a hand feels at the
    ends too. checked: whether the numbers are known to make loops. prove: operations of ball arithmetic that
    each column in doubt may take. bound: on the eigenvalues of a frame, in place of the unit circle.
    """

    drawing: Drawing
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

    def records_of(self, opened) -> np.ndarray:
        """The same; opened: see `opened_groups`."""
        parts, slices = [], []
        for members, values, each in opened:
            parts.append(self._intervals(values, members.size, each))
            slices.append(members[parts[-1].column])
        slices = np.concatenate(slices)
        order = np.argsort(slices, kind="stable")
        records = self._recorded(replace(Intervals.join(parts), column=slices).take(order))
        for name in (*FELT, *LINES):
            records[name] = np.nan
        for members, values, each in opened if self.felt else ():  # curves leave out what is felt, and these lines
            if feels(self.drawing):
                self._fill_in_felt(records, members, values, each)
            self._fill_in_lines(records, members, values, each)
        return records

    def _fill_in_felt(self, records, members, values, each) -> None:
        """Fill in the stiffness felt at both ends of the intervals of the loops `members`; each: see `opened_groups`."""
        rows = np.flatnonzero(records["intervals"] > 0)
        rows = rows[np.isin(records["slice"][rows], members)] if len(self.groups) > 1 else rows
        at = np.searchsorted(members, records["slice"][rows])
        known = each if each and each.loops.at_rest else self._resting(values)
        if known is not None:
            ends = np.concatenate([records[end][rows] for end in ("low", "high")])
            both = known.stiffness(np.tile(at, 2), ends)
            if known is each and each.loops.beside and np.isnan(both).any():
                both = self._felt_alone(values, np.tile(at, 2), ends, both)
            for name, part in zip(FELT, np.split(both, 2), strict=True):
                records[name][rows] = part
            unknown = np.flatnonzero(np.isnan([records[name][rows] for name in FELT]).any(0))
            rows, at = rows[unknown], at[unknown]

        def stiffness(some, p, values=values, at=at):
            found, columns = np.empty(p.size), at[some]
            alone = self.in_pieces  # each is built in its own way
            parts = (
                np.arange(p.size)[:, None]
                if alone
                else distinct([v[columns] == 0 for v in values.values() if np.ndim(v)], p.size)
            )
            values = {path: v for path, v in values.items() if not (alone and path in self.drawing.building)}
            for part in parts:
                of = selected(values, columns[part]) | {self.along: p[part]}
                found[part] = felt_of(self.drawing, of, part.size)
            return found

        if rows.size:
            felt_at_ends(records, rows, stiffness)

    def _fill_in_lines(self, records, members, values, opened) -> None:
        """Fill in the strongest line (Hz) of the oscillation that starts at each end, of the loops `members`."""
        few, bound = 1 if self.in_pieces else BATCH, self.bound or Bound()
        for end, name in zip(("low", "high"), LINES, strict=True):
            rows = np.flatnonzero(~np.isnan(records[f"{end}_omega"]) & np.isin(records["slice"], members))
            at, p, omega = np.searchsorted(members, records["slice"][rows]), records[end][rows], records[f"{end}_omega"][rows]
            if opened and opened.loops.cut and not bound.damping_ratio:
                records[name][rows] = strongest_in_cut(self.drawing, opened, at, omega, bound)
                continue
            for part in (slice(first, first + few) for first in range(0, rows.size, few)):
                records[name][rows[part]] = self._strongest(values, at[part], p[part], omega[part], bound)

    def _strongest(self, values, at, p, omega, bound):
        """The strongest line (Hz) of the modes of frequency omega of the slices `at`, if the number has the values p."""
        own = self.drawing.building if self.in_pieces else ()
        varied = selected({path: v for path, v in values.items() if path not in own}, at)
        varied |= {self.along: np.where(p == 0, TINY, p)}
        with suppress(IllPosedLoopError):
            drawn = assembled(self.drawing, varied)
            period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), p.shape)
            if drawn.ticks > 1:
                return lines_in_loops(self.drawing, varied, bound.logarithms(period, omega))[:, 0]
        return omega / (2 * np.pi)

    def _recorded(self, found):
        """Intervals as records, with those that are proved in place of those in doubt."""
        if self.prove and not self.bound:
            found = with_proofs(found, self.drawing, self.groups, self.along, self.span, self.prove)
        return records_of(found)

    def opened_groups(self) -> list[tuple[np.ndarray, Mapping[str, object], Opened | None]]:
        """The groups, and the loops of each without the number; those that such loops may have in common are one group."""
        for _, values in () if self.checked else self.groups:
            refuse_unsuitable(self.drawing, values)
        whole = self._with_zeros()
        if whole:
            opened = self.opened(whole[1], whole[0].size)
            if opened and opened.loops.beside:
                return [(*whole, opened)]
        return [(members, values, self.opened(values, members.size)) for members, values in self.groups]

    def _with_zeros(self):
        """Two groups as one, that are apart since a number which loops may be without is 0 in one of them; else None."""
        if len(self.groups) != 2:
            return None
        (first, one), (second, other) = self.groups
        arrays = [path for path, v in one.items() if np.ndim(v)]
        zero = [path for path in arrays if np.any(one[path]) != np.any(other[path])]
        alike = all(one[path] == other[path] for path in one.keys() - {*arrays})
        if not alike or zero != [varied_beside(self.drawing, one, self.number)]:
            return None
        if any(len(self._parts(values)) > 1 for values in (one, other)):
            return None
        members = np.concatenate([first, second])
        order = np.argsort(members)
        return members[order], one | {path: np.concatenate([one[path], other[path]])[order] for path in arrays}

    def _felt_alone(self, values, at, ends, known):
        """The stiffness felt of slices `at` if the number has these values, from their own loops where it is not known yet."""
        unknown = np.flatnonzero(np.isnan(known) & ~np.isnan(ends))
        for columns in _by_zeros(values, np.unique(at[unknown])):
            alone, some = self._alone(selected(values, columns), columns.size), unknown[np.isin(at[unknown], columns)]
            if alone and alone.loops.at_rest:
                known[some] = alone.stiffness(np.searchsorted(columns, at[some]), ends[some])
        return known

    @property
    def number(self) -> str:
        """Name of the number in the drawing."""
        return name_of(self.along)

    def _resting(self, values) -> Resting | None:
        """The loops at rest, if the number is one scalar gain of them."""
        number, values = self.number, {**values, self.along: 1.0}
        if not scalar_place(self.drawing, number) or seen_by_hand(self.drawing, number):
            return None
        with suppress(IllPosedLoopError):
            drift = watched_drift(self.drawing, self._along(values))
            if not (drift.moved or drift.folded):
                return resting(assembled(self.drawing, values, number), hand_of(self.drawing), PRODUCT, FACTOR)
        return None

    def _open_ticks(self, values) -> OpenTicks | None:
        """The loops without the number in their ticks, if it is one scalar gain of them."""
        number, values = self.number, {**values, self.along: 1.0}
        if scalar_place(self.drawing, number):
            with suppress(IllPosedLoopError), np.errstate(all="ignore"):
                whole, cut_open = assembled(self.drawing, values), assembled(self.drawing, values, number)
                return OpenTicks.of(cut_open, whole, PRODUCT, FACTOR)
        return None

    @property
    def in_pieces(self) -> bool:
        """Whether loops are built in another way at other values of the number, as dead times of other whole ticks are."""
        return self.number in timing(self.drawing)

    def _intervals(self, values, size, opened):
        return self._in_pieces(values, size) if self.in_pieces else self.between_breaks(values, size, opened)

    def _in_pieces(self, values, size):
        """The intervals from parts of the range, in each of which the loops are built alike."""
        arrays = {path: value for path, value in values.items() if np.ndim(value)}
        first, of = distinct_rows({path: v for path, v in arrays.items() if name_of(path) in timing(self.drawing)}, size)
        found = []
        for number, at in enumerate(first.tolist()):
            columns = np.flatnonzero(of == number)
            own, one = selected(values, columns), selected(values, at)
            ends = breaks(self.drawing, one, self.along, self.span)
            whole = without_seams(joined([self._piece(piece, own, one, columns.size) for piece in pairwise(ends)]))
            found.append(replace(whole, column=columns[whole.column]))
        whole = Intervals.join(found)
        return whole.take(np.argsort(whole.column, kind="stable"))

    def _piece(self, piece, values, one, size):
        """The intervals in a part of the range in which the loops are built as that of the numbers `one` is."""
        middle = one | {self.along: sum(piece) / 2}
        built = {path: int(each) for path, each in structure(self.drawing, middle).items()}
        return replace(self, span=piece).between_breaks(values | built, size, None)

    def about(self, value: float, enough: Callable[[], bool]) -> tuple[np.ndarray, tuple[float, float]]:
        """The intervals of a single loop about a value of the number as records, and the part of the range that was searched.

        It grows piece by piece, the nearest first, until it is `enough` or the interval of the value has both of its ends.
        """
        ((_, values),) = self.groups
        ends, own = breaks(self.drawing, values, self.along, self.span), {**values}
        first = min(max(int(np.searchsorted(ends, value)) - 1, 0), len(ends) - 2)
        last, parts = first + 1, [self._piece(ends[first : first + 2], own, own, 1)]
        while True:
            found = without_seams(joined(parts))
            inside = (found.low <= value) & (value <= found.high)
            below = value - ends[first - 1] if first and (found.low[inside] == ends[first]).all() else np.inf
            above = ends[last + 1] - value if last + 1 < len(ends) and (found.high[inside] == ends[last]).all() else np.inf
            if np.isinf(min(below, above)) or enough():
                return records_of(found), (ends[first], ends[last])
            at = first - 1 if below < above else last
            first, last = min(first, at), max(last, at + 1)
            parts.append(self._piece(ends[at : at + 2], own, own, 1))

    def between_breaks(self, values, size, opened) -> Intervals:
        """The intervals of loops that are built alike at all values of the number; opened: as for `connected`."""
        parts = self._parts(values)
        if len(parts) <= 1:
            return self.connected(values, size, opened)
        if not self._drift_alike(values, parts):  # a cut would leave out a mode that grows and that the number does not see
            return self.connected(values, size, None)
        domains(self.drawing, values, self.along, self.span, size)  # of what leads from one part to another, too
        alone = [replace(self, drawing=part, bound=self.bound and self._bound_of(part, values)) for part in parts]
        return common([part.connected(values, size, part.opened_or_none(values, size)) for part in alone])

    def _parts(self, values):
        return apart(self.drawing, self._silent(values), every=self.bound is not None)

    def _bound_of(self, part, values):
        """The bound for a part of the drawing, whose frame may be shorter."""
        return self.bound.over(assembled(self.drawing, values).ticks // assembled(part, values).ticks)

    def _silent(self, values):
        """The ports and signals of the terms whose gain is 0 in every loop, since numbers that it is made of are 0."""
        return silent(self.drawing, values | {self.along: 1.0}, self.number)

    def _along(self, values):
        """The values, with all of the range of the number."""
        return values | {self.along: np.array(self.span)}

    def opened(self, values, size: int) -> Opened | None:
        """The loops of `size` slices without the number, see `Opened`; None if it is not one scalar gain of a frame."""
        return Opened.of(self.drawing, values, self.number, size, felt=self.felt)

    def _alone(self, values, size):
        """The same, a loop for every slice."""
        return Opened.of_each(self.drawing, values, self.number, size, felt=self.felt)

    def opened_or_none(self, values, size: int) -> Opened | None:
        """The same, None as well if the loops have no solution at 0 of the number, which may be beyond the range."""
        with suppress(IllPosedLoopError):
            return self.opened(values, size)
        return None

    def _drift_alike(self, values, parts):
        """Whether as many shifts of the parts are opposed by nothing as of the whole, and nothing else is left out of them.

        A block that reads a part, or a hand that moves it, may make a shift of it a mode that grows with time.
        """
        whole, *drifts = (drift_of(drawing, self._along(values)) for drawing in (self.drawing, *parts))
        unread, *others = ({each.states[state] for state in each.unread} for each in (whole, *drifts))
        shifts, *own = (len(each.moved) + len(each.folded) for each in (whole, *drifts))
        return shifts == sum(own) and unread >= set().union(*others)

    def connected(self, values, size, opened) -> Intervals:
        """The intervals of loops that are one piece; opened: without the number, see `open_loops`.

        Columns in which the search along the circle leaves a doubt are searched by panels.
        """
        if self.bound and (self.bound.damping_ratio or self.bound.bounded):
            found, of_size = self._by_discs(values, size), self.bound.of_size
            return common([found, replace(self, bound=of_size).connected(values, size, opened)]) if of_size else found
        if opened is None or opened.loops.cut is None:
            return self._by_lines(values, size) if self.in_pieces else self._by_panels(values, size)
        found = self._by_cut(opened)
        if not (found.doubt != NONE).any():
            return found
        if not opened.alone and size > 1:  # each by itself
            parts = [found.take(~np.isin(found.column, found.column[found.doubt != NONE]))]
            for columns in _by_zeros(values, np.unique(found.column[found.doubt != NONE])):
                few = selected(values, columns)
                alone = self.connected(few, columns.size, self._alone(few, columns.size))
                parts.append(replace(alone, column=columns[alone.column]))
            whole = Intervals.join(parts)
            return whole.take(np.argsort(whole.column, kind="stable"))
        again = np.unique(found.column[np.isin(found.doubt, (COUNTS, CROWDED))])
        if not again.size:
            return found
        other = self._by_panels(selected(values, again), again.size)
        proved = np.setdiff1d(np.arange(again.size), other.column[other.doubt != NONE])
        new = other.take(np.isin(other.column, proved))
        whole = Intervals.join([found.take(~np.isin(found.column, again[proved])), replace(new, column=again[new.column])])
        return whole.take(np.argsort(whole.column, kind="stable"))

    def _by_cut(self, opened):
        if opened.known is not None:
            return opened.known
        loops, size = opened.loops, int(opened.which.max()) + 1
        return opened.intervals(loops.alone if size == 1 else with_batch(loops.cut, size), self.span, self.bound)

    def _by_lines(self, values, size):
        """The intervals by panels, but in columns with long dead times in which nothing crosses."""
        if self.bound or max(values.get(f"block.{name}.ticks", 0) for name in self.drawing.dead_times) < LONG:
            return self._by_panels(values, size)
        loops, bounds = self._loops(values), np.stack(domains(self.drawing, values, self.along, self.span, size))
        unstable = unstable_counts(loops.frames, loops.errors, self.span, size, bounds)
        column, others = np.flatnonzero(unstable >= 0), np.flatnonzero(unstable < 0)
        stable, nowhere = unstable[column] == 0, np.full(column.size, np.nan)
        ends, zero = (np.where(stable, end, np.nan) for end in self.span), np.zeros(column.size, int)
        found = Intervals(column, stable - 1, 1 * stable, *ends, nowhere, nowhere, zero + NONE, 0.0 * zero)
        if not others.size:
            return found
        more = self._by_panels(selected(values, others), others.size)
        whole = Intervals.join([found, replace(more, column=others[more.column])])
        return whole.take(np.argsort(whole.column, kind="stable"))

    def _by_panels(self, values, size):
        drawn = assembled(self.drawing, values)
        period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,))
        loops = replace(self._loops(values), radius=self.bound and self.bound.radius_of(period))
        bounds = domains(self.drawing, values, self.along, self.span, size)
        found = stable_along_any(loops.frames, self.span, size, period, bounds, self._variable(), loops.errors)
        if self.span[0] <= 0 <= self.span[1]:
            found = self._meeting_one_at_zero(found, values)
        return found if self.number not in self.drawing.rating else self._in_own_time(found, values)

    def _by_discs(self, values, size):
        """The intervals in which every mode has the damping ratio that is required, or is bounded in a loop that conserves."""
        drawn, loops = assembled(self.drawing, values), self._loops(values)
        period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,))
        bounds = domains(self.drawing, values, self.along, self.span, size)
        place = Circle() if self.bound.bounded else Spiral(self.bound.damping_ratio)
        found = along_by_discs(loops.frames, loops.errors, self.span, size, period, bounds, place)
        return found if self.number not in self.drawing.rating else self._in_own_time(found, values)

    def _in_own_time(self, found, values):
        """Intervals along a number that the rate of the tick follows from, each omega with the rate at its end."""
        own = rate_of(self.drawing, selected(values, found.column))
        changed = {}
        for end in ("low", "high"):
            there = rate_of(self.drawing, selected(values, found.column) | {self.along: getattr(found, end)})
            changed[f"{end}_omega"] = getattr(found, f"{end}_omega") * (there / own)
        return replace(found, **changed)

    def _variable(self):
        """How the number is followed; see `stable_along_any`."""
        if self.along in WALL and self.span[0] >= 0:
            return BENT
        return FROM_ZERO if self.span[0] == 0 and bends_at_zero(self.drawing, self.along) else ""

    def _meeting_one_at_zero(self, found, values):
        """Intervals that end at 0 with an eigenvalue 1, if a drift of the loop is stopped by the number alone.

        An end is there if it is as near as ends are promised.
        """
        nothing = SLIVER * (self.span[1] - self.span[0])
        near = {end: np.abs(getattr(found, end)) <= nothing for end in ("low", "high")}
        if not any(map(np.any, near.values())) or not self._stops_drift(values):
            return found
        changed = {}
        for end, at in near.items():
            omega = getattr(found, f"{end}_omega")
            changed[end] = np.where(at, 0.0, getattr(found, end))
            changed[f"{end}_omega"] = np.where(at & ~(omega > 0), 0.0, omega)  # another mode may cross there as well
        return replace(found, **changed)

    def _stops_drift(self, values):
        """Whether at 0 of the number, and only there, the loops have an eigenvalue that is exactly 1, and this is the bound."""
        if self.bound:
            return False
        held, free = (drift_of(self.drawing, each) for each in (self._along(values), values | {self.along: 0.0}))
        return len(free.moved) + len(free.folded) > len(held.moved) + len(held.folded)

    def _loops(self, values) -> "_Along":
        drift = drift_of(self.drawing, self._along(values))
        open_ticks = self._open_ticks(values)
        others = [path for path, v in values.items() if np.ndim(v) and path != self.along] if open_ticks is None else []
        shared = next((path for path in others if scalar_place(self.drawing, name_of(path))), "")
        return _Along(self.drawing, self.along, values, drift, open_ticks, shared)


@dataclass(frozen=True, slots=True, eq=False)
class SeveralTasks:
    """Tasks for loops of different drawings along the same range, whose members number the loops of all.

    order: the number of states to which loops are filled up, so that all are computed in one call; 0 if they are not.
    """

    tasks: tuple[DrawnTask, ...]
    order: int = 0

    def records(self) -> np.ndarray:
        """The intervals of all loops as records, sorted by slice."""
        opened = [task.opened_groups() for task in self.tasks]
        if self.order:
            found = iter(with_intervals([each for groups in opened for *_, each in groups], self.order, self.tasks[0].span))
            opened = [[(members, values, next(found)) for members, values, _ in groups] for groups in opened]
        found = np.concatenate([task.records_of(each) for task, each in zip(self.tasks, opened, strict=True)])
        return found[np.argsort(found["slice"], kind="stable")]


@dataclass(frozen=True, slots=True, eq=False)
class _Along:
    """Loops of a batch at values p of the number `along`, `number` being those of the loops in the batch.

    open_ticks: the loops without the number in their ticks, if it is one scalar gain of them. shared: path of another number
    that is one, in which loops differ: without it in their ticks these are the same loops. radius: of each loop, a circle in
    place of the unit circle.
    """

    drawing: Drawing
    along: str
    values: Mapping[str, object]
    drift: TickDrift
    open_ticks: OpenTicks | None
    shared: str = ""
    radius: np.ndarray | None = None

    def frames(self, number, p) -> Frames:
        """The frames, number and p being broadcast together; NaN for loops of direct terms without a solution."""
        p = np.where(p == 0, TINY, p)
        varied, shape = self._varied(number, p), p.shape
        if self.open_ticks is None:
            found = self._shared(number, p) if self.shared else None
            found = frames_where_solvable(self.drawing, varied, self.drift, shape) if found is None else found
        else:
            E, *facts = self.open_ticks.frames(number, p)
            found = _frames(filled(without_drift(E, self.drift)), facts, shape)
        if self.radius is not None:
            found = replace(found, E=within(found.E, np.broadcast_to(self.radius[number], shape).ravel()))
        divisors = guards_at(self.drawing, varied, self.along, shape)
        return replace(found, pivots=np.concatenate([found.pivots, divisors.reshape(p.size, -1)], axis=-1))

    def _shared(self, number, p):
        """The frames from ticks without the shared number; None if too few loops share them, or some have no solution."""
        number, p = (each.ravel() for each in np.broadcast_arrays(number, p))
        others = {path: v[number] for path, v in self.values.items() if np.ndim(v) and path != self.shared}
        first, of = distinct_rows(others | {"real": p.real, "imag": p.imag}, p.size)
        if 2 * first.size > p.size:
            return None
        values = selected(self.values, number[first]) | {self.along: p[first], self.shared: 1.0}
        with suppress(IllPosedLoopError), np.errstate(all="ignore"):
            whole, cut_open = assembled(self.drawing, values), assembled(self.drawing, values, name_of(self.shared))
            E, *facts = OpenTicks.of(cut_open, whole, PRODUCT, FACTOR).frames(of, self.values[self.shared][number])
            return _frames(filled(without_drift(E, self.drift)), facts, p.shape)
        return None

    def errors(self, number, p) -> tuple[np.ndarray, np.ndarray]:
        """Frames at values p, `(n,)`, and bounds on the errors of their entries; NaN for loops without a solution."""
        p = np.where(p == 0, TINY, p)
        try:
            ticks = self._ticks(number, p)
        except IllPosedLoopError:
            if p.size == 1:
                return (np.full((1, max(2, len(self.drift.kept)), max(2, len(self.drift.kept))), np.nan),) * 2
            each = [self.errors(*one) for one in _one_by_one(number, p)]
            return tuple(np.concatenate(part) for part in zip(*each, strict=True))
        with np.errstate(all="ignore"):
            E, dE = (np.broadcast_to(part, (p.size, *part.shape[-2:])) for part in errors_of_closed(ticks, self.drift))
        if self.radius is None:
            return E, dE
        radius = np.broadcast_to(self.radius[number], p.shape)
        return within(E, radius), errors_within(E, dE, radius)

    def _ticks(self, number, p):
        """The ticks with the sizes of their terms."""
        if self.open_ticks:
            return self.open_ticks.closed(number, p, terms=True)
        return _ticks(self.drawing, self._varied(number, p), terms=True)

    def _varied(self, number, p):
        return selected(self.values, number) | {self.along: p}


def _by_zeros(values, columns):
    """The columns whose numbers are zero alike, together."""
    return [columns[part] for part in distinct([v[columns] == 0 for v in values.values() if np.ndim(v)], columns.size)]


def _one_by_one(number, p):
    return zip(*(part.reshape(-1, 1) for part in np.broadcast_arrays(number, p)), strict=True)


def _frames(E, facts, shape):
    """Frames of a batch of that shape, which E, pivots and conditions broadcast to, one after the other."""
    size, (pivot, condition) = prod(shape), facts
    whole = zip((E, np.asarray(pivot)[..., None], condition), (E.shape[-2:], (1,), ()), strict=True)
    return Frames(*(np.broadcast_to(part, (*shape, *tail)).reshape(size, *tail) for part, tail in whole))


def _ticks(drawing, values, terms=False):
    drawn = assembled(drawing, values)
    with named_loops(drawn), np.errstate(all="ignore"):
        return ticks_of(drawn, alone=True, terms=terms)


def frames_where_solvable(drawing, values, drift, shape):
    """The frames of a batch of that shape, which the values broadcast to, one after the other; NaN for loops of direct terms
    without a solution, which a search may come across."""
    size = prod(shape)
    try:
        ticks = _ticks(drawing, values)
        with np.errstate(all="ignore"):
            return _frames(closed(ticks, drift), facts_of(ticks.maps), shape)
    except IllPosedLoopError:
        if size == 1:
            order = max(2, len(drift.kept))
            return Frames(np.full((1, order, order), np.nan), np.zeros((1, 1)), np.full(1, np.inf))
    values = {path: np.broadcast_to(v, shape).ravel() if np.ndim(v) else v for path, v in values.items()}
    parts = [slice(size // 2), slice(size // 2, size)]
    return Frames.join(
        [frames_where_solvable(drawing, selected(values, part), drift, (len(range(size)[part]),)) for part in parts]
    )


def loop_by_loop(parts: Parts, along: str, of_loop: Callable[[Drawing, dict], np.ndarray]) -> np.ndarray:
    """Records of intervals along a number, sorted by slice, with what the hand feels at their ends.

    parts: see `drawn_groups`. of_loop: gives the records of one loop from its drawing and its numbers.
    """
    found = {}
    for members, drawing, values in parts:
        for place, number in enumerate(members.tolist()):
            own = one_loop(values, place)
            found[number] = records = of_loop(drawing, own)
            records["slice"] = number
            if feels(drawing) and records["intervals"][0]:
                felt_at_ends(records, np.arange(records.size), partial(_felt_along, drawing, own, along))
    return np.concatenate([found[number] for number in sorted(found)])


def _felt_along(drawing, own, along, _, p):
    return felt_of(drawing, {**own, along: p}, p.size)
