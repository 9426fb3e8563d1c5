"""Loops between an input and a signal as one map `T + O (z - A)^-1 G` of a frame, with bounds on errors."""

import numpy as np

from wavesweep.engine.frames import ENTRIES, ROUNDING
from wavesweep.engine.response import Port, joined, plus, times

Pair = tuple[np.ndarray, np.ndarray]


def over_frame(port: Port, kept, batch) -> tuple[Pair, ...]:
    """E less identity, G, O and T of a frame, of some states, each with a bound on its error."""
    ticks = of_ticks(port, kept, batch)
    n, M = kept.size, port.kind.size
    E, G, O, T = (np.zeros((*batch, n, n)),) * 2, (np.zeros((*batch, n, 0)),) * 2, [], []
    for at, kind in enumerate(port.kind.tolist()):
        e, b, c, d = ticks[kind]
        O.append(plus(c, times(c, E)))
        T.append(joined((times(c, G), d, (np.zeros((*batch, 1, M - at - 1)),) * 2), -1))
        E = plus(plus(E, e), times(e, E))
        G = joined((plus(G, times(e, G)), b), -1)
    return E, G, joined(O, -2), joined(T, -2)


def of_ticks(port: Port, kept, batch) -> list[tuple[Pair, ...]]:
    """E less identity, B, C and D of each kind of tick, of some states and the first output, each with a bound on its error."""
    ticks = []
    for matrices, sizes in zip(port.maps, port.sizes, strict=True):
        pairs = ((x, ENTRIES * np.abs(size)) for x, size in zip(matrices, sizes, strict=True))
        e, b, c, d = (tuple(np.broadcast_to(x, (*batch, *x.shape[-2:])) for x in pair) for pair in pairs)
        e, b, c = (tuple(x[:, kept[:, None], kept] for x in e), tuple(x[:, kept] for x in b), tuple(x[:, :, kept] for x in c))
        ticks.append((e, b, c, d))
    return ticks


def minus(pair: Pair) -> Pair:
    """The negative of a matrix."""
    return -pair[0], pair[1]


def scaled(factor: np.ndarray, pair: Pair) -> Pair:
    """A matrix times an exact factor."""
    return factor * pair[0], np.abs(factor) * (pair[1] + ROUNDING * np.abs(pair[0]))


def transposed(pair: Pair) -> Pair:
    """The transpose of a matrix."""
    return tuple(np.swapaxes(array, -1, -2) for array in pair)
