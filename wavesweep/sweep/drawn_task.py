"""Stable intervals of loops that a spec draws, along any of their numbers, a batch at a time."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from math import prod

import numpy as np

from wavesweep.analysis.doubt import NONE, OVERFLOW, ROUNDING
from wavesweep.analysis.intervals import Intervals, stable_along_any, stable_intervals
from wavesweep.analysis.intervals.any_parameter import BENT, FROM_ZERO
from wavesweep.analysis.intervals.frames import Frames
from wavesweep.analysis.intervals.shaken import shaken
from wavesweep.analysis.response.port import Ports
from wavesweep.analysis.response.resting import Resting, resting
from wavesweep.analysis.response.resting_frame import resting_frame, shows_at_rest
from wavesweep.diagram import WALL
from wavesweep.diagram.assembly import (
    FACTOR,
    PRODUCT,
    assembled,
    refuse_unsuitable,
    scalar_place,
    seen_by_hand,
    tame_pair,
)
from wavesweep.diagram.domain import bends_at_zero, domains, guards_at
from wavesweep.diagram.drawn import Drawn
from wavesweep.diagram.uneven import Uneven
from wavesweep.errors import IllPosedLoopError
from wavesweep.lifted import Cut, with_batch
from wavesweep.lifted.number import OpenFrame, cancels_between_ticks, cut_of, open_frame
from wavesweep.lifted.open_ticks import OpenTicks, facts_of
from wavesweep.lifted.periodic import GROWN, LOST, growth_of, ticks_of
from wavesweep.lifted.rounding import CANCELLED, frame_and_cancellation, hidden_in, sizes_in_all, turned
from wavesweep.lifted.tick_drift import TickDrift, closed, errors_of_closed, filled, opposed, without_drift
from wavesweep.spec.drawing import Drawing, name_of, path_of
from wavesweep.spec.expressions import names_in
from wavesweep.sweep.any_number import TINY
from wavesweep.sweep.apart import apart, common
from wavesweep.sweep.drawn_loops import Groups, drift_of, feels, felt_of, hand_of, named_loops, watched_drift
from wavesweep.sweep.grid import selected
from wavesweep.sweep.tasks import FELT, felt_at_ends, records_of


def exact_cut(drawing: Drawing, values: Mapping[str, object], own: Mapping[str, float], number: str) -> Cut | None:
    """The loops cut at a number that is one scalar gain of a frame; None if it is not one."""
    found = open_loops(drawing, values, own, number)
    return found and cut_of(found.frame, found.drift)


@dataclass(frozen=True, slots=True, eq=False)
class OpenLoops:
    """Loops without a number that is one scalar gain of their frame, with their hand if the frame may show its force."""

    drawn: Drawn
    frame: OpenFrame
    drift: TickDrift
    hand: Ports | None = None

    def at_rest(self) -> Resting | None:
        """The loops as their hand feels them at rest; None without a hand, or if the frame does not tell."""
        return self.hand and resting_frame(self.drawn, self.hand, self.frame, self.drift)


def open_loops(
    drawing: Drawing, values: Mapping[str, object], own: Mapping[str, float], number: str, *, felt: bool = False
) -> OpenLoops | None:
    """The loops without a number that is one scalar gain of a frame; None if it is not one. felt: whether to see their hand."""
    if isinstance(drawing, Uneven) or not scalar_place(drawing, number):
        return None
    path = path_of(number)
    values, own = {**values, path: 1.0}, {**own, path: 1.0}
    if drift_of(drawing, values, own).folded:  # a conserved combination, which the cut loop would take for a crossing
        return None
    drift = drift_of(drawing, values, own, number, (FACTOR,))
    if drift.folded:  # its factors depend on numbers, which may be the same in all loops
        drift = drift_of(drawing, values, own, number, (FACTOR,), actual=True)
    if drift.folded:
        return None
    drawn = assembled(drawing, values, number)
    hand = hand_of(drawing) if felt and feels(drawing) and not seen_by_hand(drawing, number) else None
    if hand and not shows_at_rest(drawn, hand, (FACTOR,)):
        hand = None
    with named_loops(drawn), np.errstate(all="ignore"):
        seen = (hand.force, (hand.reaction,)) if hand else ("", ())
        frame = open_frame(drawn, PRODUCT, (FACTOR,), *seen)
    return frame and OpenLoops(drawn, frame, drift, hand)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnTask:
    """Stable intervals of drawn loops along the number `along` within span = (low, high).

    groups: see `IntervalTask`. own: the spec's values. bounds: all loops exist between these values of the number. If this
    is one scalar gain of a frame, it is cut out; otherwise its intervals are found by panels. felt: give the stiffness that a
    hand feels at the ends too.
    """

    drawing: Drawing
    along: str
    span: tuple[float, float]
    bounds: tuple[float, float]
    groups: Groups
    own: Mapping[str, float]
    felt: bool = True

    def records(self) -> np.ndarray:
        """The intervals as records, with the stiffness that a hand feels."""
        parts, slices = [], []
        for _, values in self.groups:
            refuse_unsuitable(self.drawing, values)
        opened = [open_loops(self.drawing, values, self.own, self.number, felt=self.felt) for _, values in self.groups]
        for (members, values), each in zip(self.groups, opened, strict=True):
            parts.append(self._intervals(values, members.size, each))
            slices.append(members[parts[-1].column])
        slices = np.concatenate(slices)
        order = np.argsort(slices, kind="stable")
        records = records_of(replace(Intervals.join(parts), column=slices).take(order))
        records["felt_low"] = records["felt_high"] = np.nan
        for (members, values), each in zip(self.groups, opened, strict=True) if self.felt and feels(self.drawing) else ():
            rows = np.flatnonzero(np.isin(records["slice"], members) & (records["intervals"] > 0))
            at = np.searchsorted(members, records["slice"][rows])
            known = (each and each.at_rest()) or self._resting(values)
            if known is not None:
                for name, end in zip(FELT, ("low", "high"), strict=True):
                    records[name][rows] = known.stiffness(at, records[end][rows])
                unknown = np.flatnonzero(np.isnan([records[name][rows] for name in FELT]).any(0))
                rows, at = rows[unknown], at[unknown]

            def stiffness(some, p, values=values, at=at):
                return felt_of(self.drawing, selected(values, at[some]) | {self.along: p}, self.own, p.size)

            felt_at_ends(records, rows, stiffness)
        return records

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
            drift = watched_drift(self.drawing, values, self.own)
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

    def _intervals(self, values, size, opened):
        parts = () if isinstance(self.drawing, Uneven) else apart(self.drawing, self._silent(values))
        if len(parts) <= 1:
            return self.connected(values, size, opened)
        if not self._drift_alike(values, parts):  # a cut would leave out a mode that grows and that the number does not see
            return self.connected(values, size, None)
        domains(self.drawing, values, self.along, self.span, size)  # of what leads from one part to another, too
        alone = [replace(self, drawing=part) for part in parts]
        return common([part.connected(values, size, part.opened(values)) for part in alone])

    def _silent(self, values):
        """The ports and signals of the terms whose gain is 0 in every loop, since numbers that it is made of are 0."""
        known = values | {self.along: 1.0}
        sums = [drawn.sums for drawn in (assembled(self.drawing, known), *tame_pair(self.drawing, known, self.own))]
        gains = ((port, signal, gain) for port, terms in self.drawing.wires for signal, gain in terms)
        return frozenset(
            (port, signal)
            for port, signal, gain in gains
            if self.number not in dict(names_in(gain)) and not any(np.any(each[port][signal]) for each in sums)
        )

    def opened(self, values) -> OpenLoops | None:
        """The loops without the number, None as well if they have no solution at 0 of it, which may be beyond the range."""
        with suppress(IllPosedLoopError):
            return open_loops(self.drawing, values, self.own, self.number)
        return None

    def _drift_alike(self, values, parts):
        """Whether as many shifts of the parts are opposed by nothing as of the whole, and nothing else is left out of them.

        A block that reads a part, or a hand that moves it, may make a shift of it a mode that grows with time.
        """
        whole, *drifts = (drift_of(drawing, values | {self.along: 1.0}, self.own) for drawing in (self.drawing, *parts))
        unread, *others = ({each.states[state] for state in each.unread} for each in (whole, *drifts))
        shifts, *own = (len(each.moved) + len(each.folded) for each in (whole, *drifts))
        return shifts == sum(own) and unread >= set().union(*others)

    def connected(self, values, size, opened) -> Intervals:
        """The intervals of loops that are one piece; opened: without the number, see `open_loops`."""
        found = self._searched(values, size, opened)
        drifts = [drift_of(self.drawing, values | {self.along: 1.0}, self.own), *([opened.drift] if opened else [])]
        return _unknown(found, np.ones(found.column.size, bool)) if any(drift.vague for drift in drifts) else found

    def _searched(self, values, size, opened):
        """The same, if the drift is one."""
        cut = opened and cut_of(opened.frame, opened.drift)
        if cut is not None:
            cut = with_batch(cut, size)
            found = stable_intervals(cut, "K_VE", self.span, np.zeros((size, 1)))
            hidden = np.broadcast_to(hidden_in(opened.frame.ticks, opened.frame.growth), size)[found.column]
            hidden |= np.broadcast_to(turned(opened.frame.E, sizes_in_all(opened.frame.ticks)), size)[found.column]
            open_ = np.broadcast_to(cancels_between_ticks(opened.frame), size)[found.column]
            if (open_ & ~hidden).any():  # these terms may be nothing beside those that the number closes
                low, high = self._ends(found)
                places = np.stack([low, low / 2 + high / 2, high], axis=-1)
                hidden |= open_ & self._loops(values).examined(found.column[:, None], places)[1].any(-1)
            found = _doubted(found, cut.growth[found.column])
            found = self._unshaken(found, hidden, lambda: self._loops(values), cut.period, values)
            return _unknown(found, np.broadcast_to(opposed(opened.frame.ticks, opened.drift), size)[found.column])
        loops = self._loops(values)
        drawn = assembled(self.drawing, values)
        period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,))
        variable = self._variable()
        uneven = isinstance(self.drawing, Uneven)
        bounds = self.bounds if uneven else domains(self.drawing, values, self.along, self.span, size)
        found = stable_along_any(loops.frames, self.span, size, period, bounds, variable)
        if variable == FROM_ZERO:
            found = self._beginning_at_one(found, values)
        low, high = self._ends(found)
        growth, hidden, wrong = loops.examined(found.column[:, None], np.stack([low, low / 2 + high / 2, high], axis=-1))
        wrong = wrong.any(-1)
        for end, reached in zip(self.span, (low, high), strict=True):
            others = np.setdiff1d(found.column, found.column[reached == end])
            _, _, there = loops.examined(others, np.full(others.size, end)) if others.size else (None, None, np.zeros(0, bool))
            wrong |= np.isin(found.column, others[there])
        found = self._unshaken(_doubted(found, growth.max(-1)), hidden.any(-1), lambda: loops, period, values)
        return _unknown(found, wrong)  # at last, since it leaves a single row of a column

    def _ends(self, found):
        """The ends of each interval, or of the range in columns without one."""
        return (np.where(found.count > 0, *pair) for pair in zip((found.low, found.high), self.span, strict=True))

    def _variable(self):
        """How the number is followed; see `stable_along_any`."""
        if isinstance(self.drawing, Uneven) and self.along in WALL and self.span[0] >= 0:
            return BENT
        return FROM_ZERO if self.span[0] == 0 and bends_at_zero(self.drawing, self.along) else ""

    def _beginning_at_one(self, found, values):
        """Intervals that begin at 0 with an eigenvalue 1, if a drift of the loop is stopped by the number alone."""
        if not self._stops_drift(values):
            return found
        return replace(found, low_omega=np.where(found.low == 0, 0.0, found.low_omega))

    def _stops_drift(self, values):
        """Whether at 0 of the number, and only there, the loops have an eigenvalue that is exactly 1."""
        held, free = (drift_of(self.drawing, values | {self.along: value}, self.own) for value in (1.0, 0.0))
        return len(free.moved) + len(free.folded) > len(held.moved) + len(held.folded)

    def _loops(self, values) -> "_Along":
        drift = drift_of(self.drawing, values | {self.along: 1.0}, self.own)
        return _Along(self.drawing, self.along, values, drift, self._open_ticks(values))

    def _unshaken(self, found, hidden, loops, period, values):
        """Intervals in doubt if rounding of terms that cancel could move them.

        hidden: of which elements there are some; loops(): all loops of the batch.
        """
        some = np.flatnonzero(hidden)
        if not some.size:
            return found
        at_zero = (found.low[some] == 0) | (found.high[some] == 0)
        loops, exact = loops(), 0.0 if at_zero.any() and self.span[0] < 0 and self._stops_drift(values) else np.nan
        some = some[shaken(found.take(some), self.span, period, loops.errors, exact)]
        if some.size and loops.open_ticks:  # closing a tick may lose more than connecting it with the number in its place
            some = some[shaken(found.take(some), self.span, period, replace(loops, open_ticks=None).errors, exact)]
        return _in_doubt(found, found.column[some], np.full(some.size, ROUNDING))


@dataclass(frozen=True, slots=True, eq=False)
class _Along:
    """Loops of a batch at values p of the number `along`, `number` being those of the loops in the batch.

    open_ticks: the loops without the number in their ticks, if it is one scalar gain of them.
    """

    drawing: Drawing | Uneven
    along: str
    values: Mapping[str, object]
    drift: TickDrift
    open_ticks: OpenTicks | None

    def frames(self, number, p) -> Frames:
        """The frames, number and p being broadcast together; NaN for loops of direct terms without a solution."""
        p = np.where(p == 0, TINY, p)
        varied, shape = self._varied(number, p), p.shape
        if self.open_ticks is None:
            found = _where_solvable(self.drawing, varied, self.drift, shape)
        else:
            E, *facts = self.open_ticks.frames(number, p)
            found = _frames(filled(without_drift(E, self.drift)), facts, shape)
        divisors = guards_at(self.drawing, varied, self.along, shape)
        return replace(found, pivots=np.concatenate([found.pivots, divisors.reshape(p.size, -1)], axis=-1))

    def examined(self, number, p) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The growth over a frame (see `growth_of`), whether terms cancel in or between its ticks or turn (see `hidden_in`,
        `frame_and_cancellation`, `turned`), and whether the drift is one (see `opposed`).

        Loops of direct terms without a solution have a growth of 1.
        """
        p = np.where(p == 0, TINY, p)
        try:
            ticks = self._ticks(number, p)
        except IllPosedLoopError:
            if p.size == 1:
                return np.ones(p.shape), *np.zeros((2, *p.shape), bool)
            each = [self.examined(*one) for one in _one_by_one(number, p)]
            return tuple(np.reshape(part, p.shape) for part in zip(*each, strict=True))
        growth = growth_of(ticks.kind, [each.E for each in ticks.maps])
        with np.errstate(all="ignore"):
            E, cancellation = frame_and_cancellation(ticks.kind, [each.E for each in ticks.maps])
            hidden = hidden_in(ticks, growth) | turned(E, sizes_in_all(ticks)) | (cancellation > CANCELLED)
        wrong = opposed(ticks, self.drift)
        if self.drift.folded:  # next to 0 of the number a factor may be beyond all digits
            wrong = wrong & (p != TINY)
        return tuple(np.broadcast_to(part, p.shape) for part in (growth, hidden, wrong))

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
            return tuple(np.broadcast_to(part, (p.size, *part.shape[-2:])) for part in errors_of_closed(ticks, self.drift))

    def _ticks(self, number, p):
        """The ticks with the sizes of their terms."""
        if self.open_ticks:
            return self.open_ticks.closed(number, p, terms=True)
        return _ticks(self.drawing, self._varied(number, p), terms=True)

    def _varied(self, number, p):
        return selected(self.values, number) | {self.along: p}


def _doubted(found, growth):
    """Intervals in doubt where stretches of ticks grow beyond the frame that they make; growth: of each, see `growth_of`."""
    return _in_doubt(found, found.column, np.select([growth > LOST, growth > GROWN], [OVERFLOW, ROUNDING], NONE))


def _unknown(found, wrong):
    """No interval in columns with one that is wrong, `(rows,)`, since a mode that counts as a drift may be unstable."""
    if not wrong.any():
        return found
    of_those = np.isin(found.column, found.column[wrong])
    whole = Intervals.join([found.take(~of_those), _nothing_known(found.take(of_those))])
    return whole.take(np.argsort(whole.column, kind="stable"))


def _nothing_known(found):
    found = found.take(np.unique(found.column, return_index=True)[1])
    size = found.column.size
    known = dict.fromkeys(("low", "high", "low_omega", "high_omega"), np.full(size, np.nan))
    none = {"index": np.full(size, -1), "count": np.zeros(size, int), "residual": np.zeros(size)}
    return replace(found, **known, **none, doubt=np.maximum(found.doubt, ROUNDING))


def _in_doubt(found, column, doubt):
    """Intervals whose columns have the worst of these doubts, and of their own; column, doubt: pairs."""
    worst = np.zeros(found.column.max(initial=-1) + 1, int)
    np.maximum.at(worst, column, doubt)
    return replace(found, doubt=np.maximum(found.doubt, worst[found.column]))


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


def _where_solvable(drawing, values, drift, shape):
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
    return Frames.join([_where_solvable(drawing, selected(values, part), drift, (len(range(size)[part]),)) for part in parts])
