"""Batches of loops at their hand, or between an input and an output: ports, responses, the stiffness at rest."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from wavesweep.engine.drawing.drawing import path_of
from wavesweep.engine.errors import IllPosedLoopError, UsageError
from wavesweep.engine.loop import Loops
from wavesweep.engine.loops.batch import distinct_rows
from wavesweep.engine.loops.from_drawing import OUTPUT
from wavesweep.engine.loops.ports import hand_of
from wavesweep.engine.response.lifted import Lifted
from wavesweep.engine.response.port import Port, port_between, port_of
from wavesweep.engine.response.resting import tick_dcgain
from wavesweep.engine.response.static import Response, dcgain
from wavesweep.engine.response.steady import GOOD, respond, static_response

Route = tuple[str, str]  # names of an input and an output
SURE = 1e-6  # relative error up to which a stiffness counts as known


def felt_of(loops: Loops, size: int) -> np.ndarray:
    """The stiffness (N/m) that the hand feels at rest in each of `size` loops, `(size,)`; NaN where it is not known."""
    felt = np.full(size, np.nan)
    try:
        _fill_felt(felt, loops)
    except UsageError:  # no plant has the position of the port
        return felt
    except IllPosedLoopError:
        if size == 1:
            return felt
        loops = loops.changed({path: np.broadcast_to(v, (size,)) for path, v in loops.values.items() if np.ndim(v)})
        return np.concatenate([felt_of(loops.some([at]), 1) for at in range(size)])
    return felt


def _fill_felt(felt, loops):
    """Write what is known of `felt_of` into the array."""
    ports, size, drawn, drift = hand_of(loops.drawing), felt.size, loops.drawn(), loops.drift_at_hand()
    if not (drift.constant or drift.varying):
        with suppress(IllPosedLoopError):  # of direct terms through blocks that need not run together
            felt[:] = tick_dcgain(drawn, ports).stiffness(np.arange(size), np.zeros(size))
    unknown = np.flatnonzero(np.isnan(felt))
    rates = _rates(loops)
    if drift.varying and rates:  # what drifts may depend on the rate: the loops of each one by themselves
        first, of = distinct_rows({path: rate[unknown] for path, rate in rates.items()}, unknown.size)
        for number, at in enumerate(unknown[first].tolist()):
            members, values = unknown[of == number], {path: rate[at].item() for path, rate in rates.items()}
            felt[members] = felt_of(loops.some(members).changed(values), members.size)
    elif unknown.size:
        drawn_unknown = drawn if unknown.size == size else loops.some(unknown).drawn()
        with drawn.naming_blocks():
            response = static_response(Lifted.of(port_of(drawn_unknown, ports, drift)))
        felt[unknown] = np.where(response.impedance_error <= SURE, response.impedance.real, np.nan)


def _rates(loops) -> dict[str, np.ndarray]:
    """The numbers that the rate of the tick follows from, of those that vary."""
    paths = [path_of(name) for name in loops.drawing.rating]
    return {path: loops.values[path] for path in paths if np.ndim(loops.values[path])}


def ports_of_batch(loops: Loops, size: int, route: Route | None = None) -> Iterator[tuple[np.ndarray, Port]]:
    """Yield indices of some of `size` loops and their ports, those together that have one rate.

    The ports are the hand's or, if a route names an input and an output, those between them.
    """
    loops.refuse_unsuitable()
    rates = _rates(loops)
    first, of = distinct_rows(rates, size)
    for number, at in enumerate(first.tolist()):
        members = np.flatnonzero(of == number)
        values = {path: rate[at].item() for path, rate in rates.items()}
        batch = loops if first.size == 1 and not values else loops.some(members).changed(values)
        yield members, port_of_loops(batch if members.size > 1 else batch.one(0), route)


def port_of_loops(loops, route=None):
    if route:
        source, signal = next(signal for name, signal, _ in loops.drawing.inputs if name == route[0]), OUTPUT + route[1]
        drawn, drift = loops.drawn(), loops.drift(watched=(signal,))
        with drawn.naming_blocks():
            return port_between(drawn, source, signal, drift)
    ports, drawn, drift = hand_of(loops.drawing), loops.drawn(), loops.drift_at_hand()
    with drawn.naming_blocks():
        return replace(port_of(drawn, ports, drift), rest=partial(_at_rest, loops.twins()[0], ports, drift))


@lru_cache(maxsize=256)  # twins of the same structure are the same objects
def _at_rest(twin, ports, drift):
    """What a constant force of the hand does in the end, in a loop of the same structure."""
    with np.errstate(all="ignore"):
        return dcgain(Lifted.of(port_of(twin, ports, drift)))[2]


def responses_of(loops: Loops, size: int, frequency_hz, good: float = GOOD) -> Response:
    """The steady responses of `size` loops at the hand, `(size, points)`; good: see `respond`."""
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    responses = Response(*(np.empty((size, frequency.size), kind) for kind in (complex, complex, float, float)))
    read = {path: loops.values[path] for path in loops.values.keys() & loops.drawing.reads}
    for at, port in ports_of_batch(Loops(loops.drawing, read), size):
        for array, values in zip(responses, respond(Lifted.of(port), frequency, good), strict=True):
            array[at] = values
    return responses
