"""Work on a batch of matrices in portions that fit into a processor's cache: new memory costs
more than the arithmetic."""

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from wavesweep.engine._loops.block import SPARSE_ROWS, SPARSE_SHARE

NUMBERS_AT_ONCE = 500_000  # of many points, or of what is computed at them, in one portion
CACHED = 2**18  # bytes of an array of matrices, of which a processor's cache holds several


def product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Return `A @ B`, `(..., n, m)`; of many rows with few entries, as those of long delays are, by
    these entries alone.

    Then infinities times zeros are left out. Each matrix is treated by itself, whatever the rest of
    the batch is.
    """
    if A.shape[-1] < SPARSE_ROWS:
        return A @ B
    batch = np.broadcast_shapes(A.shape[:-2], B.shape[:-2])
    size = B.shape[-2:]
    first, second = (
        np.broadcast_to(M, (*batch, *M.shape[-2:])).reshape(-1, *M.shape[-2:]) for M in (A, B)
    )
    result = np.empty(second.shape, np.result_type(A, B))
    for a, b, out in zip(first, second, result, strict=True):
        out[...] = _product(a, b)
    return result.reshape(*batch, *size)


def _product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    if (few := sparse(A)) is not None:
        return few @ B
    few = sparse(B.T)
    return A @ B if few is None else (few @ A.T).T


def sparse(A: np.ndarray) -> Any:
    """A matrix as those of its entries that are not zero, if it has many rows with few of these;
    None if it has not."""
    if A.ndim > 2 or len(A) < SPARSE_ROWS or np.count_nonzero(A) > SPARSE_SHARE * A.size:
        return None
    from scipy.sparse import csr_array

    return csr_array(A)


def in_parts(
    work: Callable[..., Any], batch: tuple[int, ...], size: int, kind: type | np.dtype[Any]
) -> np.ndarray:
    """Return `work(index)` for all of a batch, in one array, a few matrices at a time.

    index: of the first axis, which is that of the result as well. size: of the matrices; kind: type
    of their numbers. work must treat each matrix by itself, so that the division changes no bit.
    """
    few = max(1, CACHED // max(size * size * np.dtype(kind).itemsize * prod(batch[1:]), 1))
    if not batch or batch[0] <= few:
        return work(...)
    head = work(slice(few))
    result = np.empty((batch[0], *head.shape[1:]), head.dtype)
    result[:few] = head
    for start in range(few, batch[0], few):
        index = slice(start, start + few)
        result[index] = work(index)
    return result


def nonzero(matrix: np.ndarray) -> np.ndarray:
    """Which entries are not zero in some loop of the batch, `(n, m)`."""
    return np.any(matrix != 0, axis=tuple(range(matrix.ndim - 2)))
