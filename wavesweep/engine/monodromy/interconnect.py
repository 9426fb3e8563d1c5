"""Connection of blocks of one rate through their summing junctions, with every algebraic loop closed exactly."""

import numpy as np

from wavesweep.engine.loops.algebraic import loop_inverse
from wavesweep.engine.loops.block import Block, block_diagonal, concatenated, numbers

ROUNDING = 8 * np.finfo(float).eps  # of the terms of a sum, what is left of it when it should be zero


def connect(name: str, blocks, sums, inputs, outputs, terms: bool = False) -> Block:
    """Close every junction among `blocks` and return one block from the signals `inputs` to the signals `outputs`.

    name: of the block. blocks: `Block`s of one rate. sums: signal -> {source signal: gain}. inputs: external signals. outputs:
    any signals. terms: whether the block has the sizes of the terms of its entries' sums (see `Block`).
    Errors: IllPosedLoopError if the algebraic loop through the direct terms is singular to working precision.

    With the blocks side by side, `y = C x + D u`, the wires `u = K y + L w` give `(I - K D) u = K C x + L w`. Ports are found
    in the order in which their direct terms need each other, so that what a port does not depend on is exactly zero in it.
    Ports that need each other are an algebraic loop, and are found together.
    """
    ports = [f"{each.name}.{port}" for each in blocks for port in each.inputs]
    made = [f"{each.name}.{port}" for each in blocks for port in each.outputs]
    known: dict = {signal: {signal: 1.0} for signal in (*made, *inputs)}
    wired = [_traced(port, sums, known) for port in ports]
    shown = [{each: 1.0} if each in ports else _traced(each, sums, known) for each in outputs]  # not its sum: that may cancel
    of_made, of_inputs, of_ports = (_matrix(shown, columns) for columns in (made, inputs, ports))
    E, B, C, D = values = [block_diagonal([getattr(each, part) for each in blocks]) for part in "EBCD"]
    sizes = [np.abs(part) for part in values]
    if terms and blocks:
        given = zip(*(each.terms or [np.abs(getattr(each, part)) for part in "EBCD"] for each in blocks), strict=True)
        sizes = [block_diagonal(list(some)) for some in given]
    needs = _closure(_somewhere(np.abs(_matrix(wired, made)) @ sizes[3]))
    reads = _somewhere(sizes[1]).any(0) | _somewhere(np.abs(of_made) @ sizes[3] + np.abs(of_ports)).any(0) | needs.diagonal()
    used = (reads | reads @ needs).tolist()
    wired = [row if each else {} for row, each in zip(wired, used, strict=True)]
    K, L = (_matrix(wired, columns) for columns in (made, inputs))
    n = E.shape[-1]
    with np.errstate(over="ignore", invalid="ignore"):  # a frame that overflows is for the caller to see
        found = _Ports(ports, name, K, L, C, D, sizes[2:])
        read = _times(of_made, D) + of_ports
        parts = _closed(E, B, _times(of_made, C), read, of_inputs, found.values)
        at_most = np.abs(found.values[..., n:])
        for part, of_part in ((1, np.abs(B) @ at_most), (3, np.abs(of_inputs) + np.abs(read) @ at_most)):
            # The wall's force may reach the avatar twice, by +1/b and -1/b, which leaves eps/b.
            parts[part] = np.where((np.abs(parts[part]) <= ROUNDING * of_part) & np.isfinite(of_part), 0.0, parts[part])
        if terms:
            size, of_read = np.abs(of_made), np.abs(of_made) @ sizes[3] + np.abs(of_ports)
            parts += _closed(sizes[0], sizes[1], size @ sizes[2], of_read, np.abs(of_inputs), found.sizes)
    kind, batch = np.result_type(float, *parts), np.broadcast_shapes(*(part.shape[:-2] for part in parts))
    if len(batch) == 1:
        parts = [np.broadcast_to(part, (*batch, *part.shape[-2:])) for part in parts]
    for block in blocks:
        found.condition, found.pivot = found.condition * block.condition, found.pivot * block.pivot
    facts = {"condition": found.condition, "pivot": found.pivot, "terms": tuple(parts[4:]) or None}
    states = tuple(f"{block.name}.{state}" for block in blocks for state in block.states)
    return Block(name, tuple(inputs), tuple(outputs), states, *(part.astype(kind, copy=False) for part in parts[:4]), **facts)


class _Ports:
    """Ports as rows over the states of all blocks and the external inputs, `(..., ports, states + inputs)`.

    values, sizes: of the rows, and of the terms of their sums. condition, pivot: of the algebraic loops, see `Block`.
    """

    def __init__(self, ports, name, K, L, C, D, sizes):
        self.condition = self.pivot = 1.0
        through, own, size = _times(K, D), concatenated((_times(K, C), L), -1), np.abs(K)
        of_through, of_own = size @ sizes[1], concatenated((size @ sizes[0], np.abs(L)), -1)
        needs = _closure(_somewhere(of_through))
        batch, kind = np.broadcast_shapes(through.shape[:-2], own.shape[:-2]), np.result_type(through, own)
        self.values, self.sizes = (np.broadcast_to(part, (*batch, *part.shape[-2:])).copy() for part in (own, of_own))
        self.values = self.values.astype(kind, copy=False)
        count = (needs | np.eye(len(ports), dtype=bool)).sum(-1)
        for port in np.argsort(count, kind="stable").tolist():  # more than that of each port that it needs
            both = needs[port] & needs[:, port]
            loop, before = np.flatnonzero(both), np.flatnonzero(needs[port] & ~both)
            if not needs[port].any() or (loop.size and loop[0] != port):
                continue
            rows = loop if loop.size else np.array([port])
            value = _some(own, rows) + _times(_some(through, rows, before), _some(self.values, before))
            of_value = _some(of_own, rows) + _some(of_through, rows, before) @ _some(self.sizes, before)
            if loop.size:
                inside = _some(through, rows, rows), _some(of_through, rows, rows)
                reached = np.linalg.matrix_power(np.eye(rows.size) + _somewhere(inside[0]), rows.size) > 0
                inverse, condition, pivot = loop_inverse(*inside, reached, name, [ports[row] for row in rows])
                right, value = value, inverse @ value
                if rows.size > 1:  # refined, they are as uncertain as rounding of their equations (R. D. Skeel, 1980)
                    value = value + inverse @ (right - (value - inside[0] @ value))
                of_value = np.abs(inverse) @ (np.abs(value) + of_value + inside[1] @ np.abs(value))
                self.condition, self.pivot = self.condition * condition, self.pivot * pivot
            self.values[..., rows, :], self.sizes[..., rows, :] = value, of_value


def _some(matrices, rows, columns=slice(None)):
    """Return some rows and columns, in the order of memory in which a product has the same bits in every batch."""
    return np.ascontiguousarray(matrices[..., rows, :][..., columns])


def _closure(needs):
    """Return which ports need which, by way of others as well."""
    for _ in range(len(needs).bit_length()):
        needs = needs | (needs @ needs)
    return needs


def _closed(E, B, C, read, through, ports):
    """Return E, B, C and D of the whole; read: how outputs depend on ports; through: on the external inputs."""
    n = E.shape[-1]
    x, w = ports[..., :n], ports[..., n:]
    return [E + _times(B, x), _times(B, w), C + _times(read, x), through + _times(read, w)]


def _times(A, B):
    """Return `A B`, in which an entry that overflows is lost only for what it is multiplied with."""
    found = A @ B
    if np.isfinite(found).all():
        return found
    return np.where((A != 0).astype(float) @ (B != 0) > 0, found, 0.0)


def _traced(signal, sums, known):
    """Return a signal as gains of outputs of blocks and external inputs. known: signals of which these are known already."""
    if signal not in known:
        if signal not in sums:
            raise ValueError(f"nothing makes the signal {signal!r}")
        found: dict = {}
        for source, gain in sums[signal].items():
            for end, factor in _traced(source, sums, known).items():
                found[end] = found.get(end, 0.0) + gain * factor
        known[signal] = found
    return known[signal]


def _matrix(rows, columns):
    """Return gains `(..., rows, columns)` of rows that have them by column; other columns are left out."""
    at = {column: k for k, column in enumerate(columns)}
    entries = [(i, at[column], numbers(gain)) for i, row in enumerate(rows) for column, gain in row.items() if column in at]
    batch = np.broadcast_shapes(*(gain.shape for _, _, gain in entries))
    out = np.zeros((*batch, len(rows), len(at)), np.result_type(float, *(gain for _, _, gain in entries)))
    for i, column, gain in entries:
        out[..., i, column] = gain
    return out


def _somewhere(part):
    """Return which entries are not zero in some loop of the batch."""
    return (part != 0).any(tuple(range(part.ndim - 2)))
