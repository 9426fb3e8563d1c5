"""What the intervals of all slices of a table have in common, gathered while its rows are written."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from wavesweep.program.columns import Columns, axes_of

BELOW, BETWEEN, ABOVE = range(3)  # gaps of a slice, by the intervals that they are next to
PLACE = 3  # columns of a row before the values of its axes: if it begins a slice, low, high


class InCommon:
    """The values that are in an interval of every slice: those that no gap of a slice covers.

    Gaps are below all intervals of a slice, between two of them or above; what is not known is one
    too.
    """

    def __init__(self) -> None:
        self._names: list[str] = []
        self._slices = 0
        self._without: dict[str, float] | None = None  # the place of the first without an interval
        self._last = np.zeros((0, PLACE))  # row so far
        self._gaps: list[np.ndarray] = []  # of each kind, see `_gaps`

    def add(self, columns: Columns) -> None:
        """Take a block of rows."""
        self._names = axes_of(columns)
        without = columns["intervals"] == 0
        first = columns["interval"] == 0
        low = np.where(without, np.inf, columns["low"])
        high = np.where(without, -np.inf, columns["high"])
        rows = np.column_stack([first, low, high, *(columns[name] for name in self._names)])
        self._slices += int(first.sum())
        if without.any() and self._without is None:
            self._without = self._place(rows[without][0, PLACE:])
        below = _gaps(-np.inf, low[first], rows[first])
        unknown = columns["open_places"] > 0
        open_ = _gaps(columns["open_low"][unknown], columns["open_high"][unknown], rows[unknown])
        if self._last.size:
            rows = np.concatenate([self._last, rows])
        self._last = rows[-1:]
        ended = rows[1:, 0] == 1
        inside = _gaps(rows[:-1, 2][~ended], rows[1:, 1][~ended], rows[:-1][~ended])
        above = _gaps(rows[:-1, 2][ended], np.inf, rows[:-1][ended])
        self._gaps = self._gaps or [below[:0]] * 3
        for kind, gaps in ((BELOW, below), (BETWEEN, open_), (BETWEEN, inside), (ABOVE, above)):
            self._gaps[kind] = _covered(self._gaps[kind], gaps)

    def numbers(self, span: tuple[float, float]) -> dict[str, Any] | None:
        """The intervals that all slices have in common, each end with the place that sets it, none
        at an end of the span; `without`, the place of a slice that has none, or else ends that rule
        all values out. None of fewer than two slices."""
        if self._slices < 2:
            return None
        above = _covered(self._gaps[ABOVE], _gaps(self._last[:, 2], np.inf, self._last))
        gaps = _covered(*self._gaps[:ABOVE], above)
        intervals = []
        for lower, upper in pairwise(gaps):
            low = self._end("low", lower, 1)
            high = self._end("high", upper, 0)
            if low["low"] <= span[0]:
                low["low_at"] = {}
            if high["high"] >= span[1]:
                high["high_at"] = {}
            intervals.append(low | high)
        common: dict[str, Any] = {"intervals": intervals}
        if self._without is not None:
            common["without"] = self._without
        elif not intervals and above[0, 0] <= self._gaps[BELOW][0, 1]:
            common |= self._end("low", self._gaps[BELOW][0], 1) | self._end("high", above[0], 0)
        return common

    def _end(self, name: str, gap: np.ndarray, end: int) -> dict[str, Any]:
        """An end of a gap, and the values of the axes that set it, those that the loop reads."""
        axes = len(self._names)
        place = gap[2 + axes * end : 2 + axes * (end + 1)]
        return {name: float(gap[end]), f"{name}_at": self._place(place)}

    def _place(self, values: np.ndarray) -> dict[str, float]:
        pairs = zip(self._names, values.tolist(), strict=True)
        return {name: value for name, value in pairs if not np.isnan(value)}


def _gaps(low: Any, high: Any, rows: np.ndarray) -> np.ndarray:
    """Gaps as their ends and, of each end, the place of the slice that sets it."""
    ends = np.broadcast_arrays(low, high, rows[:, 0])[:2]
    return np.column_stack([*ends, rows[:, PLACE:], rows[:, PLACE:]])


def _covered(*gaps: np.ndarray) -> np.ndarray:
    """What gaps cover, as gaps that are apart."""
    some = np.concatenate(gaps)
    some = some[np.argsort(some[:, 0], kind="stable")]
    reached = np.maximum.accumulate(some[:, 1])
    apart = np.ones(len(some), bool)
    apart[1:] = some[1:, 0] > reached[:-1]
    first = np.flatnonzero(apart)
    last = np.lexsort((some[:, 1], np.cumsum(apart)))[np.append(first, len(some))[1:] - 1]
    axes = 2 + (some.shape[1] - 2) // 2
    return np.column_stack([some[first, 0], some[last, 1], some[first, 2:axes], some[last, axes:]])
