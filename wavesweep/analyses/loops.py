"""Loops that a spec draws: their frames, their ports, and what a hand feels there, a batch at a time."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, replace
from functools import lru_cache, partial

import numpy as np

from wavesweep.errors import IllPosedLoopError, SpecError, UsageError
from wavesweep.loops.from_drawing import (
    OUTPUT,
    POSITION,
    REACTION,
    assembled,
    direct_loops,
    refuse_unsuitable,
    twins,
)
from wavesweep.loops.multirate import MultirateLoop
from wavesweep.monodromy.drift import TickDrift, closed_frame, drift_of_drawn, telling_frame
from wavesweep.passive.held_loop import HeldLoop
from wavesweep.response.lifted import Lifted
from wavesweep.response.port import NoPositionError, Port, Ports, port_between, port_of
from wavesweep.response.resting import resting
from wavesweep.response.static import limit_of
from wavesweep.response.steady import GOOD, Response, respond, static_response
from wavesweep.spec.checking import show
from wavesweep.spec.drawing import OF_PLANT, Drawing, path_of
from wavesweep.stability.spectrum import radius_of
from wavesweep.sweep.grid import distinct_rows, drawing_for, groups, items_of, read_by, selected

Route = tuple[str, str]  # names of an input and an output
Groups = tuple[tuple[np.ndarray, Mapping[str, object]], ...]
SURE = 1e-6  # relative error up to which a stiffness counts as known


@contextmanager
def named_loops(drawn: MultirateLoop) -> Iterator[None]:
    """Name the blocks if an algebraic loop has no solution."""
    try:
        yield
    except IllPosedLoopError as error:
        blocks = ", ".join(direct_loops(drawn)) or "the wires"
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
    values = dict(items)
    try:
        drawn = assembled(drawing, values)
    except IllPosedLoopError:  # within a plant
        return [block.name for plant in drawing.plants for block in plant.members]
    try:
        with named_loops(drawn):
            closed_frame(drawn, drift_of(drawing, values))
    except IllPosedLoopError:
        return direct_loops(drawn)
    return None


def drift_of(drawing: Drawing, values: Mapping[str, object], out: str = "", watched=(), beside: str = "") -> TickDrift:
    """The drift of loops of a batch, whose numbers that vary are arrays; see `twins` and `drift_of_drawn`."""
    with np.errstate(all="ignore"):
        return _drift(*twins(drawing, values, out, beside), tuple(watched))


_drift = lru_cache(maxsize=256)(drift_of_drawn)  # twins of the same numbers are the same objects


def held_loop(drawing: Drawing, values: Mapping[str, object]) -> HeldLoop:
    """Loops of a drawing with a hand; values: flat, with arrays over a batch."""
    return HeldLoop(drawing, read_by(drawing, values))


def frames(drawing: Drawing, values: Mapping[str, object], drift: TickDrift) -> np.ndarray:
    """Frame-to-frame matrices less identity, without drift, `(..., n, n)`; see `closed_frame`."""
    drawn = assembled(drawing, values)
    with named_loops(drawn), np.errstate(all="ignore"):
        return closed_frame(drawn, drift)


def telling_frames(drawing: Drawing, values: Mapping[str, object]):
    """`frames`, and whether their spectral radius is hidden: the arguments of `radius_of`; see `telling_frame`."""
    drawn = assembled(drawing, values)
    with named_loops(drawn), np.errstate(all="ignore"):
        return telling_frame(drawn, drift_of(drawing, values))


def radii_of(drawing: Drawing, values: Mapping[str, object], size: int) -> np.ndarray:
    """Spectral radius per frame of each of `size` loops, `(size,)`, without drift, as `radius_of` returns it."""
    found = np.array(np.broadcast_to(radius_of(*telling_frames(drawing, values)), (size,)))
    for at in np.flatnonzero(np.isnan(found)).tolist() if size > 1 else ():
        found[at] = radius_of(*telling_frames(drawing, one_loop(values, at))).item()
    return found


def one_loop(values: Mapping[str, object], at: int) -> dict:
    """The numbers of one loop of a batch."""
    return {path: v.item() if isinstance(v, np.generic) else v for path, v in selected(values, at).items()}


def radii(grid) -> np.ndarray:
    """`radii_of` every slice of the grid.

    The radius of a controller whose frame is a single tick, as that of direct coupling, is counted per frame of its spec.
    """
    spec, found = grid.spec, np.empty(grid.loops)
    for members, values in groups(spec, grid.loop_values(np.arange(grid.loops)), grid.loops, rates=True):
        drawing = drawing_for(spec, values)
        if spec.drawing:
            refuse_unsuitable(drawing, values)
        radius = radii_of(drawing, read_by(drawing, values), members.size)
        with np.errstate(over="ignore"):
            found[members] = radius ** frames_of(drawing, values)
    return found


def frames_of(drawing: Drawing, values: Mapping[str, object]) -> int:
    """How many frames of the drawing are one of its spec: several if nothing in it runs at the slow rate.

    values: all flat ones of the loop.
    """
    ratio = values.get("rates.ratio", 1)
    return 1 if "rates.ratio" in drawing.reads or isinstance(ratio, float) else ratio


def ports_of(spec, drawing: Drawing) -> Ports:
    """The hand's port. Errors: SpecError if the spec names none, or if its position is none that a plant has in every tick."""
    if missing := spec.without_hand():
        raise SpecError(missing)
    ports_of_loop(spec, drawing)
    return hand_of(drawing)


def hand_of(drawing: Drawing) -> Ports:
    """The signals at the port of a hand that the drawing has."""
    return Ports(drawing.hand[0], POSITION, REACTION if drawing.hand[2] is not None else "")


def feels(drawing: Drawing) -> bool:
    """Whether a loop has a hand that may feel a wall."""
    return bool(drawing.hand and drawing.wall)


def felt_of(drawing: Drawing, values: Mapping[str, object], size: int) -> np.ndarray:
    """The stiffness (N/m) that the hand feels at rest in each of `size` loops, `(size,)`; NaN where it is not known."""
    ports, found = hand_of(drawing), np.full(size, np.nan)
    try:
        drawn, drift = assembled(drawing, values), watched_drift(drawing, values)
        if not (drift.moved or drift.folded):
            with suppress(IllPosedLoopError):  # of direct terms through blocks that need not run together
                found = resting(drawn, ports).stiffness(np.arange(size), np.zeros(size))
        unknown = np.flatnonzero(np.isnan(found))
        rates = {path: values[path] for path in _rating(drawing) if np.ndim(values[path])}
        if drift.folded and rates:  # what drifts may depend on the rate: the loops of each one by themselves
            first, of = distinct_rows(selected(rates, unknown), unknown.size)
            for number, at in enumerate(unknown[first].tolist()):
                some, one = unknown[of == number], {path: rate[at].item() for path, rate in rates.items()}
                found[some] = felt_of(drawing, selected(values, some) | one, some.size)
        elif unknown.size:
            some = drawn if unknown.size == size else assembled(drawing, selected(values, unknown))
            with named_loops(drawn):
                _, stiffness, _, unsure = static_response(Lifted.of(port_of(some, ports, drift)))
            found[unknown] = np.where(unsure <= SURE, stiffness.real, np.nan)
    except UsageError:  # the port is none of a plant
        pass
    except IllPosedLoopError:
        if size > 1:
            values = {path: np.broadcast_to(v, (size,)) if np.ndim(v) else v for path, v in values.items()}
            return np.concatenate([felt_of(drawing, selected(values, [at]), 1) for at in range(size)])
    return found


def watched_drift(drawing: Drawing, values: Mapping[str, object]) -> TickDrift:
    """The drift as the hand's port sees it."""
    return drift_of(drawing, values, watched=hand_of(drawing).signals)


def _rating(drawing):
    """The paths of the numbers that the rate of the tick follows from."""
    return [path_of(name) for name in drawing.rating]


def ports_of_groups(drawing: Drawing, parts: Groups) -> Iterator[tuple[int, Port]]:
    """Yield the number and the port of every loop of the groups, one at a time."""
    for members, values in parts:
        refuse_unsuitable(drawing, values)
        for at, number in enumerate(members.tolist()):
            yield number, _port(drawing, one_loop(values, at))


def ports_of_batch(
    drawing: Drawing, values: Mapping[str, object], size: int, route: Route | None = None
) -> Iterator[tuple[np.ndarray, Port]]:
    """Yield indices of some of `size` loops and their ports, those together that have one rate; route: of `_port`."""
    refuse_unsuitable(drawing, values)
    rates = {path: values[path] for path in _rating(drawing) if np.ndim(values[path])}
    first, of = distinct_rows(rates, size)
    for number, at in enumerate(first.tolist()):
        members = np.flatnonzero(of == number)
        one = {path: rate[at].item() for path, rate in rates.items()}
        some = values if first.size == 1 and not one else selected(values, members) | one
        yield members, _port(drawing, some if members.size > 1 else one_loop(some, 0), route)


def _port(drawing, values, route=None):
    """The port of one loop, or of a batch: the hand's, or that between an input and an output if a route names these."""
    if route:
        source, signal = next(each for name, each, _ in drawing.inputs if name == route[0]), OUTPUT + route[1]
        drawn, drift = assembled(drawing, values), drift_of(drawing, values, watched=(signal,))
        with named_loops(drawn):
            return port_between(drawn, source, signal, drift)
    ports, drawn = hand_of(drawing), assembled(drawing, values)
    drift = drift_of(drawing, values, watched=ports.signals)
    with named_loops(drawn):
        return replace(port_of(drawn, ports, drift), rest=partial(_at_rest, twins(drawing, values)[0], ports, drift))


@lru_cache(maxsize=256)  # twins of the same structure are the same objects
def _at_rest(twin, ports, drift):
    """What a constant force of the hand does in the end, in a loop of the same structure."""
    with np.errstate(all="ignore"):
        return limit_of(Lifted.of(port_of(twin, ports, drift)))[2]


def responses_of(drawing: Drawing, values: Mapping[str, object], size: int, frequency_hz, good: float = GOOD) -> Response:
    """The steady responses of `size` loops, `(size, points)`; values: flat, with arrays over the loops; good: see `respond`."""
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    found = Response(*(np.empty((size, frequency.size), kind) for kind in (complex, complex, float, float)))
    for at, port in ports_of_batch(drawing, {path: values[path] for path in values.keys() & drawing.reads}, size):
        some = respond(Lifted.of(port), frequency, good)
        for each in fields(Response):
            getattr(found, each.name)[at] = getattr(some, each.name)
    return found


def loop_at_hand(spec) -> Lifted:
    """The spec's own loop over a frame as its hand feels it. Errors: SpecError without a hand, or as for `ports_of_loop`."""
    if missing := spec.without_hand():
        raise SpecError(missing)
    return Lifted.of(ports_of_loop(spec, drawing_for(spec, spec.values)))


def ports_of_loop(spec, drawing: Drawing) -> Port:
    """The port of the spec's own loop. Errors: SpecError if its position is none that a plant has in every tick."""
    try:
        return next(ports_of_groups(drawing, ((np.zeros(1, int), read_by(drawing, spec.values)),)))[1]
    except NoPositionError:
        found = spec.tables()["ports"]["hand"]["displacement"]
        raise SpecError([spec.mistake(POSITION, OF_PLANT, show(found))]) from None
