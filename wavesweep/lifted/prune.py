"""Leaving out the states that nothing reads, by structure: exact zeros only, never a tolerance."""

import numpy as np

from wavesweep.diagram.block import Block


def prune(block: Block) -> tuple[Block, tuple[str, ...]]:
    """Return the block without the states that no output reads, directly or through other states, and their names.

    An entry counts as zero only where it is zero for every element of the batch. A position with no spring and no
    position feedback (the drift of a wave loop), the avatar of a local model with K_LM = 0 and a held value that
    nobody looks at all leave here; what remains has the same transfer function.
    """
    reads = np.any(block.E != 0, axis=tuple(range(block.E.ndim - 2)))
    kept = np.any(block.C != 0, axis=tuple(range(block.C.ndim - 1)))
    for _ in block.states:
        kept = kept | np.any(reads[kept], axis=0)
    if kept.all():
        return block, ()
    index = np.flatnonzero(kept)
    names = tuple(block.states[i] for i in index)
    smaller = Block(
        block.name, block.inputs, block.outputs, names,
        E=block.E[..., index[:, None], index], B=block.B[..., index, :], C=block.C[..., index], D=block.D,
        condition=block.condition, terms=_kept(block.terms, index),
    )
    return smaller, tuple(s for s, keep in zip(block.states, kept, strict=True) if not keep)


def _kept(terms, index):
    """The sizes of what is kept."""
    if terms is None:
        return None
    E, B, C, D = terms
    return E[..., index[:, None], index], B[..., index, :], C[..., index], D
