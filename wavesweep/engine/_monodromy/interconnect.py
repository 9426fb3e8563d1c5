"""Connection of blocks of one rate through their summing junctions, with every algebraic loop closed exactly."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from wavesweep.engine._loops.algebraic import loop_inverse
from wavesweep.engine._loops.block import Block, block_diagonal, concatenated, numbers
from wavesweep.engine._state_space import StateSpace

ROUNDING = 8 * np.finfo(float).eps  # of the terms of a sum, what is left of it when it should be zero


def _side_by_side(blocks) -> StateSpace:
    """The matrices of blocks that are not connected."""
    return StateSpace(*(block_diagonal([getattr(block, matrix) for block in blocks]) for matrix in "EBCD"))


def _sizes(blocks) -> StateSpace:
    """The sizes of the terms of the entries of blocks side by side."""
    of_blocks = [block.terms or [np.abs(getattr(block, matrix)) for matrix in "EBCD"] for block in blocks]
    return StateSpace(*(block_diagonal(list(matrices)) for matrices in zip(*of_blocks, strict=True)))


def _of_one_batch(matrices: list) -> list:
    """Matrices with the batch that they have together, if it has one axis."""
    batch = np.broadcast_shapes(*(matrix.shape[:-2] for matrix in matrices))
    return [np.broadcast_to(matrix, (*batch, *matrix.shape[-2:])) for matrix in matrices] if len(batch) == 1 else matrices


def connect(
    name: str,
    blocks: Sequence[Block],
    sums: Mapping[str, Mapping[str, object]],
    inputs: Sequence[str],
    outputs: Sequence[str],
    terms: bool = False,
) -> Block:
    """Close every junction among `blocks` and return one block from the signals `inputs` to the signals `outputs`.

    name: of the block. blocks: `Block`s of one rate. sums: signal -> {source signal: gain}. inputs: external signals. outputs:
    any signals. terms: whether the block has the sizes of the terms of its entries' sums (see `Block`).
    Errors: IllPosedLoopError if the algebraic loop through the direct terms is singular to working precision.

    With the blocks side by side, `y = C x + D u`, the wires `u = K y + L w` give `(I - K D) u = K C x + L w`. Ports are found
    in the order in which their direct terms need each other, so that what a port does not depend on is exactly zero in it.
    Ports that need each other are an algebraic loop, and are found together.
    """
    ports = [f"{block.name}.{port}" for block in blocks for port in block.inputs]
    system = _side_by_side(blocks)
    sizes = _sizes(blocks) if terms and blocks else StateSpace(*map(np.abs, system))
    wires = _wires(blocks, ports, sums, inputs, outputs, sizes)
    with np.errstate(over="ignore", invalid="ignore"):  # a frame that overflows is for the caller to see
        rows = _Ports(ports, name, wires.K, wires.L, system.C, system.D, sizes[2:])
        read, external = _times(wires.of_made, system.D) + wires.of_ports, rows.values[..., system.E.shape[-1] :]
        closed = _closed(system, _times(wires.of_made, system.C), read, wires.of_inputs, rows.values)
        closed = closed._replace(
            B=_without_rounding(closed.B, np.abs(system.B) @ np.abs(external)),
            D=_without_rounding(closed.D, np.abs(wires.of_inputs) + np.abs(read) @ np.abs(external)),
        )
        matrices = list(closed)
        if terms:
            size, of_read = np.abs(wires.of_made), np.abs(wires.of_made) @ sizes.D + np.abs(wires.of_ports)
            matrices += _closed(sizes, size @ sizes.C, of_read, np.abs(wires.of_inputs), rows.sizes)
    kind, matrices = np.result_type(float, *matrices), _of_one_batch(matrices)
    for block in blocks:
        rows.condition, rows.pivot = rows.condition * block.condition, rows.pivot * block.pivot
    facts = {"condition": rows.condition, "pivot": rows.pivot, "terms": tuple(matrices[4:]) or None}
    states = tuple(f"{block.name}.{state}" for block in blocks for state in block.states)
    return Block(name, tuple(inputs), tuple(outputs), states, *(m.astype(kind, copy=False) for m in matrices[:4]), **facts)


def all_sums(blocks: Sequence[Block], sums: Mapping[str, Mapping[str, object]]) -> dict:
    """Return the sums with those of all ports of the blocks, empty for a port that nothing reaches."""
    return {f"{block.name}.{port}": {} for block in blocks for port in block.inputs} | dict(sums)


def _without_rounding(matrix, terms):
    """Return sums of terms, with 0 for rounding: a wall's force may reach the avatar by +1/b and -1/b, which leaves eps/b."""
    return np.where((np.abs(matrix) <= ROUNDING * terms) & np.isfinite(terms), 0.0, matrix)


class _Wires(NamedTuple):
    """Gains of ports as sums of the blocks' outputs, K, and of external inputs, L, and of the signals that are shown as sums of
    outputs, of external inputs and of ports."""

    K: np.ndarray
    L: np.ndarray
    of_made: np.ndarray
    of_inputs: np.ndarray
    of_ports: np.ndarray


def _wires(blocks, ports, sums, inputs, outputs, sizes):
    """Return the wires; those of a port that no state and no output depends on are 0."""
    made = [f"{block.name}.{port}" for block in blocks for port in block.outputs]
    traced: dict = {signal: {signal: 1.0} for signal in (*made, *inputs)}
    wired = [_traced(port, sums, traced) for port in ports]
    # Of a port itself, not its sum: that may cancel.
    shown = [{signal: 1.0} if signal in ports else _traced(signal, sums, traced) for signal in outputs]
    of_made, of_inputs, of_ports = (_matrix(shown, columns) for columns in (made, inputs, ports))
    needs = _closure(_somewhere(np.abs(_matrix(wired, made)) @ sizes.D))
    reads = _somewhere(sizes.B).any(0) | _somewhere(np.abs(of_made) @ sizes.D + np.abs(of_ports)).any(0) | needs.diagonal()
    used = (reads | reads @ needs).tolist()
    wired = [row if is_used else {} for row, is_used in zip(wired, used, strict=True)]
    return _Wires(_matrix(wired, made), _matrix(wired, inputs), of_made, of_inputs, of_ports)


class _Ports:
    """Ports as rows over the states of all blocks and the external inputs, `(..., ports, states + inputs)`.

    values, sizes: of the rows, and of the terms of their sums. condition, pivot: of the algebraic loops, see `Block`.
    """

    def __init__(self, ports, name, K, L, C, D, sizes):
        self.condition = self.pivot = 1.0
        through, driven, size = _times(K, D), concatenated((_times(K, C), L), -1), np.abs(K)
        of_through, of_driven = size @ sizes[1], concatenated((size @ sizes[0], np.abs(L)), -1)
        needs = _closure(_somewhere(of_through))
        batch, kind = np.broadcast_shapes(through.shape[:-2], driven.shape[:-2]), np.result_type(through, driven)
        self.values, self.sizes = (np.broadcast_to(terms, (*batch, *terms.shape[-2:])).copy() for terms in (driven, of_driven))
        self.values = self.values.astype(kind, copy=False)
        count = (needs | np.eye(len(ports), dtype=bool)).sum(-1)
        for port in np.argsort(count, kind="stable").tolist():  # more than that of each port that it needs
            both = needs[port] & needs[:, port]
            loop, before = np.flatnonzero(both), np.flatnonzero(needs[port] & ~both)
            if not needs[port].any() or (loop.size and loop[0] != port):
                continue
            rows = loop if loop.size else np.array([port])
            value = _picked(driven, rows) + _times(_picked(through, rows, before), _picked(self.values, before))
            of_value = _picked(of_driven, rows) + _picked(of_through, rows, before) @ _picked(self.sizes, before)
            if loop.size:
                inside = _picked(through, rows, rows), _picked(of_through, rows, rows)
                reached = np.linalg.matrix_power(np.eye(rows.size) + _somewhere(inside[0]), rows.size) > 0
                inverse, condition, pivot = loop_inverse(*inside, reached, name, [ports[row] for row in rows])
                right, value = value, inverse @ value
                if rows.size > 1:  # refined, they are as uncertain as rounding of their equations (R. D. Skeel, 1980)
                    value = value + inverse @ (right - (value - inside[0] @ value))
                of_value = np.abs(inverse) @ (np.abs(value) + of_value + inside[1] @ np.abs(value))
                self.condition, self.pivot = self.condition * condition, self.pivot * pivot
            self.values[..., rows, :], self.sizes[..., rows, :] = value, of_value


def _picked(matrices, rows, columns=slice(None)):
    """Return some rows and columns, in the order of memory in which a product has the same bits in every batch."""
    return np.ascontiguousarray(matrices[..., rows, :][..., columns])


def _closure(needs):
    """Return which ports need which, by way of others as well."""
    for _ in range(len(needs).bit_length()):
        as_numbers = needs.astype(np.float32)  # BLAS multiplies no truth values
        further = needs | (as_numbers @ as_numbers > 0)
        if (further == needs).all():
            break
        needs = further
    return needs


def _closed(system, C, read, through, ports):
    """Return the connected blocks; C: how outputs depend on states; read: on ports; through: on the external inputs."""
    n = system.E.shape[-1]
    x, w = ports[..., :n], ports[..., n:]
    return StateSpace(system.E + _times(system.B, x), _times(system.B, w), C + _times(read, x), through + _times(read, w))


def _times(A, B):
    """Return `A B`, in which an entry that overflows is lost only for what it is multiplied with."""
    product = A @ B
    if np.isfinite(product).all():
        return product
    return np.where((A != 0).astype(float) @ (B != 0) > 0, product, 0.0)


def _traced(signal, sums, traced):
    """Return a signal as gains of outputs of blocks and external inputs; traced: signals whose gains have been found."""
    if signal not in traced:
        if signal not in sums:
            raise ValueError(f"nothing makes the signal {signal!r}")
        gains: dict = {}
        for source, gain in sums[signal].items():
            for end, factor in _traced(source, sums, traced).items():
                gains[end] = gains.get(end, 0.0) + gain * factor
        traced[signal] = gains
    return traced[signal]


def _matrix(rows, columns):
    """Return gains `(..., rows, columns)` of rows that have them by column; other columns are left out."""
    at = {column: k for k, column in enumerate(columns)}
    entries = [(i, at[column], numbers(gain)) for i, row in enumerate(rows) for column, gain in row.items() if column in at]
    batch = np.broadcast_shapes(*(gain.shape for _, _, gain in entries))
    out = np.zeros((*batch, len(rows), len(at)), np.result_type(float, *(gain for _, _, gain in entries)))
    for i, column, gain in entries:
        out[..., i, column] = gain
    return out


def _somewhere(matrix):
    """Return which entries are not zero in some loop of the batch."""
    return (matrix != 0).any(tuple(range(matrix.ndim - 2)))
