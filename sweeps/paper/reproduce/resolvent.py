"""The resolvent of a block, `C (w I - E)^-1 B + D`, and the aliases of a frequency."""

import numpy as np

from wavesweep.engine._loops.block import Block
from wavesweep.engine._monodromy.unit_circle import solve


def alias_angles(theta, ratio: int):
    """Return `(theta + 2 pi m)/ratio` for every alias m, in (-pi, pi]: `(points, ratio)`."""
    shift = np.arange(ratio) - (ratio - 1) // 2
    return (np.asarray(theta)[..., None] + 2 * np.pi * shift) / ratio


def solved_response(block: Block, w):
    """Return `C (w I - E)^-1 B + D` at `w = z - 1`, `(..., points, p, m)`, backward stable."""
    E, B, C, D = (part[..., None, :, :] for part in (block.E, block.B, block.C, block.D))
    A = w[..., None, None] * np.eye(E.shape[-1]) - E
    return C @ solve(A, B + 0 * A[..., :1]) + D
