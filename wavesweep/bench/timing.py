"""Two things timed side by side, so that what disturbs the machine disturbs both."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any


@dataclass(frozen=True)
class Pair:
    """Medians over the pairs: seconds of either side, and of the quotient of each pair, first by second."""

    first: float
    second: float
    ratio: float
    pairs: int


@dataclass(frozen=True)
class Patience:
    """How long a pair is measured: at least `fewest` pairs, then on until `seconds` are over or `most` are done."""

    seconds: float
    fewest: int
    most: int


FULL = Patience(0.8, 2, 25)
QUICK = Patience(0.0, 1, 1)


def interleaved(first: Callable[[], Any], second: Callable[[], Any], patience: Patience) -> Pair:
    """Run A B A B ..., both of them warm already, and give medians."""
    started, times = time.perf_counter(), []
    while len(times) < patience.fewest or (
        len(times) < patience.most and time.perf_counter() - started < patience.seconds
    ):
        times.append((_timed(first), _timed(second)))
    return Pair(
        median(a for a, _ in times), median(b for _, b in times), median(a / b for a, b in times), len(times)
    )


def _timed(call: Callable[[], Any]) -> float:
    started = time.perf_counter()
    call()
    return time.perf_counter() - started
