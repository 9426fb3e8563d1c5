"""Loops that a spec draws: their frames, their stable intervals along any number, and their ports, a batch at a time."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from math import prod

import numpy as np

from wavesweep.analysis.doubt import NONE, OVERFLOW, ROUNDING
from wavesweep.analysis.intervals import Intervals, stable_along_any, stable_intervals
from wavesweep.analysis.intervals.frames import Frames
from wavesweep.analysis.response.drawn import static_port_response
from wavesweep.analysis.response.port import NoPositionError, Port, Ports, port_of
from wavesweep.analysis.response.resting import Resting, resting
from wavesweep.analysis.response.resting_frame import resting_frame, shows_at_rest
from wavesweep.analysis.spectrum import radius_of
from wavesweep.diagram import WALL, items_of
from wavesweep.diagram.assembly import (
    FACTOR,
    POSITION,
    PRODUCT,
    REACTION,
    assembled,
    direct_loops,
    guards_at,
    refuse_unsuitable,
    scalar_place,
    seen_by_hand,
    tame_pair,
)
from wavesweep.diagram.drawn import Drawn
from wavesweep.diagram.uneven import Uneven
from wavesweep.errors import IllPosedLoopError, SpecError, UsageError
from wavesweep.lifted import Cut
from wavesweep.lifted.number import OpenFrame, cut_of, open_frame
from wavesweep.lifted.open_ticks import OpenTicks, facts_of
from wavesweep.lifted.periodic import GROWN, LOST, growth_of, ticks_of
from wavesweep.lifted.tick_drift import TickDrift, closed, closed_frame, drift_of_drawn, filled, without_drift
from wavesweep.spec.checking import show
from wavesweep.spec.drawing import OF_PLANT, Drawing
from wavesweep.sweep.grid import groups, selected
from wavesweep.sweep.tasks import FELT, TINY, felt_at_ends, records_of, with_batch

Groups = tuple[tuple[np.ndarray, Mapping[str, object]], ...]
SURE = 1e-6  # relative error up to which a stiffness counts as known


@contextmanager
def named_loops(drawn: Drawn) -> Iterator[None]:
    """Name the blocks if an algebraic loop has no solution."""
    try:
        yield
    except IllPosedLoopError as error:
        blocks = ", ".join(direct_loops(drawn)) or "the wires"
        raise IllPosedLoopError(
            f"the loop of direct terms through {blocks} has no solution, or none that double precision can find; put a delay "
            "or a hold into it, or change the gain that closes it"
        ) from error


def refuse_singular(spec, drawing: Drawing | Uneven) -> None:
    """Raise SpecError if a loop of direct terms has no solution with the spec's own numbers; drawing: see `loop_of`."""
    blocks = _unsolvable(drawing, items_of(spec.values))
    if blocks is not None:
        path = f"block.{blocks[0]}" if blocks else "wire"
        found = f"one without, through {', '.join(blocks)}"
        raise SpecError([spec.mistake(path, "loops of direct terms that have a solution", found)])


@lru_cache(maxsize=64)  # a compiled loop is asked again and again
def _unsolvable(drawing, items):
    """Names of the blocks on a loop of direct terms that has no solution with these numbers; None if all have one."""
    values = dict(items)
    drawn = assembled(drawing, values)
    try:
        with named_loops(drawn):
            closed_frame(drawn, drift_of(drawing, values, values))
    except IllPosedLoopError:
        return direct_loops(drawn)
    return None


def drift_of(
    drawing: Drawing, values: Mapping[str, object], own: Mapping[str, float], out: str = "", watched=(), actual: bool = False
) -> TickDrift:
    """The drift of loops of one structure; see `tame_pair` and `drift_of_drawn`."""
    return _drift(*tame_pair(drawing, values, own, out, actual), tuple(watched))


@lru_cache(maxsize=256)  # twins of the same structure are the same objects
def _drift(one, other, watched):
    with named_loops(one):
        return drift_of_drawn(one, other, watched)


def frames(drawing: Drawing | Uneven, values: Mapping[str, object], drift: TickDrift) -> np.ndarray:
    """Frame-to-frame matrices less identity, without drift, `(..., n, n)`; see `closed_frame`."""
    drawn = assembled(drawing, values)
    with named_loops(drawn), np.errstate(all="ignore"):
        return closed_frame(drawn, drift)


def _ticks(drawing, values):
    drawn = assembled(drawing, values)
    with named_loops(drawn), np.errstate(all="ignore"):
        return ticks_of(drawn, alone=True)


def exact_cut(drawing: Drawing, values: Mapping[str, object], own: Mapping[str, float], number: str) -> Cut | None:
    """The loops cut at a number that is one scalar gain of a frame; None if it is not one."""
    found = _opened(drawing, values, own, number)
    return found and cut_of(found.frame, found.drift)


@dataclass(frozen=True, slots=True, eq=False)
class _Opened:
    """Loops without a number that is one scalar gain of their frame, with their hand if the frame may show its force."""

    drawn: Drawn
    frame: OpenFrame
    drift: TickDrift
    hand: Ports | None = None

    def at_rest(self) -> Resting | None:
        """The loops as their hand feels them at rest; None without a hand, or if the frame does not tell."""
        return self.hand and resting_frame(self.drawn, self.hand, self.frame, self.drift)


def _opened(drawing, values, own, number, felt=False) -> _Opened | None:
    """The loops without a number that is one scalar gain of a frame; None if it is not one. felt: whether to see their hand."""
    if isinstance(drawing, Uneven) or not scalar_place(drawing, number):
        return None
    path = f"numbers.{number}"
    values, own = {**values, path: 1.0}, {**own, path: 1.0}
    if drift_of(drawing, values, own).folded:  # a conserved combination, which the cut loop would take for a crossing
        return None
    drift = drift_of(drawing, values, own, number, (FACTOR,))
    if drift.folded:  # its factors depend on numbers, which may be the same in all loops
        drift = drift_of(drawing, values, own, number, (FACTOR,), actual=True)
    if drift.folded:
        return None
    drawn = assembled(drawing, values, number)
    hand = _ports(drawing) if felt and feels(drawing) and not seen_by_hand(drawing, number) else None
    if hand and not shows_at_rest(drawn, hand, (FACTOR,)):
        hand = None
    with named_loops(drawn), np.errstate(all="ignore"):
        seen = (hand.force, (hand.reaction,)) if hand else ("", ())
        frame = open_frame(drawn, PRODUCT, (FACTOR,), *seen)
    return frame and _Opened(drawn, frame, drift, hand)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnTask:
    """Stable intervals of drawn loops along the number `along` within span = (low, high).

    groups: see `IntervalTask`. own: the spec's values. bounds: the loop exists between these values of the number. If this
    is one scalar gain of a frame, it is cut out; otherwise its intervals are found by panels.
    """

    drawing: Drawing
    along: str
    span: tuple[float, float]
    bounds: tuple[float, float]
    groups: Groups
    own: Mapping[str, float]

    def records(self) -> np.ndarray:
        """The intervals as records, with the stiffness that a hand feels."""
        parts, slices = [], []
        opened = [_opened(self.drawing, values, self.own, self.number, felt=True) for _, values in self.groups]
        for (members, values), open_loops in zip(self.groups, opened, strict=True):
            parts.append(self._intervals(values, members.size, open_loops))
            slices.append(members[parts[-1].column])
        slices = np.concatenate(slices)
        order = np.argsort(slices, kind="stable")
        records = records_of(replace(Intervals.join(parts), column=slices).take(order))
        records["felt_low"] = records["felt_high"] = np.nan
        for (members, values), open_loops in zip(self.groups, opened, strict=True) if feels(self.drawing) else ():
            rows = np.flatnonzero(np.isin(records["slice"], members) & (records["intervals"] > 0))
            at = np.searchsorted(members, records["slice"][rows])
            known = (open_loops and open_loops.at_rest()) or self._resting(values)
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
        return self.along.removeprefix("numbers.")

    def _resting(self, values) -> Resting | None:
        """The loops at rest, if the number is one scalar gain of them."""
        number, values = self.number, {**values, self.along: 1.0}
        if not scalar_place(self.drawing, number) or seen_by_hand(self.drawing, number):
            return None
        with suppress(IllPosedLoopError):
            drift = _watched_drift(self.drawing, values, self.own)
            if not (drift.moved or drift.folded):
                return resting(assembled(self.drawing, values, number), _ports(self.drawing), PRODUCT, FACTOR)
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
        refuse_unsuitable(self.drawing, values)
        cut = opened and cut_of(opened.frame, opened.drift)
        if cut is not None:
            cut = with_batch(cut, size)
            found = stable_intervals(cut, "K_VE", self.span, np.zeros((size, 1)))
            return _doubted(found, cut.growth[found.column])
        drift = drift_of(self.drawing, values | {self.along: 1.0}, self.own)
        loops = _Along(self.drawing, self.along, values, drift, self._open_ticks(values))
        drawn = assembled(self.drawing, values)
        period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,))
        bent = isinstance(self.drawing, Uneven) and self.along in WALL and self.span[0] >= 0
        found = stable_along_any(loops.frames, self.span, size, period, self.bounds, bent)
        low, high = (np.where(found.count > 0, *pair) for pair in zip((found.low, found.high), self.span, strict=True))
        growth = loops.growth(found.column[:, None], np.stack([low, low / 2 + high / 2, high], axis=-1))
        return _doubted(found, growth.max(-1))


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

    def growth(self, number, p) -> np.ndarray:
        """The growth over a frame (see `growth_of`); 1 for loops of direct terms without a solution."""
        p = np.where(p == 0, TINY, p)
        try:
            ticks = self.open_ticks.closed(number, p) if self.open_ticks else _ticks(self.drawing, self._varied(number, p))
        except IllPosedLoopError:
            if p.size == 1:
                return np.ones(p.shape)
            each = zip(*(part.reshape(-1, 1) for part in np.broadcast_arrays(number, p)), strict=True)
            return np.reshape([self.growth(*one) for one in each], p.shape)
        return np.broadcast_to(growth_of(ticks.kind, [each.E for each in ticks.maps]), p.shape)

    def _varied(self, number, p):
        return selected(self.values, number) | {self.along: p}


def _doubted(found, growth):
    """Intervals in doubt where stretches of ticks grow beyond the frame that they make; growth: of each, see `growth_of`."""
    worst = np.zeros(found.column.max(initial=-1) + 1, int)
    np.maximum.at(worst, found.column, np.select([growth > LOST, growth > GROWN], [OVERFLOW, ROUNDING], NONE))
    return replace(found, doubt=np.maximum(found.doubt, worst[found.column]))


def _frames(E, facts, shape):
    """Frames of a batch of that shape, which E, pivots and conditions broadcast to, one after the other."""
    size, (pivot, condition) = prod(shape), facts
    whole = zip((E, np.asarray(pivot)[..., None], condition), (E.shape[-2:], (1,), ()), strict=True)
    return Frames(*(np.broadcast_to(part, (*shape, *tail)).reshape(size, *tail) for part, tail in whole))


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


def radii(grid) -> np.ndarray:
    """Spectral radius per frame of every slice of the grid, without drift, as `radius_of` returns it."""
    spec, drawing, found = grid.spec, grid.drawing, np.empty(grid.loops)
    for members, values in groups(spec, grid.loop_values(np.arange(grid.loops)), grid.loops):
        refuse_unsuitable(drawing, values)
        found[members] = radius_of(frames(drawing, values, drift_of(drawing, values, spec.values)))
    return found


def ports_of(spec, drawing: Drawing | Uneven) -> Ports:
    """The hand's port. Errors: SpecError if the spec names none, or if its position is none that a plant has in every tick."""
    if missing := spec.without_hand():
        raise SpecError(missing)
    ports_of_loop(spec, drawing)
    return _ports(drawing)


def _ports(drawing):
    if isinstance(drawing, Uneven):
        return Ports(*drawing.hand)
    return Ports(drawing.hand[0], POSITION, REACTION if drawing.hand[2] is not None else "")


def feels(drawing: Drawing | Uneven) -> bool:
    """Whether a loop has a hand that may feel a wall."""
    return isinstance(drawing, Uneven) or bool(drawing.hand and drawing.wall)


def felt_of(drawing: Drawing | Uneven, values: Mapping[str, object], own: Mapping[str, object], size: int) -> np.ndarray:
    """The stiffness (N/m) that the hand feels at rest in each of `size` loops, `(size,)`; NaN where it is not known."""
    ports, found = _ports(drawing), np.full(size, np.nan)
    try:
        drawn, drift = assembled(drawing, values), _watched_drift(drawing, values, own)
        if not (drift.moved or drift.folded):
            with suppress(IllPosedLoopError):  # of direct terms through blocks that need not run together
                found = resting(drawn, ports).stiffness(np.arange(size), np.zeros(size))
        unknown = np.flatnonzero(np.isnan(found))
        if unknown.size:
            some = drawn if unknown.size == size else assembled(drawing, selected(values, unknown))
            with named_loops(drawn):
                _, stiffness, _, unsure = static_port_response(port_of(some, ports, drift), twice=False)
            found[unknown] = np.where(unsure <= SURE, stiffness.real, np.nan)
    except UsageError:  # the port is none of a plant
        pass
    except IllPosedLoopError:
        if size > 1:
            values = {path: np.broadcast_to(v, (size,)) if np.ndim(v) else v for path, v in values.items()}
            return np.concatenate([felt_of(drawing, selected(values, [at]), own, 1) for at in range(size)])
    return found


def _watched_drift(drawing, values, own):
    """The drift as the hand's port sees it."""
    ports = _ports(drawing)
    shape = {path: max(np.ravel(v), key=abs) if np.ndim(v) else v for path, v in values.items()}
    return drift_of(drawing, shape, own, watched=(ports.position, *((ports.reaction,) if ports.reaction else ())))


def ports_of_groups(drawing: Drawing | Uneven, parts: Groups, own: Mapping[str, object]) -> Iterator[tuple[int, Port]]:
    """Yield the number and the port of every loop of the groups, one at a time."""
    ports = _ports(drawing)
    watched = (ports.position, *((ports.reaction,) if ports.reaction else ()))
    for members, values in parts:
        refuse_unsuitable(drawing, values)
        drift = drift_of(drawing, values, own, watched=watched)
        for at, number in enumerate(members.tolist()):
            one = {path: v.item() if isinstance(v, np.generic) else v for path, v in selected(values, at).items()}
            drawn = assembled(drawing, one)
            with named_loops(drawn):
                yield number, port_of(drawn, ports, drift)


def ports_of_loop(spec, drawing: Drawing | Uneven) -> Port:
    """The port of the spec's own loop. Errors: SpecError if its position is none that a plant has in every tick."""
    try:
        return next(ports_of_groups(drawing, ((np.zeros(1, int), dict(spec.values)),), spec.values))[1]
    except NoPositionError:
        found = spec.tables()["ports"]["hand"]["displacement"]
        raise SpecError([spec.mistake(POSITION, OF_PLANT, show(found))]) from None
