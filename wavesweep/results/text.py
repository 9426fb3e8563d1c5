"""A table as CSV text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, BinaryIO

import numpy as np

from wavesweep.errors import WavesweepError
from wavesweep.results.bulk import bulk_lines
from wavesweep.results.columns import checked
from wavesweep.results.schema import Field, fields_of
from wavesweep.results.spelling import quoted, spelt

# Rows turned into text at a time: bounds the memory that a long table takes on its way out.
_ROWS = 65536
# From so many rows on Arrow spells them: for fewer, importing its functions would cost more than it saves.
BULK = 20_000


def header(fields: tuple[Field, ...]) -> bytes:
    """The header line, encoded."""
    return (",".join(quoted(field.name) for field in fields) + "\n").encode("utf-8")


def lines(columns: Mapping[str, np.ndarray]) -> bytes:
    """The rows of checked columns, encoded; the same bytes however the rows are cut into calls."""
    length = len(next(iter(columns.values())))
    if not length:
        return b""
    if length >= BULK:
        return bulk_lines(columns)
    texts = [spelt(column) for column in columns.values()]
    try:
        return ("\n".join(map(",".join, zip(*texts, strict=True))) + "\n").encode("utf-8")
    except UnicodeEncodeError as error:
        raise WavesweepError(f"a name in the table cannot be written as UTF-8 ({error}); rename the spec") from error


def stream(kind: str, columns: Mapping[str, Any], out: BinaryIO) -> None:
    """Write a whole table as CSV to a binary stream. Raises WavesweepError before the first byte if it is unfit."""
    fields = fields_of(kind, columns)
    arrays = checked(fields, columns)
    starts = range(0, len(next(iter(arrays.values()))), _ROWS)
    stream_blocks(fields, ({name: array[at : at + _ROWS] for name, array in arrays.items()} for at in starts), out)


def stream_blocks(fields: tuple[Field, ...], blocks: Iterable[Mapping[str, Any]], out: BinaryIO) -> None:
    """Write a table that comes in blocks of rows as CSV to a binary stream."""
    out.write(header(fields))
    rows = 0
    for block in blocks:
        arrays = checked(fields, block, rows)
        out.write(lines(arrays))
        rows += len(next(iter(arrays.values())))
