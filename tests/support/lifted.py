"""Small readings of blocks in delta form that several tests share."""

import numpy as np


def poles(block):
    """Eigenvalues of the block's state matrix, sorted."""
    return np.sort_complex(1 + np.linalg.eigvals(block.E))


def transfer(block, w):
    """`C (w - E)^-1 B + D` at one `w = z - 1`."""
    n = len(block.states)
    return block.C @ np.linalg.solve(w * np.eye(n) - block.E, block.B + 0j) + block.D
