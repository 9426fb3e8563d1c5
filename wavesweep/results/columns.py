"""Columns as they come in are held to their fields before anything is written."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wavesweep.errors import WavesweepError
from wavesweep.results.schema import Field

_DTYPES = {"number": np.float64, "integer": np.int64, "boolean": np.bool_, "string": np.object_}
_ACCEPTED = {"number": "fiu", "integer": "iu", "boolean": "b", "string": "OU"}


def checked(fields: tuple[Field, ...], columns: Mapping[str, Any], first_row: int = 0) -> dict[str, np.ndarray]:
    """Give the columns in their fields' order as contiguous float64, int64, bool and object arrays.

    `first_row` is how many rows of the table came before these; it only makes the row numbers of errors right.
    Raises WavesweepError where columns are missing, unknown, of unequal length or of the wrong kind, and where a
    number is infinite: no table holds an infinity, several readers break on it.
    """
    expected = [field.name for field in fields]
    if sorted(columns) != sorted(expected):
        raise WavesweepError(f"the table's columns are {', '.join(columns)}; expected {', '.join(expected)}")
    arrays = {field.name: _typed(field, np.asarray(columns[field.name])) for field in fields}
    lengths = {name: array.shape[0] for name, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise WavesweepError(f"the table's columns differ in length: {lengths}")
    for name, array in arrays.items():
        _refuse_infinity(name, array, first_row)
    return arrays


def _typed(field: Field, array: np.ndarray) -> np.ndarray:
    if array.ndim != 1 or (array.size and array.dtype.kind not in _ACCEPTED[field.kind]):
        raise WavesweepError(
            f"column {field.name}: found {array.ndim}-dimensional {array.dtype}, expected a column of kind {field.kind}"
        )
    return np.ascontiguousarray(array, dtype=_DTYPES[field.kind])


def _refuse_infinity(name: str, array: np.ndarray, first_row: int) -> None:
    if array.dtype != np.float64 or not np.isinf(array).any():
        return
    row = int(np.flatnonzero(np.isinf(array))[0])
    raise WavesweepError(
        f"column {name}, row {first_row + row + 1}: found {array[row]}, expected a finite number or a missing value; "
        "nothing was written"
    )
