"""Connection of blocks of one rate through their summing junctions, with every algebraic loop
closed exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wavesweep.engine._loops.algebraic import loop_inverse
from wavesweep.engine._loops.block import Block, block_diagonal, concatenated, numbers
from wavesweep.engine._monodromy.batches import nonzero
from wavesweep.engine._state_space import StateSpace
from wavesweep.engine.doubles import EPS

# of the terms of a sum, what is left of it when it should be zero
LEFT_OF_ZERO = 8 * EPS

Gains = Mapping[str, np.ndarray | float]  # of signals in a sum


def _side_by_side(systems: Sequence[Block | StateSpace]) -> StateSpace:
    """The matrices of systems that are not connected."""
    return StateSpace(
        E=block_diagonal([system.E for system in systems]),
        B=block_diagonal([system.B for system in systems]),
        C=block_diagonal([system.C for system in systems]),
        D=block_diagonal([system.D for system in systems]),
    )


def _sizes(block: Block) -> StateSpace:
    """The sizes of the terms of the entries of a block."""
    if block.terms:
        return StateSpace(*block.terms)
    return StateSpace(np.abs(block.E), np.abs(block.B), np.abs(block.C), np.abs(block.D))


def _of_one_batch(matrices: list[np.ndarray]) -> list[np.ndarray]:
    """Matrices with the batch that they have together, if it has one axis."""
    batch = np.broadcast_shapes(*(matrix.shape[:-2] for matrix in matrices))
    if len(batch) != 1:
        return matrices
    return [np.broadcast_to(matrix, (*batch, *matrix.shape[-2:])) for matrix in matrices]


def connect(
    name: str,
    blocks: Sequence[Block],
    sums: Mapping[str, Gains],
    inputs: Sequence[str],
    outputs: Sequence[str],
    terms: bool = False,
) -> Block:
    """Close every junction among `blocks` and return one block from the signals `inputs` to the
    signals `outputs`.

    name: of the block. blocks: `Block`s of one rate. sums: signal -> {source signal: gain}. inputs:
    external signals. outputs: any signals. terms: whether the block has the sizes of the terms of
    its entries' sums (see `Block`). Errors: IllPosedLoopError if the algebraic loop through the
    direct terms is singular to working precision.

    With the blocks side by side, `y = C x + D u`, the wires `u = K y + L w` give `(I - K D) u = K C
    x + L w`. Ports are found in the order in which their direct terms need each other, so that what
    a port does not depend on is exactly zero in it. Ports that need each other are an algebraic
    loop, and are found together.
    """
    ports = [f"{block.name}.{port}" for block in blocks for port in block.inputs]
    system = _side_by_side(blocks)
    if terms:
        sizes = _side_by_side([_sizes(block) for block in blocks])
    else:
        sizes = StateSpace(*map(np.abs, system))
    wires = _wires(blocks, ports, sums, inputs, outputs, sizes)
    # A frame that overflows is for the caller to see.
    with np.errstate(over="ignore", invalid="ignore"):
        rows = _Ports(ports, name, wires.K, wires.L, system.C, system.D, sizes[2:])
        matrices = [*_connected(system, wires, rows)]
        if terms:
            matrices += _sizes_of_connected(sizes, wires, rows)
    kind = np.result_type(float, *matrices)
    matrices = _of_one_batch(matrices)
    condition = rows.condition
    pivot = rows.pivot
    states = []
    for block in blocks:
        condition = condition * block.condition
        pivot = pivot * block.pivot
        states += [f"{block.name}.{state}" for state in block.states]
    E, B, C, D = (matrix.astype(kind, copy=False) for matrix in matrices[:4])
    block = Block(name, tuple(inputs), tuple(outputs), tuple(states), E, B, C, D)
    return replace(block, condition=condition, pivot=pivot, terms=tuple(matrices[4:]))


def _connected(system: StateSpace, wires: _Wires, rows: _Ports) -> StateSpace:
    """The connected blocks, without what rounding leaves of terms that cancel."""
    shown = _times(wires.of_made, system.C)
    read = _times(wires.of_made, system.D) + wires.of_ports
    closed = _closed(system, shown, read, wires.of_inputs, rows.values)
    external = np.abs(rows.values[..., system.E.shape[-1] :])
    terms_of_B = np.abs(system.B) @ external
    terms_of_D = np.abs(wires.of_inputs) + np.abs(read) @ external
    B = _without_rounding(closed.B, terms_of_B)
    return StateSpace(closed.E, B, closed.C, _without_rounding(closed.D, terms_of_D))


def _sizes_of_connected(sizes: StateSpace, wires: _Wires, rows: _Ports) -> StateSpace:
    """The sizes of the terms of the entries' sums of the connected blocks."""
    size = np.abs(wires.of_made)
    read = size @ sizes.D + np.abs(wires.of_ports)
    return _closed(sizes, size @ sizes.C, read, np.abs(wires.of_inputs), rows.sizes)


def all_sums(blocks: Sequence[Block], sums: Mapping[str, Gains]) -> dict[str, Gains]:
    """Return the sums with those of all ports of the blocks, empty for a port that nothing
    reaches."""
    of_ports: dict[str, Gains] = {}
    for block in blocks:
        for port in block.inputs:
            of_ports[f"{block.name}.{port}"] = {}
    return of_ports | dict(sums)


def _without_rounding(matrix: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """Return sums of terms, with 0 for rounding: a wall's force may reach the avatar by +1/b and
    -1/b, which leaves eps/b."""
    negligible = np.abs(matrix) <= LEFT_OF_ZERO * terms
    return np.where(negligible & np.isfinite(terms), 0.0, matrix)


class _Wires(NamedTuple):
    """Gains of ports as sums of the blocks' outputs, K, and of external inputs, L, and of the
    signals that are shown as sums of outputs, of external inputs and of ports."""

    K: np.ndarray
    L: np.ndarray
    of_made: np.ndarray
    of_inputs: np.ndarray
    of_ports: np.ndarray


def _wires(
    blocks: Sequence[Block],
    ports: list[str],
    sums: Mapping[str, Gains],
    inputs: Sequence[str],
    outputs: Sequence[str],
    sizes: StateSpace,
) -> _Wires:
    """Return the wires; those of a port that no state and no output depends on are 0.

    Ports are `u = K y + L w` of the blocks' outputs `y = C x + D u` and the inputs w. So a port needs
    all those from which `K D` leads to it, in any number of steps. A port is read by states if B has
    a column for it, and by signals that are shown if these have it, or an output that D leads to.
    sizes: |B|, |D| and so on of all blocks.
    """
    made = [f"{block.name}.{port}" for block in blocks for port in block.outputs]
    traced: dict[str, Gains] = {signal: {signal: 1.0} for signal in (*made, *inputs)}
    wired = [_traced(port, sums, traced) for port in ports]
    shown: list[Gains] = []
    for signal in outputs:
        if signal in ports:  # itself, not its sum: that may cancel
            shown.append({signal: 1.0})
        else:
            shown.append(_traced(signal, sums, traced))
    of_made = _matrix(shown, made)
    of_inputs = _matrix(shown, inputs)
    of_ports = _matrix(shown, ports)
    K = _matrix(wired, made)
    shown_of_ports = np.abs(of_made) @ sizes.D + np.abs(of_ports)
    needs = _closure(nonzero(np.abs(K) @ sizes.D))
    read = nonzero(sizes.B).any(0) | nonzero(shown_of_ports).any(0)
    read |= needs.diagonal()  # a circle, which may have no solution
    used = (read | read @ needs).tolist()
    wired = [row if is_used else {} for row, is_used in zip(wired, used, strict=True)]
    return _Wires(_matrix(wired, made), _matrix(wired, inputs), of_made, of_inputs, of_ports)


class _Ports:
    """Ports as rows over the states of all blocks and the external inputs, `(..., ports, states +
    inputs)`.

    values, sizes: of the rows, and of the terms of their sums. condition, pivot: of the algebraic
    loops, see `Block`.
    """

    def __init__(
        self,
        ports: list[str],
        name: str,
        K: np.ndarray,
        L: np.ndarray,
        C: np.ndarray,
        D: np.ndarray,
        sizes: tuple[np.ndarray, np.ndarray],
    ) -> None:
        self.condition: np.ndarray | float = 1.0
        self.pivot: np.ndarray | complex = 1.0
        size_of_C, size_of_D = sizes
        size = np.abs(K)
        through = _times(K, D)
        driven = concatenated((_times(K, C), L), -1)
        of_through = size @ size_of_D
        of_driven = concatenated((size @ size_of_C, np.abs(L)), -1)
        needs = _closure(nonzero(of_through))
        batch = np.broadcast_shapes(through.shape[:-2], driven.shape[:-2])
        shape = (*batch, *driven.shape[-2:])
        kind = np.result_type(through, driven)
        self.values = np.broadcast_to(driven, shape).copy().astype(kind, copy=False)
        self.sizes = np.broadcast_to(of_driven, shape).copy()
        count = (needs | np.eye(len(ports), dtype=bool)).sum(-1)
        # Each port after those that it needs, which need fewer.
        for port in np.argsort(count, kind="stable").tolist():
            both = needs[port] & needs[:, port]
            loop = np.flatnonzero(both)
            before = np.flatnonzero(needs[port] & ~both)
            if not needs[port].any() or (loop.size and loop[0] != port):
                continue
            rows = loop if loop.size else np.array([port])
            from_before = _times(_picked(through, rows, before), _picked(self.values, before))
            of_before = _picked(of_through, rows, before) @ _picked(self.sizes, before)
            value = _picked(driven, rows) + from_before
            sizes = _picked(of_driven, rows) + of_before
            if loop.size:
                inside = _picked(through, rows, rows)
                of_inside = _picked(of_through, rows, rows)
                steps = np.linalg.matrix_power(np.eye(rows.size) + nonzero(inside), rows.size)
                in_loop = [ports[row] for row in rows]
                inverse, condition, pivot = loop_inverse(
                    inside, of_inside, steps > 0, name, in_loop
                )
                right = value
                value = inverse @ right
                # Refined, they are as uncertain as rounding of their equations (R. D. Skeel, 1980).
                if rows.size > 1:
                    residual = right - (value - inside @ value)
                    value = value + inverse @ residual
                size_of_value = np.abs(value)
                terms = size_of_value + sizes + of_inside @ size_of_value
                sizes = np.abs(inverse) @ terms
                self.condition = self.condition * condition
                self.pivot = self.pivot * pivot
            self.values[..., rows, :] = value
            self.sizes[..., rows, :] = sizes


def _picked(
    matrices: np.ndarray, rows: np.ndarray, columns: np.ndarray | slice = slice(None)
) -> np.ndarray:
    """Return some rows and columns, in the order of memory in which a product has the same bits
    in every batch."""
    return np.ascontiguousarray(matrices[..., rows, :][..., columns])


def _closure(needs: np.ndarray) -> np.ndarray:
    """Return which ports need which, by way of others as well."""
    for _ in range(len(needs).bit_length()):
        as_numbers = needs.astype(np.float32)  # BLAS multiplies no truth values
        further = needs | (as_numbers @ as_numbers > 0)
        if (further == needs).all():
            break
        needs = further
    return needs


def _closed(
    system: StateSpace, C: np.ndarray, read: np.ndarray, through: np.ndarray, ports: np.ndarray
) -> StateSpace:
    """Return the blocks `x+ - x = E x + B u`, with outputs `y = C x + R u + D w` in place of their
    own, connected by `u = K x + L w`; read: R; through: D; ports: `[K L]`."""
    n = system.E.shape[-1]
    K = ports[..., :n]
    L = ports[..., n:]
    return StateSpace(
        E=system.E + _times(system.B, K),
        B=_times(system.B, L),
        C=C + _times(read, K),
        D=through + _times(read, L),
    )


def _times(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Return `A B`, in which an entry that overflows is lost only for what it is multiplied
    with."""
    product = A @ B
    if np.isfinite(product).all():
        return product
    terms = (A != 0).astype(float) @ (B != 0)
    return np.where(terms > 0, product, 0.0)


def _traced(
    signal: str,
    sums: Mapping[str, Gains],
    traced: dict[str, Gains],
) -> Gains:
    """Return a signal as gains of outputs of blocks and external inputs; traced: signals whose
    gains have been found."""
    if signal not in traced:
        if signal not in sums:
            raise ValueError(f"nothing makes the signal {signal!r}")
        gains: dict[str, np.ndarray | float] = {}
        for source, gain in sums[signal].items():
            for end, factor in _traced(source, sums, traced).items():
                gains[end] = gains.get(end, 0.0) + gain * factor
        traced[signal] = gains
    return traced[signal]


def _matrix(rows: Sequence[Gains], columns: Sequence[str]) -> np.ndarray:
    """Return gains `(..., rows, columns)` of rows that have them by column; other columns are
    left out."""
    column_of = {column: k for k, column in enumerate(columns)}
    gains = {}
    for i, row in enumerate(rows):
        for column, gain in row.items():
            if column in column_of:
                gains[i, column_of[column]] = numbers(gain)
    batch = np.broadcast_shapes(*(gain.shape for gain in gains.values()))
    kind = np.result_type(float, *gains.values())
    out = np.zeros((*batch, len(rows), len(column_of)), kind)
    for (i, k), gain in gains.items():
        out[..., i, k] = gain
    return out
