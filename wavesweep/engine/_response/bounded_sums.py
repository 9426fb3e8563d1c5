"""Products and sums of matrices, with bounds on their rounding."""

from collections.abc import Sequence

import numpy as np

from wavesweep.engine._loops.block import concatenated
from wavesweep.engine._monodromy.batches import sparse
from wavesweep.engine._monodromy.rounding import SHORT_SUM_ROUNDING


def ordered_product(A, x):
    """Return `A x` of every loop of a batch, or at every frequency; A: `(..., m, n)`, x: `(...,
    n)`.

    No product of matrices is used, and the terms are contiguous, since the order of a sum, and with
    it the last bits of a loop, would depend on the batch that it is in. So it is with a single
    matrix of many rows with few entries.
    """
    if (few := sparse(A)) is not None:
        return (few @ x.reshape(-1, x.shape[-1]).T).T.reshape(*x.shape[:-1], len(A))
    return np.multiply(A, x[..., None, :], order="C").sum(-1)


def ordered_products(A: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Return `A X` as `ordered_product` does it; X: `(..., n, k)`."""
    return np.multiply(A[..., :, None, :], X.mT[..., None, :, :], order="C").sum(-1)


def long_sum(count: int) -> float:
    """Return the relative error of a sum of `count` products; errors of either sign grow as the
    root of their number."""
    return SHORT_SUM_ROUNDING * (4 + count**0.5)


def times(
    a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the product of two matrices, each a pair with a bound on the error of its entries."""
    size = np.abs(b[0])
    return a[0] @ b[0], a[1] @ size + np.abs(a[0]) @ (b[1] + SHORT_SUM_ROUNDING * size)


def plus(
    a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the sum of two matrices, each a pair with a bound on the error of its entries."""
    return a[0] + b[0], a[1] + b[1] + SHORT_SUM_ROUNDING * (np.abs(a[0]) + np.abs(b[0]))


def joined(pairs: Sequence[tuple[np.ndarray, np.ndarray]], axis: int) -> tuple[np.ndarray, ...]:
    """Return pairs of an array and its error bound, joined along the axis."""
    return tuple(concatenated(arrays, axis) for arrays in zip(*pairs, strict=True))
