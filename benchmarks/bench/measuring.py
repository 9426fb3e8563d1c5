"""Two calls timed alternately, so that a disturbance of the machine affects both; and the table of the measurements."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import _lru_cache_wrapper
from statistics import median
from typing import Any

import numpy as np

from wavesweep.program.results import Field

FIELDS = (
    Field("part", "string", "", "stiffness, response, compile, slices, workers, start, profile or accuracy"),
    Field("problem", "string", "", "what is computed"),
    Field("method", "string", "", "how"),
    Field("setting", "string", "", "grid, tolerance, or what was varied"),
    Field("size", "number", "1", "columns, frequencies, ticks of a frame, filter order, or slices"),
    Field("seconds", "number", "s", "median processor time, loops being known from a call before; of workers, wall time"),
    Field("seconds_each", "number", "s", "the same per column or frequency"),
    Field("ratio", "number", "1", "that over the yardstick's, median of pairs that were run in turn"),
    Field("first_seconds", "number", "s", "median processor time of a first call, which compiles its loops"),
    Field("first_ratio", "number", "1", "that over a first call of the yardstick, median of pairs that were run in turn"),
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


FULL = Patience(0.4, 2, 12)
QUICK = Patience(0.0, 1, 1)


def processor() -> float:
    """Processor seconds of this process so far, and of those that it started and waited for."""
    of_others = os.times()
    return time.process_time() + of_others.children_user + of_others.children_system


def interleaved(
    first: Callable[[], Any],
    second: Callable[[], Any],
    patience: Patience,
    before: Callable[[], Any] = lambda: None,
    clock: Callable[[], float] = processor,
) -> Pair:
    """Run A B A B ..., after both have been called before, and return medians; before: is called before each, untimed."""
    started, times = time.perf_counter(), []
    while len(times) < patience.fewest or (len(times) < patience.most and time.perf_counter() - started < patience.seconds):
        times.append((seconds(first, before, clock), seconds(second, before, clock)))
    return Pair(median(a for a, _ in times), median(b for _, b in times), median(a / b for a, b in times), len(times))


def at_first_too(first: Callable[[], Any], second: Callable[[], Any], patience: Patience) -> tuple[Pair, dict[str, float]]:
    """Measure calls of known loops, and of loops that are compiled anew, on both sides; the latter as fields of a row."""
    cold = interleaved(first, second, patience, forget)
    return interleaved(first, second, patience), {"first_seconds": cold.first, "first_ratio": cold.ratio}


def forget() -> None:
    """Empty all caches of this program and of the benchmark, so that the next call is a first one."""
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] in ("wavesweep", "bench"):
            for each in list(vars(module).values()):
                if isinstance(each, _lru_cache_wrapper):
                    each.cache_clear()


def seconds(call: Callable[[], Any], before: Callable[[], Any] = lambda: None, clock: Callable[[], float] = processor) -> float:
    """Time of one call; before: is called before, untimed."""
    before()
    started = clock()
    call()
    return clock() - started


def measured_on(facts: Mapping[str, Any]) -> str:
    """Where, when and with what was measured, in a line."""
    versions = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
    commit = f" ({facts['commit']})" if facts["commit"] else ""
    return f"{facts['processor']}, one thread, {facts['date']}: wavesweep {facts['tool_version']}{commit}, {versions}"
