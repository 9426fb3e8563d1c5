"""Loops between an input and a signal as one map `T + O (z - A)^-1 G` of a frame, with bounds on
errors."""

import numpy as np

from wavesweep.engine.doubles import ENTRY_ROUNDING
from wavesweep.engine.frames import in_a_row
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


def at_runs(port: Port, kept, batch, runs) -> tuple[Bounded, ...]:
    """The same of the inputs and outputs in the ticks `runs` of a frame alone."""
    kinds = of_ticks(port, kept, batch)
    n = kept.size
    no_input = _zeros(batch, n, 0)
    no_output = _zeros(batch, 0, n)
    neither = _zeros(batch, 0, 0)
    silent = [(e, no_input, no_output, neither) for e, _, _, _ in kinds]
    order = port.kind.copy()
    order[runs] += len(kinds)
    return in_a_row(order.tolist(), [*silent, *kinds], _joined)


def _joined(first, second):
    """The maps of some ticks and of those that follow."""
    E_1, G_1, O_1, T_1 = first
    E_2, G_2, O_2, T_2 = second
    E = E_1 + E_2 + E_2 @ E_1
    G = Bounded.joined((G_1 + E_2 @ G_1, G_2), -1)
    O = Bounded.joined((O_1, O_2 + O_2 @ E_1), -2)
    to_come = _zeros(T_1.value.shape[:-2], T_1.value.shape[-2], T_2.value.shape[-1])
    before = Bounded.joined((T_1, to_come), -1)
    after = Bounded.joined((O_2 @ G_1, T_2), -1)
    return E, G, O, Bounded.joined((before, after), -2)


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
