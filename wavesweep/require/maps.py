"""Loops between an input and a signal as one map `T + O (z - A)^-1 G` of a frame, with bounds on
errors."""

import numpy as np

from wavesweep.engine.doubles import ENTRY_ROUNDING
from wavesweep.engine.frames import Bounded, balance, in_a_row, sum_rounding
from wavesweep.engine.response import Port


def over_frame(
    port: Port, kept: np.ndarray, batch: tuple[int, ...], read: np.ndarray
) -> tuple[Bounded, ...]:
    """E less identity, G, O and T of a frame, of some states, each with a bound on its error; read:
    the ticks whose inputs are looked at.

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
    acts = np.array([(b.size != 0).any() or (d.size != 0).any() for _, b, _, d in kinds])
    acting = np.flatnonzero(acts[port.kind[read]])  # inputs, which alone are followed
    X = np.zeros((*batch, n, n + acting.size))  # less identity
    before = []
    outputs = []
    columns_of_tick = [
        n + np.flatnonzero(read[acting] == tick) for tick in range(ticks)
    ]  # column of its input
    for tick, kind in enumerate(order):
        e, b, c, d = (matrix for matrix, _ in kinds[kind])
        output = c @ X
        output[..., states] += c
        output[..., columns_of_tick[tick]] += d
        before.append(X)
        outputs.append(output)
        X = X + e @ X
        X[..., states] += e
        X[..., columns_of_tick[tick]] += b
    whole = np.concatenate([*outputs, X], -2)

    identity = np.eye(n, n + acting.size)
    error = np.zeros_like(whole)
    rounding = sum_rounding(n + 2, np.iscomplexobj(whole))
    after = np.broadcast_to(np.eye(n), (*batch, n, n))
    for tick in reversed(range(ticks)):
        e, b, c, d = kinds[order[tick]]
        X = before[tick]
        size = np.abs(X + identity)
        of_state = e.with_rounding(n + 2) @ size + rounding * np.abs(X)
        of_state[..., states] += rounding * np.abs(e.value)
        of_state[..., columns_of_tick[tick]] += b.with_rounding(n + 2)
        error[..., tick + 1 :, :] += np.abs(after) @ of_state
        of_output = c.with_rounding(n + 2) @ size
        of_output[..., states] += rounding * np.abs(c.value)
        of_output[..., columns_of_tick[tick]] += d.error
        error[..., tick, :] += of_output[..., 0, :]
        after = np.concatenate([c.value, after + after @ e.value], -2)
    columns = np.append(np.arange(n), n + acting)

    def with_all_inputs(entries: np.ndarray) -> np.ndarray:
        wide = np.zeros((*entries.shape[:-1], n + read.size), entries.dtype)
        wide[..., columns] = entries
        return wide

    frames = Bounded(whole, error).each(with_all_inputs)
    pairs = []
    for rows in (slice(ticks, None), slice(ticks)):
        for columns in (states, slice(n, None)):
            pairs.append(frames.part(..., rows, columns))
    return tuple(pairs)


def at_runs(
    port: Port, states: np.ndarray, batch: tuple[int, ...], runs: np.ndarray
) -> tuple[Bounded, ...]:
    """The same of the inputs and outputs in the ticks `runs` of a frame alone."""
    kinds = of_ticks(port, states, batch)
    n = states.size
    no_input, no_output, neither = (
        Bounded.exact(np.zeros((*batch, *shape))) for shape in ((n, 0), (0, n), (0, 0))
    )
    silent = [(e, no_input, no_output, neither) for e, _, _, _ in kinds]
    order = port.kind.copy()
    order[runs] += len(kinds)
    return in_a_row(order.tolist(), [*silent, *kinds], _joined)


def _joined(
    first: tuple[Bounded, Bounded, Bounded, Bounded],
    second: tuple[Bounded, Bounded, Bounded, Bounded],
) -> tuple[Bounded, Bounded, Bounded, Bounded]:
    """The maps of some ticks and of those that follow."""
    E_1, G_1, O_1, T_1 = first
    E_2, G_2, O_2, T_2 = second
    identity = Bounded.exact(np.eye(E_1.value.shape[-1]))
    G = Bounded.block([[(identity + E_2) @ G_1, G_2]])
    O = Bounded.block([[O_1], [O_2 @ (identity + E_1)]])
    return E_1.then(E_2), G, O, Bounded.block([[T_1, 0], [O_2 @ G_1, T_2]])


def of_ticks(
    port: Port, kept: np.ndarray, batch: tuple[int, ...]
) -> list[tuple[Bounded, Bounded, Bounded, Bounded]]:
    """E less identity, B, C and D of each kind of tick, of some states and the first output,
    each with a bound on its error.

    States are in units, powers of two, in which entries of all loops have similar sizes: in those
    of derivatives of a fast mode, pencils have no eigenvalues left but rounding.
    """
    rows = kept[:, None]
    ticks = []
    n = kept.size
    sizes = np.zeros((1, n + 1, n + 1))
    for matrices, errors in zip(port.maps, port.sizes, strict=True):
        pairs = []
        for matrix, size in zip(matrices, errors, strict=True):
            pair = Bounded(matrix, ENTRY_ROUNDING * np.abs(size))
            pairs.append(pair.each(lambda x: np.broadcast_to(x, (*batch, *x.shape[-2:]))))
        e, b, c, d = pairs
        e = e.part(..., rows, kept)
        b = b.part(..., kept, slice(None))
        c = c.part(..., kept)
        for part, at in ((e, np.s_[:n, :n]), (b, np.s_[:n, n:]), (c, np.s_[n:, :n])):
            size = np.nan_to_num(np.abs(part.value))
            sizes[0][at] += size.reshape(-1, *size.shape[-2:]).max(0)
        ticks.append((e, b, c, d))
    units = balance(sizes, thorough=True)[1][0]
    u = units[:n] / units[n]
    v = u[:, None]
    return [
        (e.each(lambda x: x * u / v), b.each(lambda x: x / v), c.each(lambda x: x * u), d)
        for e, b, c, d in ticks
    ]
