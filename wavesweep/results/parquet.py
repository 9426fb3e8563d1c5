"""A table as a Parquet file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.results.schema import Field

# Rows in a row group. A fixed number, so that a file's bytes do not depend on the chunks that its rows came in.
GROUP_ROWS = 131072


class ParquetFile:
    """A Parquet file that is being written, a row group a call."""

    def __init__(self, path: Path, fields: tuple[Field, ...], facts: Mapping[str, Any]) -> None:
        import pyarrow.parquet

        self._schema = _schema(fields, facts)
        self._writer = pyarrow.parquet.ParquetWriter(path, self._schema, compression="zstd")

    def append(self, columns: Mapping[str, np.ndarray]) -> None:
        """Write checked columns as one row group."""
        import pyarrow

        arrays = [array_of(column) for column in columns.values()]
        self._writer.write_table(pyarrow.Table.from_arrays(arrays, schema=self._schema), row_group_size=GROUP_ROWS)

    def close(self) -> None:
        """Write the footer; without it the file cannot be read."""
        self._writer.close()


def _schema(fields: tuple[Field, ...], facts: Mapping[str, Any]) -> Any:
    import pyarrow

    types = {
        "number": pyarrow.float64(),
        "integer": pyarrow.int64(),
        "boolean": pyarrow.bool_(),
        "string": pyarrow.string(),
    }
    entries = [
        pyarrow.field(f.name, types[f.kind], metadata={"unit": f.unit, "description": f.description}) for f in fields
    ]
    return pyarrow.schema(entries, metadata={"wavesweep": json.dumps(facts, sort_keys=True, allow_nan=False)})


def array_of(column: np.ndarray) -> Any:
    """Wrap a column's memory. `pyarrow.array` would do, but imports pandas, which costs more than a small run takes."""
    import pyarrow

    def made(kind: Any, *buffers: Any) -> Any:
        wrapped = [None if buffer is None else pyarrow.py_buffer(buffer) for buffer in buffers]
        return pyarrow.Array.from_buffers(kind, len(column), wrapped)

    if column.dtype == np.float64:
        missing = np.isnan(column)
        return made(pyarrow.float64(), _bits(~missing) if missing.any() else None, column)
    if column.dtype == np.int64:
        return made(pyarrow.int64(), None, column)
    if column.dtype == np.bool_:
        return made(pyarrow.bool_(), None, _bits(column))
    values = column.tolist()
    # Names repeat from row to row: each is encoded once. (Arrow's own decoding of a dictionary imports its functions.)
    texts = {value: str(value).encode("utf-8") for value in dict.fromkeys(values)}
    rows = [texts[value] for value in values]
    offsets = np.zeros(len(rows) + 1, dtype=np.int32)
    np.cumsum(np.fromiter(map(len, rows), np.int32, len(rows)), out=offsets[1:])
    return made(pyarrow.string(), None, offsets, b"".join(rows))


def _bits(flags: np.ndarray) -> np.ndarray:
    """Arrow keeps eight flags in a byte, the first one lowest."""
    return np.packbits(flags, bitorder="little")
