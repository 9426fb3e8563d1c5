"""Stable intervals of loops from their frames at values of a number: by dominance, and by long dead times."""

from contextlib import suppress
from dataclasses import dataclass, replace
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.drawing.drawing import name_of
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loops.batch import Loops, distinct_rows
from wavesweep.engine.loops.controllers import WALL
from wavesweep.engine.loops.domain import bends_at_zero, domains, guards_at
from wavesweep.engine.loops.from_drawing import FACTOR, PRODUCT, rate_of, scalar_place
from wavesweep.engine.loops.resolution import ResolvedAlong
from wavesweep.engine.monodromy.drift import MarginalModes, closed, errors_of_closed, filled, without_drift
from wavesweep.engine.monodromy.open_ticks import OpenTicks, facts_of
from wavesweep.engine.monodromy.periodic import ticks_of
from wavesweep.engine.monodromy.radius import errors_within, within
from wavesweep.engine.search.interval_records import TINY
from wavesweep.engine.search.open_loops import in_place
from wavesweep.engine.search.subloops import common
from wavesweep.engine.stability.along_any import BENT, FROM_ZERO, stable_along_any
from wavesweep.engine.stability.by_lines import LONG, unstable_counts
from wavesweep.engine.stability.certificate import NONE
from wavesweep.engine.stability.crossings import SLIVER
from wavesweep.engine.stability.intervals import Intervals
from wavesweep.engine.stability.radii import drift_of, named_loops
from wavesweep.engine.stability.sampled_frames import Frames

if TYPE_CHECKING:
    from wavesweep.engine.search.interval_search import Search

OMEGAS = ("low_omega", "high_omega")


def by_dominance(search: "Search", loops: Loops, size: int) -> Intervals:
    """The intervals of `size` slices, from frames whose diagonal dominates; stretches in doubt are asked of balls."""
    period, batch, bounds, resolved = _asked(search, loops, size)
    batch = replace(batch, radius=search.bound and search.bound.radius_of(period))
    variable = FROM_ZERO if search.span[0] == 0 and bends_at_zero(loops.drawing, search.along) else ""
    variable = BENT if search.along in WALL and search.span[0] >= 0 else variable
    balls = search.prover(loops, search.along, period) if search.prover and not search.bound else None
    found = stable_along_any(batch.frames, search.span, size, period, bounds, variable, batch.errors, balls, resolved)
    if search.span[0] <= 0 <= search.span[1]:
        found = _meeting_one_at_zero(search, found, loops)
    return _in_own_time(search, found, loops)


def by_lines(search: "Search", loops: Loops, size: int) -> Intervals:
    """The same, but for slices with long dead times in which nothing crosses."""
    late = max(loops.values.get(f"block.{name}.ticks", 0) for name in loops.drawing.dead_times)
    if search.bound or late < LONG:
        return by_dominance(search, loops, size)
    _, batch, bounds, resolved = _asked(search, loops, size)
    unstable = unstable_counts(batch.frames, batch.errors, search.span, size, np.stack(bounds), resolved)
    column, others = np.flatnonzero(unstable >= 0), np.flatnonzero(unstable < 0)
    stable, nowhere = unstable[column] == 0, np.full(column.size, np.nan)
    ends, zero = (np.where(stable, end, np.nan) for end in search.span), np.zeros(column.size, int)
    found = Intervals(column, stable - 1, 1 * stable, *ends, nowhere, nowhere, zero + NONE, 0.0 * zero)
    return in_place(found, others, by_dominance(search, loops.some(others), others.size)) if others.size else found


def by_bound(search: "Search", loops: Loops, size: int) -> Intervals:
    """The intervals in which a bound holds that has a search of its own."""
    period, batch, bounds, resolved = _asked(search, loops, size)
    found = search.bound.intervals(batch.frames, batch.errors, search.span, size, period, bounds, resolved)
    return _in_own_time(search, found, loops)


def by_gain(search: "Search", loops: Loops, stable: Intervals) -> Intervals:
    """Those of some intervals in which the gain is small enough; stable: of every slice."""
    size = 1 + int(stable.column.max())
    period, _, bounds, resolved = _asked(search, loops, size)
    found = search.bound.within_gain(loops, search.along, search.span, period, bounds, resolved, stable)
    timed = _in_own_time(search, found, loops)  # ends of stability are so already; those of the gain have a minus
    omegas = {name: np.where(getattr(found, name) < 0, getattr(timed, name), getattr(found, name)) for name in OMEGAS}
    return common([stable, replace(found, **omegas)])


def _asked(search, loops, size):
    """The period of the frames, `(size,)`, the loops as frames along the number, the bounds of its values with loops, and
    between which of them all expressions of a loop are resolved."""
    drawn, along = loops.drawn(), FramesAlong.of(loops, search.along, search.span)
    period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,))
    return period, along, domains(*loops, search.along, search.span, size), ResolvedAlong(*loops, search.along)


def _in_own_time(search, found, loops):
    """Intervals whose omegas are of the rate at their ends, if the number is one that the rate of the tick follows from."""
    if search.number not in loops.drawing.rating:
        return found
    some, changed = loops.some(found.column), {}
    for end in ("low", "high"):
        there = rate_of(*some.changed({search.along: getattr(found, end)}))
        changed[f"{end}_omega"] = getattr(found, f"{end}_omega") * (there / rate_of(*some))
    return replace(found, **changed)


def _meeting_one_at_zero(search, found, loops):
    """Intervals that end at 0 with an eigenvalue 1, if a drift of the loop is stopped by the number alone.

    An end is there if it is as near as ends are promised.
    """
    nothing = SLIVER * (search.span[1] - search.span[0])
    near = {end: np.abs(getattr(found, end)) <= nothing for end in ("low", "high")}
    if search.bound or not any(map(np.any, near.values())):
        return found
    held, free = (drift_of(loops.changed({search.along: value})) for value in (np.array(search.span), 0.0))
    if len(free.constant) + len(free.varying) <= len(held.constant) + len(held.varying):
        return found
    changed = {}
    for end, at in near.items():
        omega = getattr(found, f"{end}_omega")
        changed[end] = np.where(at, 0.0, getattr(found, end))
        changed[f"{end}_omega"] = np.where(at & ~(omega > 0), 0.0, omega)  # another mode may cross there as well
    return replace(found, **changed)


@dataclass(frozen=True, slots=True, eq=False)
class FramesAlong:
    """Loops of a batch at values p of the number `along`; `number` says which of the loops.

    open_ticks: the loops without the number in their ticks, if it is one scalar gain of them. shared: path of another number
    that is one, in which loops differ: without it in their ticks these are the same loops. radius: of each loop, a circle in
    place of the unit circle.
    """

    loops: Loops
    along: str
    drift: MarginalModes
    open_ticks: OpenTicks | None
    shared: str = ""
    radius: np.ndarray | None = None

    @staticmethod
    def of(loops: Loops, along: str, span: tuple[float, float]) -> "FramesAlong":
        """The loops of a batch within a span of the number, without it in their ticks if it is one scalar gain of them."""
        open_ticks, shared = None, ""
        if scalar_place(loops.drawing, name_of(along)):
            with suppress(IllPosedLoopError), np.errstate(all="ignore"):
                one = loops.changed({along: 1.0})
                open_ticks = OpenTicks.of(one.drawn(name_of(along)), one.drawn(), PRODUCT, FACTOR)
        if open_ticks is None:
            others = [path for path, v in loops.values.items() if np.ndim(v) and path != along]
            shared = next((path for path in others if scalar_place(loops.drawing, name_of(path))), "")
        return FramesAlong(loops, along, drift_of(loops.changed({along: np.array(span)})), open_ticks, shared)

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
                return (np.full((1, max(2, len(self.drift.remaining)), max(2, len(self.drift.remaining))), np.nan),) * 2
            ones = zip(*(part.reshape(-1, 1) for part in np.broadcast_arrays(number, p)), strict=True)
            return tuple(np.concatenate(part) for part in zip(*(self.errors(*one) for one in ones), strict=True))
        with np.errstate(all="ignore"):
            E, dE = (np.broadcast_to(part, (p.size, *part.shape[-2:])) for part in errors_of_closed(ticks, self.drift))
        if self.radius is None:
            return E, dE
        radius = np.broadcast_to(self.radius[number], p.shape)
        return within(E, radius), errors_within(E, dE, radius)


def _frames(E, facts, shape):
    """Frames of a batch of that shape, which E, pivots and conditions broadcast to, one after the other."""
    size, (pivot, condition) = prod(shape), facts
    whole = zip((E, np.asarray(pivot)[..., None], condition), (E.shape[-2:], (1,), ()), strict=True)
    return Frames(*(np.broadcast_to(part, (*shape, *tail)).reshape(size, *tail) for part, tail in whole))


def _ticks(loops, *, terms=False):
    drawn = loops.drawn()
    with named_loops(drawn), np.errstate(all="ignore"):
        return ticks_of(drawn, alone=True, terms=terms)


def frames_where_solvable(loops: Loops, drift: MarginalModes, shape: tuple[int, ...]) -> Frames:
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
            order = max(2, len(drift.remaining))
            return Frames(np.full((1, order, order), np.nan), np.zeros((1, 1)), np.full(1, np.inf))
    loops = loops.changed({path: np.broadcast_to(v, shape).ravel() for path, v in loops.values.items() if np.ndim(v)})
    halves = np.array_split(np.arange(size), 2)
    return Frames.join([frames_where_solvable(loops.some(half), drift, half.shape) for half in halves])
