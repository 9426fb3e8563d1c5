"""The figure of a table that does not fit into memory: its rows pass by, and those that it shows are kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.plots.hands import lay_out_hands
from wavesweep.plots.layout import lay_out


class Picture:
    """Give it every block of rows by `add`, then `draw`.

    `axes`: name -> values of the table's leading columns. `hands`: whether its rows are of several hands.
    """

    def __init__(self, axes: Mapping[str, Sequence[float]], hands: bool = False) -> None:
        self._layout = (lay_out_hands if hands else lay_out)(axes)
        self._kept: list[dict[str, np.ndarray]] = []

    def add(self, columns: Mapping[str, np.ndarray]) -> None:
        """Keep what the figure shows of a block of rows."""
        shown = self._layout.shows(columns)
        self._kept.append({name: column[shown] for name, column in columns.items()})

    def draw(self, facts: Mapping[str, Any], path: Path) -> None:
        """Draw the figure as PNG."""
        from wavesweep.plots.intervals import draw

        rows = {name: np.concatenate([block[name] for block in self._kept]) for name in self._kept[0]}
        draw(rows, facts, path, self._layout)
