"""A force that was recorded elsewhere: one CSV file, checked against the fast rate."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from wavesweep.analysis.march.inputs import Input
from wavesweep.errors import UsageError

_TOLERANCE = 0.01  # of a tick: times rounded to a few digits pass, a clock that drifts or loses samples does not


def read_force(path: str | Path, fast_hz: float) -> Input:
    """Read a record of hand force from a CSV file with a header line.

    Column ``force_N`` holds the force of each fast tick (N). If there is a column ``time_s`` its times must go up by
    exactly one fast period from row to row, within 1 % of it; they may start anywhere. Other columns are left alone.

    Errors: `UsageError` naming the file, the line, what was found and what was expected.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as stream:
            rows = csv.reader(stream)
            header = [name.strip() for name in next(rows, [])]
            lines = [(rows.line_num, row) for row in rows if any(map(str.strip, row))]
    except OSError as error:
        raise UsageError(f"{path}: expected a readable file, found: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"{path}: expected a CSV file in UTF-8, found: {error}") from error
    if "force_N" not in header:
        raise UsageError(f"{path}:1: expected a column force_N in the header, found {', '.join(header) or 'nothing'}")
    if not lines:
        raise UsageError(f"{path}: expected at least one row of numbers below the header, found none")
    force = _column(path, lines, header, "force_N")
    if "time_s" in header:
        _check_times(path, lines, _column(path, lines, header, "time_s"), fast_hz)
    return Input(force)


def _column(path: str | Path, lines: list, header: list, name: str) -> np.ndarray:
    """Read a column as finite numbers."""
    place, numbers = header.index(name), []
    for line, row in lines:
        cell = row[place].strip() if place < len(row) else ""
        number = _number(cell)
        if not math.isfinite(number):
            raise UsageError(f"{path}:{line}: {name}: expected a number, found {cell or 'nothing'}")
        numbers.append(number)
    return np.array(numbers)


def _number(cell: str) -> float:
    """Read a number; NaN for what is none."""
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _check_times(path: str | Path, lines: list, times: np.ndarray, fast_hz: float) -> None:
    """Refuse times that are not the ticks of the fast loop, at the first row that is off."""
    expected = times[0] + np.arange(len(times)) / fast_hz
    off = np.abs(times - expected) > _TOLERANCE / fast_hz
    if off.any():
        row = int(off.argmax())
        raise UsageError(
            f"{path}:{lines[row][0]}: time_s: expected {expected[row]:.9g}, a row every {1 / fast_hz:.9g} s as at the "
            f"fast rate, found {times[row]:.9g}; resample the record or set rates.fast_hz"
        )
