"""Loops between an input and a signal as one map `T + O (z - A)^-1 G` of a frame, with bounds on
errors."""

import numpy as np

from wavesweep.engine.frames import ENTRY_ROUNDING
from wavesweep.engine.response import Bounded, Port


def over_frame(port: Port, kept, batch) -> tuple[Bounded, ...]:
    """E less identity, G, O and T of a frame, of some states, each with a bound on its error."""
    kinds = of_ticks(port, kept, batch)
    n = kept.size
    ticks = port.kind.size
    E = _zeros(batch, n, n)
    G = _zeros(batch, n, 0)
    O = []
    T = []
    for tick, kind in enumerate(port.kind.tolist()):
        e, b, c, d = kinds[kind]
        inputs_to_come = _zeros(batch, 1, ticks - tick - 1)
        O.append(c + c @ E)
        T.append(Bounded.joined((c @ G, d, inputs_to_come), -1))
        E = E + e + e @ E
        G = Bounded.joined((G + e @ G, b), -1)
    return E, G, Bounded.joined(O, -2), Bounded.joined(T, -2)


def _zeros(batch, rows, columns) -> Bounded:
    zeros = np.zeros((*batch, rows, columns))
    return Bounded(zeros, zeros)


def of_ticks(port: Port, kept, batch) -> list[tuple[Bounded, ...]]:
    """E less identity, B, C and D of each kind of tick, of some states and the first output,
    each with a bound on its error."""
    kept_rows = kept[:, None]
    ticks = []
    for matrices, sizes in zip(port.maps, port.sizes, strict=True):
        pairs = []
        for matrix, size in zip(matrices, sizes, strict=True):
            error = ENTRY_ROUNDING * np.abs(size)
            pairs.append([np.broadcast_to(x, (*batch, *x.shape[-2:])) for x in (matrix, error)])
        e, b, c, d = pairs
        among_states = Bounded(e[0][:, kept_rows, kept], e[1][:, kept_rows, kept])
        into_states = Bounded(b[0][:, kept], b[1][:, kept])
        of_states = Bounded(c[0][:, :, kept], c[1][:, :, kept])
        ticks.append((among_states, into_states, of_states, Bounded(*d)))
    return ticks
