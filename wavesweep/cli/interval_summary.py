"""What a user wants to know of a table of intervals before opening it, counted while its rows pass by."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from wavesweep.analysis.doubt import DOUBTS, INCOMPLETE

Line = tuple[str, bool]


class IntervalTally:
    """Counts rows as they pass: `add` every block, then ask for `lines`."""

    def __init__(self) -> None:
        self._rows = self._intervals = self._split = 0
        self._doubts: Counter[str] = Counter()
        self._along = "?"
        self._largest: dict[str, Any] = {}

    def add(self, columns: Mapping[str, np.ndarray]) -> None:
        """Count a block of rows."""
        if not len(columns["along"]):
            return
        stable = columns["intervals"] > 0
        self._along = str(columns["along"][0])
        self._rows += len(stable)
        self._intervals += int(stable.sum())
        # A slice has one row numbered 0, whatever it holds.
        self._split += int(((columns["intervals"] > 1) & (columns["interval"] == 0)).sum())
        self._doubts.update(columns["doubt"][~columns["certified"]].tolist())
        if stable.any():
            row = int(np.nanargmax(columns["high"]))
            if not self._largest or columns["high"][row] > self._largest["high"]:
                self._largest = {name: column[row] for name, column in columns.items()}

    def lines(self, facts: Mapping[str, Any]) -> Iterator[Line]:
        """Give lines, each with whether it is a warning."""
        yield from ((str(notice), False) for notice in facts.get("notices", ()))
        slices = facts["slices"]
        skipped = f" ({slices['skipped']} skipped)" if slices["skipped"] else ""
        holes = f", {_count(self._split, 'slice')} with a hole" if self._split else ""
        found = _count(self._intervals, "stable interval")
        yield f"{_count(slices['computed'], 'slice')}{skipped}: {found}{holes}", False
        yield self.largest(), False
        yield self.certified(), bool(self._doubts)
        for word in DOUBTS:
            if self._doubts[word]:
                yield f"  {word}: {DOUBTS[word]}", True

    @property
    def row(self) -> Mapping[str, Any]:
        """The row of the largest stable value; empty where none is stable."""
        return self._largest

    def certified(self) -> str:
        """Say how many rows are certified."""
        # Rows and not slices: an uncertified row names the interval that a user should not lean on.
        every = _count(self._rows, "row")
        reasons = ", ".join(f"{word} {self._doubts[word]}" for word in DOUBTS if self._doubts[word])
        return f"{self._doubts.total()} of {every} not certified ({reasons})" if self._doubts else f"all {every} certified"

    def largest(self) -> str:
        """Name the largest value that is stable, and where."""
        incomplete = any(self._doubts[word] for word in INCOMPLETE)
        if not self._largest:
            known = f"no {self._along} is known to be stable, and not all of the swept range is known"
            return known if incomplete else f"no stable {self._along} anywhere in the swept range"
        row = self._largest
        axes = list(row)[: list(row).index("along")]
        place = ", ".join(f"{axis} = {row[axis]:g}" for axis in axes)
        ended = ""
        if np.isnan(row["high_omega"]):
            ended = ", where what is known ends" if row["doubt"] in INCOMPLETE else ", where the swept range ends"
        return f"largest stable {self._along}: {row['high']:.6g}{f' at {place}' if place else ''}{ended}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
