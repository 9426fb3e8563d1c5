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
    """Return `work(index)` for a whole batch in one array, called for portions of CACHED bytes.

    batch: the shape of the leading axes; portions divide the first one. work: makes what belongs
    to an index of the first axis, which is also the first one of the result. It must treat each
    matrix by itself, so that the division changes no bit. size: rows of the matrices, which are
    about square. kind: type of their entries.
    """
    bytes_of_one = size * size * np.dtype(kind).itemsize * prod(batch[1:])
    portion = max(1, CACHED // max(bytes_of_one, 1))
    if not batch or batch[0] <= portion:
        return work(...)
    first = work(slice(portion))
    result = np.empty((batch[0], *first.shape[1:]), first.dtype)
    result[:portion] = first
    for start in range(portion, batch[0], portion):
        index = slice(start, start + portion)
        result[index] = work(index)
    return result


def nonzero(matrix: np.ndarray) -> np.ndarray:
    """Which entries are not zero in some loop of the batch, `(n, m)`."""
    return np.any(matrix != 0, axis=tuple(range(matrix.ndim - 2)))
