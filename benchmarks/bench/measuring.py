"""Two calls timed alternately, so that a disturbance of the machine affects both; and the table of the measurements."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

from wavesweep.core.results import Field

FIELDS = (
    Field("part", "string", "", "stiffness, response, compile, slices, workers, start, profile or accuracy"),
    Field("problem", "string", "", "what is computed"),
    Field("method", "string", "", "how"),
    Field("setting", "string", "", "grid, tolerance, or what was varied"),
    Field("size", "number", "1", "columns, frequencies, ticks of a frame, filter order, or slices"),
    Field("seconds", "number", "s", "median run time"),
    Field("seconds_each", "number", "s", "run time per column or frequency"),
    Field("ratio", "number", "1", "run time over the yardstick's, median of pairs that were run in turn"),
    Field("yardstick", "string", "", "what the ratio is to"),
    Field("pairs", "number", "1", "number of such pairs"),
    Field("error_max", "number", "1", "largest relative error against 50 digits"),
    Field("error_median", "number", "1", "median relative error against 50 digits"),
    Field("found", "number", "1", "stable intervals found, each by exactly one"),
    Field("there", "number", "1", "stable intervals that there are"),
    Field("wrong", "number", "1", "columns with another number of intervals than there are"),
)

Row = Mapping[str, Any]


def columns_of(rows: Iterable[Row]) -> dict[str, np.ndarray]:
    """The rows as columns; if a row does not have a field, it is missing there."""
    rows = list(rows)
    out = {}
    for field in FIELDS:
        if field.kind == "string":
            out[field.name] = np.array([row.get(field.name, "") for row in rows], dtype=object)
        else:
            out[field.name] = np.array([row.get(field.name, np.nan) for row in rows], dtype=float)
    return out


@dataclass(frozen=True)
class Pair:
    """Medians over the pairs: seconds of either side, and of the quotient of each pair, first by second."""

    first: float
    second: float
    ratio: float
    pairs: int


@dataclass(frozen=True)
class Patience:
    """Duration of a measurement: at least `fewest` pairs, then more until `seconds` have passed or `most` are done."""

    seconds: float
    fewest: int
    most: int


FULL = Patience(0.8, 2, 25)
QUICK = Patience(0.0, 1, 1)


def interleaved(first: Callable[[], Any], second: Callable[[], Any], patience: Patience) -> Pair:
    """Run A B A B ..., after both have been called before, and return medians."""
    started, times = time.perf_counter(), []
    while len(times) < patience.fewest or (len(times) < patience.most and time.perf_counter() - started < patience.seconds):
        times.append((seconds(first), seconds(second)))
    return Pair(median(a for a, _ in times), median(b for _, b in times), median(a / b for a, b in times), len(times))


def seconds(call: Callable[[], Any]) -> float:
    """Wall time of one call."""
    started = time.perf_counter()
    call()
    return time.perf_counter() - started
