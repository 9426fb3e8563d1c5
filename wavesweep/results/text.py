"""A table as CSV text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, BinaryIO

import numpy as np

from wavesweep.errors import WavesweepError
from wavesweep.results.columns import checked
from wavesweep.results.schema import Field, fields_of

# Rows turned into text at a time: bounds the memory that a long table takes on its way out.
_ROWS = 65536


def header(fields: tuple[Field, ...]) -> bytes:
    """The header line, encoded."""
    return (",".join(_quoted(field.name) for field in fields) + "\n").encode("utf-8")


def lines(columns: Mapping[str, np.ndarray]) -> bytes:
    """The rows of checked columns, encoded; the same bytes however the rows are cut into calls.

    Python's own `repr` spells a float: the shortest text that reads back to the same bits, and 20000.0 keeps its
    point, so that no reader takes a column of floats for integers. pyarrow's writer is twice as fast but writes 20000.
    """
    length = len(next(iter(columns.values())))
    if not length:
        return b""
    texts = [_spelt(column) for column in columns.values()]
    try:
        return ("\n".join(map(",".join, zip(*texts, strict=True))) + "\n").encode("utf-8")
    except UnicodeEncodeError as error:
        raise WavesweepError(f"a name in the table cannot be written as UTF-8 ({error}); rename the spec") from error


def stream(kind: str, columns: Mapping[str, Any], out: BinaryIO) -> None:
    """Write a whole table as CSV to a binary stream. Raises WavesweepError before the first byte if it is unfit."""
    fields = fields_of(kind, columns)
    arrays = checked(fields, columns)
    out.write(header(fields))
    starts = range(0, len(next(iter(arrays.values()))), _ROWS)
    out.writelines(lines({name: array[at : at + _ROWS] for name, array in arrays.items()}) for at in starts)


def _spelt(column: np.ndarray) -> list[str]:
    if column.dtype == np.bool_:
        return ["1" if value else "0" for value in column.tolist()]
    if column.dtype == np.object_:
        return [_quoted(str(value)) for value in column.tolist()]
    texts = [repr(value) for value in column.tolist()]
    if column.dtype == np.float64:
        for missing in np.flatnonzero(np.isnan(column)).tolist():
            texts[missing] = "NaN"
    return texts


def _quoted(text: str) -> str:
    """Quote what would otherwise break the line (RFC 4180); an ordinary name stays as it is."""
    if not any(mark in text for mark in ',"\r\n'):
        return text
    return '"' + text.replace('"', '""') + '"'
