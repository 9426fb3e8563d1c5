"""Small matrices whose entries may be arrays over a batch."""

import numpy as np


def numbers(array) -> np.ndarray:
    """Return `array` as floats, or as complex numbers where a parameter is looked at beside the real axis."""
    array = np.asarray(array)
    return array if array.dtype.kind == "c" else array.astype(float, copy=False)


def frozen(array) -> np.ndarray:
    """Return `array` as a read-only view of `numbers`; the caller's own array stays writable."""
    view = numbers(array).view()
    view.flags.writeable = False
    return view


def matrix(rows) -> np.ndarray:
    """Stack rows of scalars and arrays to `(..., len(rows), len(rows[0]))`, entries broadcast together."""
    height, width = len(rows), len(rows[0])
    entries = [numbers(entry) for row in rows for entry in row]
    out = np.empty((*np.broadcast_shapes(*(e.shape for e in entries)), height, width), np.result_type(*entries))
    for index, entry in enumerate(entries):
        out[..., index // width, index % width] = entry
    return out
