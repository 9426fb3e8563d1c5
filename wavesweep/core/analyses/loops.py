"""Batches of loops with their numbers: their drift, frames, radii and ports, and what a hand feels there."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.core.drawing.conditions import OF_PLANT
from wavesweep.core.drawing.drawing import Drawing, path_of
from wavesweep.core.errors import IllPosedLoopError, SpecError, UsageError
from wavesweep.core.loops.domain import refuse_unsuitable
from wavesweep.core.loops.from_drawing import OUTPUT, POSITION, REACTION, twins
from wavesweep.core.loops.multirate import MultirateLoop
from wavesweep.core.monodromy.drift import TickDrift, closed_frame, drift_of_drawn, telling_frame
from wavesweep.core.reading.checking import show
from wavesweep.core.response.lifted import Lifted
from wavesweep.core.response.port import NoPositionError, Port, Ports, port_between, port_of
from wavesweep.core.response.resting import resting
from wavesweep.core.response.static import limit_of
from wavesweep.core.response.steady import GOOD, Response, respond, static_response
from wavesweep.core.stability.spectrum import radius_of
from wavesweep.core.sweep.grid import Loops, distinct_rows, drawn_groups, items_of, make_grid, own_loop

if TYPE_CHECKING:
    from wavesweep.core.energy.held_loop import HeldLoop

Route = tuple[str, str]  # names of an input and an output
SURE = 1e-6  # relative error up to which a stiffness counts as known


@contextmanager
def named_loops(drawn: MultirateLoop) -> Iterator[None]:
    """Name the blocks if an algebraic loop has no solution."""
    try:
        yield
    except IllPosedLoopError as error:
        blocks = ", ".join(drawn.direct_blocks()) or "the wires"
        raise IllPosedLoopError(
            f"the loop of direct terms through {blocks} has no solution, or none that double precision can find; put a delay "
            "or a hold into it, or change the gain that closes it"
        ) from error


def refuse_singular(spec, drawing: Drawing) -> None:
    """Raise SpecError if a loop of direct terms has no solution with the spec's own numbers."""
    blocks = _unsolvable(drawing, items_of(spec.values))
    if blocks is not None:
        path = f"block.{blocks[0]}" if blocks else "wire"
        found = f"one without, or with none that double precision can find, through {', '.join(blocks)}"
        raise SpecError([spec.mistake(path, "loops of direct terms that have a solution", found)])


@lru_cache(maxsize=64)  # a compiled loop is asked again and again
def _unsolvable(drawing, items):
    """Names of the blocks on a loop of direct terms that has no solution with these numbers; None if all have one."""
    loop = Loops(drawing, dict(items))
    try:
        drawn = loop.drawn()
    except IllPosedLoopError:  # within a plant
        return [block.name for plant in drawing.plants for block in plant.members]
    try:
        with named_loops(drawn):
            closed_frame(drawn, drift_of(loop))
    except IllPosedLoopError:
        return drawn.direct_blocks()
    return None


def drift_of(loops: Loops, out: str = "", watched=(), beside: str = "") -> TickDrift:
    """The drift of loops of a batch, whose numbers that vary are arrays; see `twins` and `drift_of_drawn`."""
    with np.errstate(all="ignore"):
        return _drift(*twins(*loops, out, beside), tuple(watched))


_drift = lru_cache(maxsize=256)(drift_of_drawn)  # twins of the same numbers are the same objects


def held_loop(loops: Loops) -> "HeldLoop":
    """The loops with a hand."""
    from wavesweep.core.energy.held_loop import HeldLoop

    return HeldLoop(*loops.read)


def frames(loops: Loops, drift: TickDrift) -> np.ndarray:
    """Frame-to-frame matrices less identity, without drift, `(..., n, n)`; see `closed_frame`."""
    drawn = loops.drawn()
    with named_loops(drawn), np.errstate(all="ignore"):
        return closed_frame(drawn, drift)


def telling_frames(loops: Loops):
    """`frames`, and whether their spectral radius is hidden: the arguments of `radius_of`; see `telling_frame`."""
    drawn = loops.drawn()
    with named_loops(drawn), np.errstate(all="ignore"):
        return telling_frame(drawn, drift_of(loops))


def radii_of(loops: Loops, size: int = 1) -> np.ndarray:
    """Spectral radius per frame of each of `size` loops, `(size,)`, without drift, as `radius_of` returns it."""
    radii = np.array(np.broadcast_to(radius_of(*telling_frames(loops)), (size,)))
    for at in np.flatnonzero(np.isnan(radii)).tolist() if size > 1 else ():
        radii[at] = radius_of(*telling_frames(loops.one(at))).item()
    return radii


def radius_over(spec, axes) -> np.ndarray:
    """Spectral radius per frame of `ratio` ticks for every combination of the axes, flat, the first axis slowest.

    The radius of a controller whose frame is a single tick, as that of direct coupling, is counted per frame of its spec.
    """
    grid = make_grid(spec, axes)
    radii = np.empty(grid.loops)
    for members, loops in drawn_groups(spec, grid.loop_values(np.arange(grid.loops)), grid.loops, rates=True):
        if spec.drawing:
            refuse_unsuitable(*loops)
        with np.errstate(over="ignore"):
            radii[members] = radii_of(loops.read, members.size) ** frames_of(loops)
    return radii[grid.slice_of(np.arange(grid.size))]


def frames_of(loops: Loops) -> int:
    """How many frames of the drawing are one of its spec: several if nothing in it runs at the slow rate.

    loops: with all numbers of the spec.
    """
    ratio = loops.values.get("rates.ratio", 1)
    return 1 if "rates.ratio" in loops.drawing.reads or isinstance(ratio, float) else ratio


def hand_of(drawing: Drawing) -> Ports:
    """The signals at the port of a hand that the drawing has."""
    return Ports(drawing.hand[0], POSITION, REACTION if drawing.hand[2] is not None else "")


def feels(drawing: Drawing) -> bool:
    """Whether a loop has a hand that may feel a wall."""
    return bool(drawing.hand and drawing.wall)


def felt_of(loops: Loops, size: int) -> np.ndarray:
    """The stiffness (N/m) that the hand feels at rest in each of `size` loops, `(size,)`; NaN where it is not known."""
    ports, felt = hand_of(loops.drawing), np.full(size, np.nan)
    try:
        drawn, drift = loops.drawn(), watched_drift(loops)
        if not (drift.moved or drift.folded):
            with suppress(IllPosedLoopError):  # of direct terms through blocks that need not run together
                felt = resting(drawn, ports).stiffness(np.arange(size), np.zeros(size))
        unknown = np.flatnonzero(np.isnan(felt))
        rates = _rates(loops)
        if drift.folded and rates:  # what drifts may depend on the rate: the loops of each one by themselves
            first, of = distinct_rows({path: rate[unknown] for path, rate in rates.items()}, unknown.size)
            for number, at in enumerate(unknown[first].tolist()):
                some, one = unknown[of == number], {path: rate[at].item() for path, rate in rates.items()}
                felt[some] = felt_of(loops.some(some).changed(one), some.size)
        elif unknown.size:
            some = drawn if unknown.size == size else loops.some(unknown).drawn()
            with named_loops(drawn):
                _, stiffness, _, unsure = static_response(Lifted.of(port_of(some, ports, drift)))
            felt[unknown] = np.where(unsure <= SURE, stiffness.real, np.nan)
    except UsageError:  # no plant has the position of the port
        pass
    except IllPosedLoopError:
        if size > 1:
            loops = loops.changed({path: np.broadcast_to(v, (size,)) for path, v in loops.values.items() if np.ndim(v)})
            return np.concatenate([felt_of(loops.some([at]), 1) for at in range(size)])
    return felt


def watched_drift(loops: Loops) -> TickDrift:
    """The drift as the hand's port sees it."""
    return drift_of(loops, watched=hand_of(loops.drawing).signals)


def _rates(loops) -> dict[str, np.ndarray]:
    """The numbers that the rate of the tick follows from, of those that vary."""
    paths = [path_of(name) for name in loops.drawing.rating]
    return {path: loops.values[path] for path in paths if np.ndim(loops.values[path])}


def ports_of_batch(loops: Loops, size: int, route: Route | None = None) -> Iterator[tuple[np.ndarray, Port]]:
    """Yield indices of some of `size` loops and their ports, those together that have one rate.

    The ports are the hand's or, if a route names an input and an output, those between them.
    """
    refuse_unsuitable(*loops)
    rates = _rates(loops)
    first, of = distinct_rows(rates, size)
    for number, at in enumerate(first.tolist()):
        members = np.flatnonzero(of == number)
        one = {path: rate[at].item() for path, rate in rates.items()}
        some = loops if first.size == 1 and not one else loops.some(members).changed(one)
        yield members, _port(some if members.size > 1 else some.one(0), route)


def _port(loops, route=None):
    if route:
        source, signal = next(each for name, each, _ in loops.drawing.inputs if name == route[0]), OUTPUT + route[1]
        drawn, drift = loops.drawn(), drift_of(loops, watched=(signal,))
        with named_loops(drawn):
            return port_between(drawn, source, signal, drift)
    ports, drawn, drift = hand_of(loops.drawing), loops.drawn(), watched_drift(loops)
    with named_loops(drawn):
        return replace(port_of(drawn, ports, drift), rest=partial(_at_rest, twins(*loops)[0], ports, drift))


@lru_cache(maxsize=256)  # twins of the same structure are the same objects
def _at_rest(twin, ports, drift):
    """What a constant force of the hand does in the end, in a loop of the same structure."""
    with np.errstate(all="ignore"):
        return limit_of(Lifted.of(port_of(twin, ports, drift)))[2]


def responses_of(loops: Loops, size: int, frequency_hz, good: float = GOOD) -> Response:
    """The steady responses of `size` loops at the hand, `(size, points)`; good: see `respond`."""
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    responses = Response(*(np.empty((size, frequency.size), kind) for kind in (complex, complex, float, float)))
    read = {path: loops.values[path] for path in loops.values.keys() & loops.drawing.reads}
    for at, port in ports_of_batch(Loops(loops.drawing, read), size):
        some = respond(Lifted.of(port), frequency, good)
        for each in fields(Response):
            getattr(responses, each.name)[at] = getattr(some, each.name)
    return responses


def port_at_hand(spec) -> Port:
    """The port of the spec's own loop. Errors: SpecError if it names no hand, or a position that no plant has in every tick."""
    if missing := spec.without_hand():
        raise SpecError(missing)
    loop = own_loop(spec)
    try:
        refuse_unsuitable(*loop)
        return _port(loop.one(0))
    except NoPositionError:
        found = spec.tables()["ports"]["hand"]["displacement"]
        raise SpecError([spec.mistake(POSITION, OF_PLANT, show(found))]) from None


def loop_at_hand(spec) -> Lifted:
    """The spec's own loop over a frame as its hand feels it. Errors: as for `port_at_hand`."""
    return Lifted.of(port_at_hand(spec))
