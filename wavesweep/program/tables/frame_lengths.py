"""Which lengths of frames decide what is proved for frames in any order, and which may be left out."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from wavesweep.program.columns import Columns
from wavesweep.program.number_words import rounded_up
from wavesweep.program.tables.refuters import Refuter, Refuters

RATIO = "rates.ratio"


def varying_lengths(written: Mapping[str, Any]) -> tuple[int, ...]:
    """Return the lengths of frames (ticks) that may follow each other in any order by a written spec; empty without any."""
    lengths = {str(block.get("every")) for block in written.get("block", {}).values()}
    lengths.add(RATIO)
    for name, axis in written.get("for_all", {}).items():
        varies = isinstance(axis, Mapping) and axis.get("varying")
        if varies and (name in lengths or name.removeprefix("numbers.") in lengths):
            values = axis.get("values") or range(int(axis["start"]), int(axis["stop"]) + 1)
            return tuple(map(int, values))
    return ()


class DecidingLengths:
    """Counts the lengths of frames in the counterexamples of rows, and how far these are from what is proved.

    A proof for all lengths is one for some of them, and a pattern refutes whatever has its lengths.
    So with these alone an end lies between what is proved here and what is refuted, too.
    """

    def __init__(self, lengths: tuple[int, ...]) -> None:
        self._lengths = lengths
        self._decide: set[int] = set()
        self._widest = 0.0  # relative distance between what is proved and what is refuted
        self._open = not lengths  # whether an end is neither refuted nor at the end of the range

    def add(self, columns: Columns, span: tuple[float, float]) -> None:
        """Count the rows of a table of intervals; span: the swept range."""
        if self._open or "fails_from" not in columns:
            return
        if not columns["intervals"].all():  # which lengths leave nothing there is not known
            self._open = True
            return
        for row in range(len(columns["intervals"])):
            low = float(columns["low"][row])
            high = float(columns["high"][row])
            refuters = Refuters.read(str(columns["counterexample"][row]))
            # Of the high end, up to where what is proved begins next to the low end of the range.
            from_start = low - span[0] <= 2e-3 * abs(high - span[0])
            self._add_end(low, columns["fails_below"][row], refuters.low, from_start)
            self._add_end(high, columns["fails_from"][row], refuters.high, high == span[1])

    def _add_end(self, end: float, fails: float, refuter: str, at_range: bool) -> None:
        """Count an end of an interval: refuted at `fails` by `refuter`, or where the swept range ends."""
        lengths = set()
        if not np.isnan(fails):
            with suppress(ValueError):
                lengths = {ticks for ticks, _ in Refuter.read(refuter).frames}
        if lengths:
            self._decide |= lengths
            apart = abs(fails - end) / abs(end) if end else np.inf
            self._widest = max(self._widest, float(apart))
        elif not at_range:
            self._open = True

    def numbers(self) -> dict[str, Any]:
        """The lengths that decide, those that may be left out, and by what share this may move an end; empty if not known."""
        left_out = sorted({*self._lengths} - self._decide)
        if self._open or not self._decide or not left_out:
            return {}
        return {
            "decide": sorted(self._decide),
            "left_out": left_out,
            "moves_an_end_by": self._widest,
        }


def lengths_in_words(numbers: Mapping[str, Any]) -> str:
    """Which lengths decide, as a sentence."""
    decide = _runs(numbers["decide"])
    left_out = _runs(numbers["left_out"])
    share = max(100 * numbers["moves_an_end_by"], 0.01)
    return f"frames of {decide} ticks decide: without those of {left_out} no end moves by more than {rounded_up(share, 2)} %"


def _runs(lengths: Iterable[int]) -> str:
    """Numbers in words, three and more in a row by their first and last."""
    runs: list[list[int]] = []
    for length in lengths:
        if runs and runs[-1][-1] == length - 1:
            runs[-1].append(length)
        else:
            runs.append([length])
    said = []
    for run in runs:
        if len(run) > 2:
            said.append(f"{run[0]} to {run[-1]}")
        else:
            said += map(str, run)
    return ", ".join(said)
