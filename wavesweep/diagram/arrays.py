"""Small matrices whose entries may be arrays over a batch."""

import numpy as np


def frozen(array) -> np.ndarray:
    """Return `array` as a read-only float view; the caller's own array stays writable."""
    view = np.asarray(array, dtype=float).view()
    view.flags.writeable = False
    return view


def matrix(rows) -> np.ndarray:
    """Stack rows of scalars and arrays to `(..., len(rows), len(rows[0]))`, entries broadcast together."""
    height, width = len(rows), len(rows[0])
    entries = [np.asarray(entry, dtype=float) for row in rows for entry in row]
    out = np.empty((*np.broadcast_shapes(*(e.shape for e in entries)), height, width))
    for index, entry in enumerate(entries):
        out[..., index // width, index % width] = entry
    return out
