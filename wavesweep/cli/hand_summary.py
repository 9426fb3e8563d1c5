"""What a user wants to know of a table of intervals for several hands before opening it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from wavesweep.cli.interval_summary import IntervalTally, Line

WORDS = {
    "free": "free device",
    "operator": "held by the spec's operator",
    "passive": "guaranteed for every passive hand",
    "box": "stable for every hand of the box",
    "port": "port passive for held forces",
}


class HandTally:
    """Counts the rows of each hand as they pass: `add` every block, then ask for `lines`."""

    def __init__(self) -> None:
        self._tallies: dict[str, IntervalTally] = {}
        self._unsettled = 0

    def add(self, columns: Mapping[str, np.ndarray]) -> None:
        """Count a block of rows, all of one hand."""
        if not len(columns["hand"]):
            return
        rows = {name: column for name, column in columns.items() if name != "hand"}
        self._tallies.setdefault(str(columns["hand"][0]), IntervalTally()).add(rows)
        if "settled" in columns and columns["hand"][0] == "box":
            self._unsettled += int((~columns["settled"]).sum())

    def lines(self, facts: Mapping[str, Any]) -> Iterator[Line]:
        """Give lines, each with whether it is a warning."""
        yield from ((str(notice), False) for notice in facts.get("notices", ()))
        for hand, tally in self._tallies.items():
            yield f"{WORDS[hand]} ({hand}): {tally.largest()}{_ended_by(tally.row)}; {tally.certified()}", False
        if self._unsettled:
            yield f"{self._unsettled} rows of the box are searched alone, some hand may do worse: settled 0", True


def _ended_by(row: Mapping[str, Any]) -> str:
    """Name the hand that ends the interval, where one is known to."""
    hand = [row.get(f"high_hand_{part}", np.nan) for part in ("mass", "damping", "stiffness")]
    return "" if np.isnan(hand[0]) else ", ended by a hand of {:.4g} kg, {:.4g} N*s/m, {:.4g} N/m".format(*hand)
