"""Parts of a batch of matrices that fit into a processor's cache: new memory for a batch costs more than the arithmetic."""

from math import prod

import numpy as np

CACHED = 2**18  # bytes of an array of matrices, of which a processor's cache holds several


def in_parts(work, batch, size: int, kind):
    """Return `work(part)` for all parts of a batch, in one array `(*batch, size, size)`.

    part: an index of the first axis. kind: type of the numbers. work must treat each matrix by itself, so that the division
    changes no bit.
    """
    few = max(1, CACHED // max(size * size * np.dtype(kind).itemsize * prod(batch[1:]), 1))
    if not batch or batch[0] <= few:
        return work(...)
    whole = np.empty((*batch, size, size), kind)
    for first in range(0, batch[0], few):
        part = slice(first, first + few)
        whole[part] = work(part)
    return whole
