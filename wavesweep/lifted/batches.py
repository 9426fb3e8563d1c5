"""Parts of a batch of matrices that a processor's cache holds: fresh memory for all of it costs more than the arithmetic."""

from math import prod

import numpy as np

CACHED = 2**18  # bytes of an array of matrices, of which a processor's cache holds several


def in_parts(work, batch, size: int, kind):
    """`work(part)` for all parts of a batch, in one array `(*batch, size, size)`; part: what indexes the first axis.

    work must treat each matrix by itself, so that the division changes no bit.
    """
    few = max(1, CACHED // max(size * size * np.dtype(kind).itemsize * prod(batch[1:]), 1))
    if not batch or batch[0] <= few:
        return work(...)
    whole = np.empty((*batch, size, size), kind)
    for first in range(0, batch[0], few):
        part = slice(first, first + few)
        whole[part] = work(part)
    return whole
