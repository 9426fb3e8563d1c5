"""How one field of a CSV line is spelt."""

from __future__ import annotations

import numpy as np


def spelt(column: np.ndarray) -> list[str]:
    """The fields of a checked column.

    Python's own `repr` spells a float: the shortest text that reads back to the same bits, and 20000.0 keeps its
    point, so that no reader takes a column of floats for integers.
    """
    if column.dtype == np.bool_:
        return ["1" if value else "0" for value in column.tolist()]
    if column.dtype == np.object_:
        return [quoted(str(value)) for value in column.tolist()]
    texts = [repr(value) for value in column.tolist()]
    if column.dtype == np.float64:
        for missing in np.flatnonzero(np.isnan(column)).tolist():
            texts[missing] = "NaN"
    return texts


def quoted(text: str) -> str:
    """Quote what would otherwise break the line (RFC 4180); an ordinary name stays as it is."""
    if not any(mark in text for mark in ',"\r\n'):
        return text
    return '"' + text.replace('"', '""') + '"'
