"""Files back into columns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.errors import UsageError
from wavesweep.results.schema import kinds_by_name


def read(path: str | Path) -> dict[str, np.ndarray]:
    """Give the columns of a CSV or Parquet table in their order, exactly as they were written.

    Numbers are float64 with NaN where missing, whole numbers int64, booleans bool, names object arrays of str.
    Raises UsageError for a file of another kind, OSError where it cannot be read.
    """
    path = Path(path)
    if path.suffix == ".csv":
        table = _read_csv(path)
    elif path.suffix == ".parquet":
        import pyarrow.parquet

        table = pyarrow.parquet.read_table(path)
    else:
        raise UsageError(f"{path}: found the suffix {path.suffix!r}, expected .csv or .parquet")
    return {name: _numpy(table.column(name)) for name in table.column_names}


def _read_csv(path: Path) -> Any:
    """Parse with the kinds that the columns' names stand for: a column of 1 and 0 does not show what it is."""
    import pyarrow
    import pyarrow.csv

    types = {
        "number": pyarrow.float64(),
        "integer": pyarrow.int64(),
        "boolean": pyarrow.bool_(),
        "string": pyarrow.string(),
    }
    known = {name: types[kind] for name, kind in kinds_by_name().items()}
    return pyarrow.csv.read_csv(
        path,
        parse_options=pyarrow.csv.ParseOptions(newlines_in_values=True),
        convert_options=pyarrow.csv.ConvertOptions(
            column_types=known, null_values=["NaN"], strings_can_be_null=False, true_values=["1"], false_values=["0"]
        ),
    )


def _numpy(column: Any) -> np.ndarray:
    import pyarrow

    if pyarrow.types.is_string(column.type):
        return np.array(column.to_pylist(), dtype=object)
    return column.to_numpy()
