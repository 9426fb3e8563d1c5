"""Loops between an input and a signal as one map `T + O (z - A)^-1 G`, with bounds on errors: over a frame, or on average.

What a sine of e^{j omega} per tick does at its own frequency is the average over the ticks i of a frame: its states are those
of x[i] e^{-j omega k}, so that with all of them side by side, each tick fed by the one before,

    z x[i+1] = (1 + E[i]) x[i] + B[i] u,   y = mean of C[i] x[i] + D[i] u,   z = e^{j omega}

is a map with one input and one output, whose eigenvalues are the roots of order M of those of the frame.
"""

import numpy as np

from wavesweep.core.monodromy.rounding import ENTRIES, ROUNDING
from wavesweep.core.response.port import Port
from wavesweep.core.response.ticks import joined, plus, times

Pair = tuple[np.ndarray, np.ndarray]


def over_frame(port: Port, kept, batch) -> tuple[Pair, ...]:
    """E less identity, G, O and T of a frame, of some states, each with a bound on its error."""
    ticks = _ticks(port, kept, batch)
    n, M = kept.size, port.kind.size
    E, G, O, T = (np.zeros((*batch, n, n)),) * 2, (np.zeros((*batch, n, 0)),) * 2, [], []
    for at, kind in enumerate(port.kind.tolist()):
        e, b, c, d = ticks[kind]
        O.append(plus(c, times(c, E)))
        T.append(joined((times(c, G), d, (np.zeros((*batch, 1, M - at - 1)),) * 2), -1))
        E = plus(plus(E, e), times(e, E))
        G = joined((plus(G, times(e, G)), b), -1)
    return E, G, joined(O, -2), joined(T, -2)


def on_average(port: Port, kept, batch) -> tuple[Pair, ...]:
    """The same of the map at the frequency itself, with some states of each tick of the frame, one tick after the other."""
    ticks = [_ticks(port, kept, batch)[kind] for kind in port.kind.tolist()]
    n, M = kept.size, port.kind.size
    if M == 1:
        return ticks[0]
    E, dE = np.zeros((2, *batch, n * M, n * M), np.result_type(*(e for (e, _), *_ in ticks)))
    E[..., range(n * M), range(n * M)] = -1.0
    for at, (e, *_) in enumerate(ticks):
        own, following = slice(at * n, at * n + n), slice((at + 1) % M * n, (at + 1) % M * n + n)
        E[..., following, own], dE[..., following, own] = plus((np.eye(n), 0 * np.eye(n)), e)
    B, C, D = ([each[part] for each in ticks] for part in (1, 2, 3))
    C, D = ([(x / M, dx / M + ROUNDING * np.abs(x)) for x, dx in part] for part in (C, D))
    T = D[0]
    for each in D[1:]:
        T = plus(T, each)
    return (E, dE), joined([B[-1], *B[:-1]], -2), joined(C, -1), T


def _ticks(port, kept, batch):
    """E less identity, B, C and D of each kind of tick, of some states and the first output."""
    found = []
    for parts, sizes in zip(port.maps, port.sizes, strict=True):
        pairs = ((x, ENTRIES * np.abs(size)) for x, size in zip(parts, sizes, strict=True))
        e, b, c, d = (tuple(np.broadcast_to(x, (*batch, *x.shape[-2:])) for x in pair) for pair in pairs)
        e, b, c = (tuple(x[:, kept[:, None], kept] for x in e), tuple(x[:, kept] for x in b), tuple(x[:, :, kept] for x in c))
        found.append((e, b, c, d))
    return found
