"""Parts of a batch of matrices that fit into a processor's cache: new memory for a batch costs more than the arithmetic."""

from math import prod

import numpy as np

CACHED = 2**18  # bytes of an array of matrices, of which a processor's cache holds several


def in_parts(work, batch, size: int, kind):
    """Return `work(part)` for all parts of a batch, in one array.

    part: an index of the first axis, which is that of the result as well. size: of the matrices; kind: type of their numbers.
    work must treat each matrix by itself, so that the division changes no bit.
    """
    few = max(1, CACHED // max(size * size * np.dtype(kind).itemsize * prod(batch[1:]), 1))
    if not batch or batch[0] <= few:
        return work(...)
    found = work(slice(few))
    whole = np.empty((batch[0], *found.shape[1:]), found.dtype)
    whole[:few] = found
    for first in range(few, batch[0], few):
        part = slice(first, first + few)
        whole[part] = work(part)
    return whole
