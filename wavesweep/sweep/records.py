"""What is kept of a finished chunk: a record per interval, or one for a column that has none."""

import numpy as np

from wavesweep.analysis.intervals import Intervals

FIELDS = (
    ("column", "<i4"), ("intervals", "<i4"), ("interval", "<i4"), ("low", "<f8"), ("high", "<f8"),
    ("low_omega", "<f8"), ("high_omega", "<f8"), ("certified", "?"), ("residual", "<f8"), ("doubt", "i1"),
)
DTYPE = np.dtype(list(FIELDS))
END_HANDS = {end: tuple(f"{end}_hand_{part}" for part in ("mass", "damping", "stiffness")) for end in ("low", "high")}
# What holds for hands has besides the hand that sets an end, and whether it is proved for all that it is for.
HELD = np.dtype([*FIELDS, *((name, "<f8") for names in END_HANDS.values() for name in names), ("settled", "?")])


def records_of(found: Intervals) -> np.ndarray:
    """The intervals as records, sorted by column (numbered from 0 in the chunk)."""
    records = np.empty(found.column.size, DTYPE)
    records["intervals"], records["interval"] = found.count, np.maximum(found.index, 0)
    for name in ("column", "low", "high", "low_omega", "high_omega", "certified", "residual", "doubt"):
        records[name] = getattr(found, name)
    return records


def is_whole(records: np.ndarray, columns: int) -> bool:
    """Whether they are records and every one of the columns has as many as it says."""
    if not records.size:
        return False
    starts = np.flatnonzero(np.append(True, np.diff(records["column"]) != 0))
    rows = np.diff(np.append(starts, records.size))
    return np.array_equal(records["column"][starts], np.arange(columns)) and np.array_equal(
        rows, np.maximum(records["intervals"][starts], 1)
    )


def certified_columns(records: np.ndarray) -> int:
    """How many columns are certified; all records of a column agree on it."""
    return int((records["certified"] & (records["interval"] == 0)).sum())
