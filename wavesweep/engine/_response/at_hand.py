"""Batches of loops at their hand, or between an input and an output: ports and responses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine._drawing.drawing import path_of
from wavesweep.engine._loops.from_drawing import OUTPUT, Ports
from wavesweep.engine._loops.integrator_modes import rests
from wavesweep.engine._monodromy.drift import living_blocks
from wavesweep.engine._response.lifted import Lifted
from wavesweep.engine._response.port import Port
from wavesweep.engine._response.static import dcgain
from wavesweep.engine.loop import Loops
from wavesweep.engine.rows import distinct_rows

if TYPE_CHECKING:
    from wavesweep.engine._loops.multirate import MultirateLoop
    from wavesweep.engine._monodromy.drift import MarginalModes
    from wavesweep.engine._response.static import AtRest

Route = tuple[str, str]  # names of an input and an output


def varied_rates(loops: Loops) -> dict[str, np.ndarray]:
    """The numbers that the rate of the tick follows from, of those that vary."""
    paths = [path_of(name) for name in loops.drawing.rating]
    return {path: loops.values[path] for path in paths if np.ndim(loops.values[path])}


def ports_of_batch(
    loops: Loops, size: int, route: Route | None = None
) -> Iterator[tuple[np.ndarray, Port]]:
    """Yield indices of some of `size` loops and their ports, those together that have one rate.

    The ports are the hand's or, if a route names an input and an output, those between them.
    """
    loops.refuse_unsuitable()
    yield from ports_by_rate(loops, size, route)


def ports_by_rate(
    loops: Loops, size: int, route: Route | None = None
) -> Iterator[tuple[np.ndarray, Port]]:
    """See `ports_of_batch`; of loops that may have any numbers, such as steps of 1e-300 from 0."""
    rates = varied_rates(loops)
    if not rates:
        yield np.arange(size), port_of_loops(loops if size > 1 else loops.one(0), route)
        return
    first, label = distinct_rows(rates, size)
    for number, row in enumerate(first.tolist()):
        members = np.flatnonzero(label == number)
        values = {path: rate[row].item() for path, rate in rates.items()}
        batch = loops.some(members).changed(values)
        yield members, port_of_loops(batch if members.size > 1 else batch.one(0), route)


def port_of_loops(loops: Loops, route: Route | None = None) -> Port:
    """The port of loops of one rate: the hand's or, if a route names an input and an output,
    that between them."""
    drawn = loops.drawn()
    if route:
        source = next(signal for name, signal, _ in loops.drawing.inputs if name == route[0])
        signal = OUTPUT + route[1]
        drift = loops.drift(watched=(signal,))
        with drawn.naming_blocks():
            return Port.between(drawn, source, signal, drift)
    ports = Ports.of_hand(loops.drawing)
    drift = loops.drift_at_hand()
    with drawn.naming_blocks():
        at_rest = partial(_at_rest, loops.twins()[0], ports, drift)
        return replace(Port.of(drawn, ports, drift), rest=at_rest)


@lru_cache(maxsize=256)  # twins of the same structure are the same objects
def _at_rest(twin: MultirateLoop, ports: Ports, drift: MarginalModes) -> AtRest:
    """What a constant force of the hand does in the end, in a loop of the same structure."""
    still = rests(twin, living_blocks(twin, ports.signals), ports.force)
    with np.errstate(all="ignore"):
        return dcgain(Lifted.of(Port.of(twin, ports, drift)), still)[2]
