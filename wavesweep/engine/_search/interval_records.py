"""Records of intervals: rows of slices."""

import traceback
import warnings

import numpy as np

from wavesweep.engine._stability.intervals import Intervals, in_rows
from wavesweep.engine.doubts import Doubt

FIELDS = (
    ("slice", "<i4"),
    ("intervals", "<i4"),
    ("interval", "<i4"),
    ("low", "<f8"),
    ("high", "<f8"),
    ("low_omega", "<f8"),
    ("high_omega", "<f8"),
    ("certified", "?"),
    ("residual", "<f8"),
    ("doubt", "i1"),
    ("low_cause", "i1"),
    ("high_cause", "i1"),
    ("argument", "i1"),
)
CAUSES = ("low_cause", "high_cause")
LINES = ("low_hz", "high_hz")
OPEN = (("open_places", "<i4"), ("open_low", "<f8"), ("open_high", "<f8"))


def record_type(*fields: tuple[str, str]) -> np.dtype:
    """The type of records of intervals, with fields of one's own: pairs of a name and a type."""
    return np.dtype([*FIELDS, *((name, "<f8") for name in LINES), *fields, *OPEN])


RECORD = record_type()

# what numerics raise where they have no answer; an error of any other kind is one of the program
FAILURES = (np.linalg.LinAlgError, FloatingPointError, OverflowError)


def records_of(intervals: Intervals, dtype: np.dtype) -> np.ndarray:
    """The intervals as records, sorted by slice (numbered from 0 in the chunk); see `in_rows`.

    dtype: of the records, with the fields of RECORD; other numbers are missing.
    """
    rows, open_ = in_rows(intervals)
    records = _missing(rows.column.size, dtype)
    records["slice"] = rows.column
    records["intervals"] = rows.count
    records["interval"] = np.maximum(rows.index, 0)
    for name in (
        "low",
        "high",
        "low_omega",
        "high_omega",
        "certified",
        "residual",
        "doubt",
        *CAUSES,
        "argument",
    ):
        records[name] = getattr(rows, name)
    for name, _ in OPEN:
        records[name] = getattr(open_, name.removeprefix("open_"))
    return records


def _missing(size: int, dtype: np.dtype) -> np.ndarray:
    """Records whose numbers are missing."""
    records = np.zeros(size, dtype)
    for name in dtype.names or ():
        if dtype[name].kind == "f":
            records[name] = np.nan
    return records


def blank_records(low: np.ndarray, high: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Records of slice 0 with these ends, or the one record of a slice without intervals; other
    numbers are missing."""
    records = _missing(max(low.size, 1), dtype)
    records["doubt"] = Doubt.SEARCH
    records["intervals"] = low.size
    if low.size:
        records["interval"] = np.arange(low.size)
        records["low"] = low
        records["high"] = high
    return records


def unanswered(
    dtype: np.dtype, number: int, span: tuple[float, float], error: Exception
) -> np.ndarray:
    """The record of a slice whose search failed in arithmetic: nothing is known from one end of the
    range to the other.

    Where it failed is a warning.
    """
    warnings.warn("".join(traceback.format_exception(error)), RuntimeWarning, stacklevel=2)
    record = blank_records(np.zeros(0), np.zeros(0), dtype)
    record["slice"] = number
    record["open_places"], record["open_low"], record["open_high"] = 1, *span
    return record
