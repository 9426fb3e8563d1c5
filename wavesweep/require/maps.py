"""Loops between an input and a signal as one map `T + O (z - A)^-1 G` of a frame, with bounds on
errors."""

import numpy as np

from wavesweep.engine.frames import ENTRY_ROUNDING, SHORT_SUM_ROUNDING
from wavesweep.engine.response import Port, joined, plus, times

Pair = tuple[np.ndarray, np.ndarray]


def over_frame(port: Port, kept, batch) -> tuple[Pair, ...]:
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
        O.append(plus(c, times(c, E)))
        T.append(joined((times(c, G), d, inputs_to_come), -1))
        E = plus(plus(E, e), times(e, E))
        G = joined((plus(G, times(e, G)), b), -1)
    return E, G, joined(O, -2), joined(T, -2)


def _zeros(batch, rows, columns) -> Pair:
    zeros = np.zeros((*batch, rows, columns))
    return zeros, zeros


def of_ticks(port: Port, kept, batch) -> list[tuple[Pair, ...]]:
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
        ticks.append(
            (
                (e[0][:, kept_rows, kept], e[1][:, kept_rows, kept]),
                (b[0][:, kept], b[1][:, kept]),
                (c[0][:, :, kept], c[1][:, :, kept]),
                (d[0], d[1]),
            )
        )
    return ticks


def minus(pair: Pair) -> Pair:
    """The negative of a matrix."""
    return -pair[0], pair[1]


def scaled(factor: np.ndarray, pair: Pair) -> Pair:
    """A matrix times an exact factor."""
    return factor * pair[0], np.abs(factor) * (pair[1] + SHORT_SUM_ROUNDING * np.abs(pair[0]))


def transposed(pair: Pair) -> Pair:
    """The transpose of a matrix."""
    return tuple(array.mT for array in pair)
