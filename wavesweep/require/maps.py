"""Loops between an input and a signal as one map `T + O (z - A)^-1 G` of a frame, with bounds on
errors."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from wavesweep.engine.doubles import ENTRY_ROUNDING
from wavesweep.engine.frames import Bounded, balance, in_a_row, sum_rounding
from wavesweep.engine.response import Port


def over_frame(
    port: Port, kept: np.ndarray, batch: tuple[int, ...], read: np.ndarray
) -> tuple[Bounded, ...]:
    """E less identity, G, O and T of a frame, of some states, each with a bound on its error; read:
    the ticks whose inputs are looked at.
    """
    kinds = of_ticks(port, kept, batch)
    ticks = port.kind.size
    acts = np.array([(b.size != 0).any() or (d.size != 0).any() for _, b, _, d in kinds])
    acting = np.isin(np.arange(ticks), read) & acts[port.kind]  # inputs, which alone are followed
    kinds += [(e, b.part(..., slice(0)), c, d.part(..., slice(0))) for e, b, c, d in kinds]
    E, G, O, T = in_order(kinds, port.kind + len(acts) * ~acting)
    inputs = np.flatnonzero(acting[read])

    def with_all_inputs(entries: np.ndarray) -> np.ndarray:
        wide = np.zeros((*entries.shape[:-1], read.size), entries.dtype)
        wide[..., inputs] = entries
        return wide

    return E, G.each(with_all_inputs), O, T.each(with_all_inputs)


def in_order(kinds: Sequence[tuple[Bounded, ...]], order: np.ndarray) -> tuple[Bounded, ...]:
    """E less identity, G, O and T of kinds of ticks, or of frames, in this order; kinds: the same of each.

    Stretches of equal length first, each that comes again once, and then these in a row.
    """
    rows = _stretches(tuple(order.tolist()))
    of_stretch = {row: _in_order([kinds[kind] for kind in row]) for row in set(rows)}
    return _in_order([of_stretch[row] for row in rows])


@lru_cache(maxsize=64)
def _stretches(order: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Kinds of ticks in stretches of equal length, but for the last, of the length that leaves the fewest joins."""
    best = [order]
    for length in range(2, len(order) // 2 + 1):
        rows = [order[first : first + length] for first in range(0, len(order), length)]
        if length * len(set(rows)) + len(rows) < sum(map(len, set(best))) + len(best):
            best = rows
    return best


def _in_order(parts: Sequence[tuple[Bounded, ...]]) -> tuple[Bounded, ...]:
    """E less identity, G, O and T of parts of a frame in a row; parts: the same of each.

    With X the map from the state before the first part, and all inputs, to that before a part, and R the
    map from the state after that part to what follows, a part that is off by d moves what follows
    by R d X. So, to first order, sizes are taken of products whose terms have cancelled, and bounds
    do not grow from part to part.
    """
    *batch, _, n = parts[0][0].value.shape
    states = slice(n)
    last_columns = n + np.cumsum([b.value.shape[-1] for _, b, _, _ in parts])
    last_rows = np.cumsum([c.value.shape[-2] for _, _, c, _ in parts])
    columns = [
        slice(last - b.value.shape[-1], last)
        for last, (_, b, _, _) in zip(last_columns, parts, strict=True)
    ]
    X = np.zeros((*batch, n, last_columns[-1]))  # less identity
    before = []
    outputs = []
    for (E, G, O, T), inputs in zip(parts, columns, strict=True):
        e, b, c, d = (matrix for matrix, _ in (E, G, O, T))
        output = c @ X
        output[..., states] += c
        output[..., inputs] += d
        before.append(X)
        outputs.append(output)
        X = X + e @ X
        X[..., states] += e
        X[..., inputs] += b
    whole = np.concatenate([*outputs, X], -2)

    identity = np.eye(*X.shape[-2:])
    error = np.zeros_like(whole, dtype=float)
    of_complex = np.iscomplexobj(whole)
    two_sums = sum_rounding(2, of_complex)
    after = np.broadcast_to(np.eye(n), (*batch, n, n))
    for (e, b, c, d), inputs, row, X in reversed(
        list(zip(parts, columns, last_rows, before, strict=True))
    ):
        size = np.abs(X + identity)
        terms = 2 + max(_most_terms(e.value), _most_terms(c.value))
        rounding = sum_rounding(terms, of_complex)
        of_state = e.with_rounding(terms) @ size + two_sums * np.abs(X)
        of_state[..., states] += rounding * np.abs(e.value)
        of_state[..., inputs] += b.with_rounding(terms)
        error[..., row:, :] += np.abs(after) @ of_state
        of_output = c.with_rounding(terms) @ size
        of_output[..., states] += rounding * np.abs(c.value)
        of_output[..., inputs] += d.error
        error[..., row - c.value.shape[-2] : row, :] += of_output
        after = np.concatenate([c.value, after + after @ e.value], -2)
    frame = Bounded(whole, error)
    outputs = slice(last_rows[-1])
    later = slice(last_rows[-1], None)
    inputs = slice(n, None)
    return (
        frame.part(..., later, states),
        frame.part(..., later, inputs),
        frame.part(..., outputs, states),
        frame.part(..., outputs, inputs),
    )


def _most_terms(matrix: np.ndarray) -> int:
    """Most entries of a row that are not 0: products with others do not round."""
    return int((matrix != 0).sum(-1).max(initial=0))


def squares_over_frame(port: Port, kept: np.ndarray, batch: tuple[int, ...]) -> tuple[Bounded, ...]:
    """What white noise of variance 1 in each tick of a frame leaves in the states and shows in the output.

    Of `x+ = A x + G u`, `y = O x + T u` over a frame: A less identity, `G G'`, `O' O` and `sum_ij T_ij^2` as a
    matrix of one entry, each with a bound on its error. They are summed tick by tick, none of as many rows as the frame has ticks.
    """
    E, *_ = over_frame(port, kept, batch, np.arange(0))
    of_tick = [(e, b @ b.mT, c.mT @ c, d @ d.mT) for e, b, c, d in of_ticks(port, kept, batch)]
    _, *squares = in_a_row(port.kind.tolist(), of_tick, _squares_of_both)
    return E, *squares


def _squares_of_both(
    first: tuple[Bounded, Bounded, Bounded, Bounded],
    second: tuple[Bounded, Bounded, Bounded, Bounded],
) -> tuple[Bounded, Bounded, Bounded, Bounded]:
    """The squares of some ticks and of those that follow."""
    E_1, Q_1, W_1, t_1 = first
    E_2, Q_2, W_2, t_2 = second
    identity = Bounded.exact(np.eye(E_1.value.shape[-1]))
    A_1 = identity + E_1
    A_2 = identity + E_2
    shown = (W_2 * Q_1).sum((-1, -2)).each(lambda x: x[..., None, None])
    return E_1.then(E_2), A_2 @ Q_1 @ A_2.mT + Q_2, W_1 + A_1.mT @ W_2 @ A_1, t_1 + t_2 + shown


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
    """E less identity, B, C and D of each kind of tick, of the states `kept` of a port with one
    input and one output, each with a bound on its error.

    States x = u x' are in units u, powers of two, in which entries of all loops have similar sizes:
    `E_ij u_j/u_i`, `B_i/u_i` and `C_j u_j`. In units of derivatives of a fast mode, pencils have no
    eigenvalues left but rounding.
    """
    rows = kept[:, None]
    ticks = []
    n = kept.size
    sizes = np.zeros((1, n + 1, n + 1))  # of [[E, B], [C, 0]], the input and output as a state more
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
