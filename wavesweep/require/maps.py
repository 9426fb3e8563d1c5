"""Loops between an input and a signal as one map `T + O (z - A)^-1 G` of a frame, with bounds on
errors."""

import numpy as np

from wavesweep.engine.doubles import ENTRY_ROUNDING, SHORT_SUM_ROUNDING
from wavesweep.engine.frames import in_a_row
from wavesweep.engine.response import Bounded, Port


def over_frame(port: Port, kept, batch) -> tuple[Bounded, ...]:
    """E less identity, G, O and T of a frame, of some states, each with a bound on its error.

    With X the map from the state before the frame, and its inputs, to that before a tick, and R the
    map from the state after that tick to what follows, a tick that is off by d moves what follows
    by R d X. So, to first order, sizes are taken of products whose terms have cancelled, and bounds
    do not grow from tick to tick.
    """
    kinds = of_ticks(port, kept, batch)
    order = port.kind.tolist()
    ticks = len(order)
    n = kept.size
    states = slice(n)
    X = np.zeros((*batch, n, n + ticks))  # less identity
    before = []
    outputs = []
    for tick, kind in enumerate(order):
        e, b, c, d = (matrix for matrix, _ in kinds[kind])
        output = c @ X
        output[..., states] += c
        output[..., n + tick] += d[..., 0]
        before.append(X)
        outputs.append(output)
        X = X + e @ X
        X[..., states] += e
        X[..., n + tick] += b[..., 0]
    whole = np.concatenate([*outputs, X], -2)

    identity = np.eye(n, n + ticks)
    error = np.zeros_like(whole)
    after = np.broadcast_to(np.eye(n), (*batch, n, n))
    for tick in reversed(range(ticks)):
        (e, de), (b, db), (c, dc), (d, dd) = kinds[order[tick]]
        X = before[tick]
        size = np.abs(X + identity)
        of_state = (de + SHORT_SUM_ROUNDING * np.abs(e)) @ size + SHORT_SUM_ROUNDING * np.abs(X)
        of_state[..., states] += 2 * SHORT_SUM_ROUNDING * np.abs(e)
        of_state[..., n + tick] += (db + SHORT_SUM_ROUNDING * np.abs(b))[..., 0]
        error[..., tick + 1 :, :] += np.abs(after) @ of_state
        of_output = (dc + SHORT_SUM_ROUNDING * np.abs(c)) @ size
        of_output[..., states] += SHORT_SUM_ROUNDING * np.abs(c)
        of_output[..., n + tick] += dd[..., 0]
        error[..., tick, :] += of_output[..., 0, :]
        after = np.concatenate([c, after + after @ e], -2)
    pairs = []
    for rows in (slice(ticks, None), slice(ticks)):
        for columns in (states, slice(n, None)):
            pairs.append(Bounded(whole[..., rows, columns], error[..., rows, columns]))
    return tuple(pairs)


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
