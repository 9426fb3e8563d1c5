"""How good an answer is: its ends against 50-digit arithmetic, and the intervals that it finds of those there are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Answer:
    """Stable intervals: numbers of their columns, `(n,)`, and their ends in N/m, `(n,)` each."""

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Score:
    """error_max, error_median: relative, over the critical stiffnesses of intervals that were found; NaN without any.

    found: intervals of the reference that exactly one interval of the answer meets, and which meets no other.
    there: intervals of the reference. wrong: columns that have another number of intervals than there are.
    """

    error_max: float
    error_median: float
    found: int
    there: int
    wrong: int


def score(answer: Answer, truth: Sequence[Sequence[tuple[float, float]]], span: tuple[float, float]) -> Score:
    """Compare with the reference; truth: the intervals of each column. An end that the range ends is no critical one."""
    errors: list[float] = []
    found = wrong = 0
    for number, there in enumerate(truth):
        mine = np.flatnonzero(answer.column == number)
        claimed = list(zip(answer.low[mine].tolist(), answer.high[mine].tolist(), strict=True))
        wrong += len(claimed) != len(there)
        meets = np.array([[a < d and c < b for c, d in claimed] for a, b in there]).reshape(len(there), len(claimed))
        for i, j in zip(*np.nonzero(meets), strict=True):
            if meets[i].sum() == 1 and meets[:, j].sum() == 1:
                found += 1
                pairs = zip(claimed[j], there[i], strict=True)
                errors += [abs(got - true) / abs(true) for got, true in pairs if true not in span]
    known = (max(errors), float(np.median(errors))) if errors else (np.nan, np.nan)
    return Score(*known, found, sum(map(len, truth)), wrong)
