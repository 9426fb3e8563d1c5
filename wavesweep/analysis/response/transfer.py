"""Frequency response of one block by a solve per frequency."""

import numpy as np

from wavesweep.diagram.block import Block
from wavesweep.lifted.circle import solve


def solved_response(block: Block, w):
    """`C (w I - E)^-1 B + D` at `w = z - 1`, `(..., points, p, m)`, backward stable."""
    E, B, C, D = (part[..., None, :, :] for part in (block.E, block.B, block.C, block.D))
    A = w[..., None, None] * np.eye(E.shape[-1]) - E
    return C @ solve(A, B + 0 * A[..., :1]) + D
