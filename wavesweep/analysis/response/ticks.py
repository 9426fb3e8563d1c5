"""The ticks of a frame in a row: the outputs and the effect of each, and bounds on their rounding."""

from dataclasses import replace

import numpy as np

from wavesweep.diagram.block import Block
from wavesweep.lifted.batches import sparse
from wavesweep.lifted.rounding import ENTRIES, ROUNDING, both


def entries_errors(block: Block):
    """Return bounds on the errors of a block's E, B, C and D."""
    return tuple(ENTRIES * part for part in block.terms)


def ordered_product(A, x):
    """Return `A x` of every loop of a batch, or at every frequency; A: `(..., m, n)`, x: `(..., n)`.

    No product of matrices is used, and the terms are contiguous, since the order of a sum, and with it the last bits of a loop,
    would depend on the batch that it is in. So it is with a single matrix of many rows with few entries.
    """
    if (few := sparse(A)) is not None:
        return (few @ x.reshape(-1, x.shape[-1]).T).T.reshape(*x.shape[:-1], len(A))
    return np.multiply(A, x[..., None, :], order="C").sum(-1)


def ordered_products(A, X):
    """Return `A X` as `ordered_product` does it; X: `(..., n, k)`."""
    return np.multiply(A[..., :, None, :], np.swapaxes(X, -1, -2)[..., None, :, :], order="C").sum(-1)


def long_sum(count: int) -> float:
    """Return the relative error of a sum of `count` products; errors of either sign grow as the root of their number."""
    return ROUNDING * (4 + count**0.5)


def times(a, b):
    """Return the product of two matrices, each a pair with a bound on the error of its entries."""
    size = np.abs(b[0])
    return a[0] @ b[0], a[1] @ size + np.abs(a[0]) @ (b[1] + ROUNDING * size)


def plus(a, b):
    """Return the sum of two matrices, each a pair with a bound on the error of its entries."""
    return a[0] + b[0], a[1] + b[1] + ROUNDING * (np.abs(a[0]) + np.abs(b[0]))


def joined(parts, axis):
    """Return pairs of an array and its error bound, joined along the axis."""
    return tuple(_together(part, axis) for part in zip(*parts, strict=True))


def _together(parts, axis):
    if len({part.shape[:-2] for part in parts}) > 1:
        batch = np.broadcast_shapes(*(part.shape[:-2] for part in parts))
        parts = [np.broadcast_to(part, (*batch, *part.shape[-2:])) for part in parts]
    return np.concatenate(parts, axis=axis)


def taken(pair, index):
    """Return the same part of both arrays of a pair."""
    return tuple(part[index] for part in pair)


def holding(fast: Block, outputs: int) -> Block:
    """Return the tick with its held inputs as states that stay constant.

    It goes from the hand's force, its first input, to its first outputs.
    """
    parts = _holding((fast.E, fast.B, fast.C, fast.D), outputs)
    terms = fast.terms and _holding(fast.terms, outputs)
    return replace(
        fast,
        inputs=fast.inputs[:1],
        outputs=fast.outputs[:outputs],
        states=(*fast.states, *fast.inputs[1:]),
        terms=terms,
        **dict(zip("EBCD", parts, strict=True)),
    )


def _holding(parts, outputs):
    """Return the arrays E, B, C and D of `holding`."""
    E, B, C, D = parts
    n, held, batch = E.shape[-1], B.shape[-1] - 1, np.broadcast_shapes(*(part.shape[:-2] for part in parts))
    whole = np.zeros((*batch, n + held, n + held)), np.zeros((*batch, n + held, 1)), np.zeros((*batch, outputs, n + held))
    whole[0][..., :n, :n], whole[0][..., :n, n:], whole[1][..., :n, :] = E, B[..., 1:], B[..., :1]
    whole[2][..., :n], whole[2][..., n:] = C[..., :outputs, :], D[..., :outputs, 1:]
    return *whole, D[..., :outputs, :1]


def repeated(one, count: int):
    """Return `E` of `count` runs of ticks, as a pair like those of `both`, by doubling; None if the count is 0."""
    total = None
    for bit in f"{count:b}" if count else "":
        total = total and both(total, total)
        if bit == "1":
            total = both(total, one) if total else one
    return total


def unrolled(tick: Block, count: int):
    """Return the outputs and the effects of `count` ticks of such a block, as pairs.

    The outputs in each tick for the first state are `C A^i`, `(..., p, count, n)`. The parts of a force that are in the state
    after i more ticks are `A^i B`, `(..., n, count)`.
    """
    dE, dB, dC, _ = entries_errors(tick)
    run, reads, force = (tick.E, dE), (tick.C[..., None, :], dC[..., None, :]), (tick.B, dB)
    for _ in range((count - 1).bit_length()):
        A = (np.eye(run[0].shape[-1]) + run[0], run[1])
        reads = joined((reads, times(reads, taken(A, (..., None, slice(None), slice(None))))), -2)
        force, run = joined((force, times(A, force)), -1), both(run, run)
    return taken(reads, (..., slice(0, count), slice(None))), taken(force, (..., slice(0, count)))
