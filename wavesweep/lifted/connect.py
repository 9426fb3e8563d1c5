"""Connecting blocks of one rate through their summing junctions, every algebraic loop closed exactly."""

import numpy as np

from wavesweep.diagram.block import Block, numbers
from wavesweep.errors import IllPosedLoopError

WORST_CONDITION = 1e12  # beyond it a closed loop keeps fewer than 4 digits, which is no answer

ROUNDING = 8 * np.finfo(float).eps  # of the terms of a sum, what is left of it when it should be zero


def connect(name: str, blocks, sums, inputs, outputs, terms: bool = False) -> Block:
    """Close every junction among `blocks` and return one block from the signals `inputs` to the signals `outputs`.

    blocks: `Block`s of one rate. sums: signal -> {source signal: gain}. inputs: external signals. outputs: any signals.
    terms: whether the block has the sizes of the terms of its entries' sums (see `Block`).
    Raises IllPosedLoopError where the algebraic loop through the direct terms is singular to working precision.
    """
    tracer = _Tracer(blocks, sums, inputs)
    ports = [f"{block.name}.{port}" for block in blocks for port in block.inputs]
    from_y, from_w = tracer.gains(ports)
    out_y, out_w = tracer.gains(outputs)
    E, B, C, D = (_block_diagonal([getattr(block, part) for block in blocks]) for part in "EBCD")
    fed = np.flatnonzero(np.any(D != 0, axis=(*range(D.ndim - 2), -2)))  # inputs that reach an output in the same tick
    direct = from_y @ D[..., fed]
    inverse, condition = _loop_inverse(np.eye(fed.size) - direct[..., fed, :], name, [ports[i] for i in fed])
    for block in blocks:
        condition = condition * block.condition
    # u = from_y (C x + D u) + from_w w, solved for the inputs `fed` first, on which alone D acts.
    from_x, through = from_y @ C, direct @ inverse
    x_to_u, w_to_u = from_x + through @ from_x[..., fed, :], from_w + through @ from_w[..., fed, :]
    states = tuple(f"{block.name}.{state}" for block in blocks for state in block.states)
    with np.errstate(over="ignore", invalid="ignore"):  # a frame that overflows is for the caller to see
        parts = {
            "E": E + B @ x_to_u,
            "B": _through(0.0, B, w_to_u),
            "C": out_y @ (C + D @ x_to_u),
            "D": _through(out_w, out_y @ D, w_to_u),
        }
    if terms:
        whole = np.eye(len(ports)) + np.zeros((*through.shape[:-2], 1, 1), through.dtype)
        whole[..., fed] += through
        terms = _terms((E, B, C, D), (from_y, from_w), (out_y, out_w), whole)
    return Block(name, tuple(inputs), tuple(outputs), states, **parts, condition=condition, terms=terms or None)


def _terms(parts, inward, outward, inverse):
    """Sizes of the terms that the entries of the connected block are sums of: where these cancel, rounding is left."""
    (E, B, C, D), (from_y, from_w), (out_y, out_w) = (tuple(map(np.abs, group)) for group in (parts, inward, outward))
    with np.errstate(over="ignore", invalid="ignore"):
        x_to_u, w_to_u = np.abs(inverse) @ (from_y @ C), np.abs(inverse) @ from_w
        return E + B @ x_to_u, B @ w_to_u, out_y @ (C + D @ x_to_u), out_w + out_y @ (D @ w_to_u)


def _through(before, left, right):
    """`before + left right`, and 0 where nothing is left but rounding: with no filter and no delay in the line the
    wall's force reaches the avatar twice, by +1/b and -1/b, and eps/b is much where b is small."""
    total = before + left @ right
    size = np.abs(before) + np.abs(left) @ np.abs(right)
    return np.where((np.abs(total) <= ROUNDING * size) & np.isfinite(size), 0.0, total)


class _Tracer:
    """Follows a signal back through the junctions to block outputs (y) and external inputs (w)."""

    def __init__(self, blocks, sums, inputs):
        self.sums = sums
        self.y = {f"{block.name}.{port}": i for i, port_block in enumerate(_ports(blocks)) for block, port in [port_block]}
        self.w = {signal: i for i, signal in enumerate(inputs)}
        self.known = {}

    def gains(self, signals):
        """Gain matrices `(..., len(signals), ny)` and `(..., len(signals), nw)`."""
        traced = [self.trace(signal) for signal in signals]
        shape = np.broadcast_shapes(*(np.shape(g) for terms in traced for g in terms.values()), ())
        kind = np.result_type(float, *(g for terms in traced for g in terms.values()))
        from_y = np.zeros((*shape, len(signals), len(self.y)), kind)
        from_w = np.zeros((*shape, len(signals), len(self.w)), kind)
        for row, terms in enumerate(traced):
            for source, gain in terms.items():
                if source in self.w:
                    from_w[..., row, self.w[source]] = gain
                else:
                    from_y[..., row, self.y[source]] = gain
        return from_y, from_w

    def trace(self, signal) -> dict:
        if signal in self.w or signal in self.y:
            return {signal: 1.0}
        if signal not in self.known:
            if signal not in self.sums:
                raise ValueError(f"nothing makes the signal {signal!r}")
            total = {}
            for source, gain in self.sums[signal].items():
                for origin, factor in self.trace(source).items():
                    total[origin] = total.get(origin, 0.0) + numbers(gain) * factor
            self.known[signal] = total
        return self.known[signal]


def _ports(blocks):
    return [(block, port) for block in blocks for port in block.outputs]


def _block_diagonal(arrays):
    """Block-diagonal of matrices whose batch axes broadcast."""
    batch = np.broadcast_shapes(*(a.shape[:-2] for a in arrays))
    out = np.zeros((*batch, sum(a.shape[-2] for a in arrays), sum(a.shape[-1] for a in arrays)), np.result_type(*arrays))
    row = column = 0
    for a in arrays:
        out[..., row : row + a.shape[-2], column : column + a.shape[-1]] = a
        row, column = row + a.shape[-2], column + a.shape[-1]
    return out


def _loop_inverse(loop, name, ports):
    """Inverse of the loop's return difference, refused where its condition number says that it is ill-posed, and that."""
    if not ports:
        return loop, np.ones(loop.shape[:-2])
    overflown = ~np.isfinite(loop).all((-1, -2))  # a frame that overflows is for the caller to see
    try:
        inverse = np.linalg.inv(np.where(overflown[..., None, None], np.nan, loop))
    except np.linalg.LinAlgError:
        inverse = np.full_like(loop, np.inf)
    condition = _condition(loop, inverse)
    if not np.all((condition < WORST_CONDITION) | overflown):
        raise IllPosedLoopError(
            f"the algebraic loop of the {name} side through {', '.join(ports)} is ill-posed: condition number "
            f"{float(np.max(condition)):.1e}, expected below {WORST_CONDITION:.0e}; give the loop a delay "
            "(environment.delay or local_model.delay) or change the gain that closes it"
        )
    return inverse, condition


def _condition(loop, inverse):
    """Condition number for the best choice of units, the spectral radius of |L^-1| |L| (Bauer 1963): a wave impedance of
    1e-9 makes entries of very different sizes, and no ill-posed loop. Overestimated, by a power's norm, by a few."""
    with np.errstate(over="ignore", invalid="ignore"):
        power = np.abs(inverse) @ np.abs(loop)
        for _ in range(3):
            power = power @ power
        condition = power.sum(-1).max(-1, initial=0) ** 0.125
    return np.where(np.isnan(condition), np.inf, condition)
