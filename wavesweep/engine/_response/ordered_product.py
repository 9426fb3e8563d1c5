"""Products of matrices whose sums have one order."""

import numpy as np

from wavesweep.engine._monodromy.batches import sparse


def ordered_product(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return `A x` of every loop of a batch, or at every frequency; A: `(..., m, n)`, x: `(...,
    n)`.

    No product of matrices is used, and the terms are contiguous, since the order of a sum, and with
    it the last bits of a loop, would depend on the batch that it is in. So it is with a single
    matrix of many rows with few entries.
    """
    if (few := sparse(A)) is not None:
        return (few @ x.reshape(-1, x.shape[-1]).T).T.reshape(*x.shape[:-1], len(A))
    return np.multiply(A, x[..., None, :], order="C").sum(-1)
