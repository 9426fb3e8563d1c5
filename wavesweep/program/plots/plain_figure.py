"""The figure of a table whose capability is not installed: its numbers, a panel for each column."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from wavesweep.program.columns import Columns
from wavesweep.program.plots.style import GRID, ONE_COLUMN, figure, note_below

MOST_PLAIN_PANELS = 12  # panels


def plain(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw each column of numbers over the first one that grows from row to row, or over the
    number of the row."""
    del facts
    numbers = {
        name: column.astype(float) for name, column in columns.items() if column.dtype.kind in "fiu"
    }
    growing = (
        name for name, column in numbers.items() if column.size > 1 and (np.diff(column) > 0).all()
    )
    x = next(growing, "")
    drawn = {
        name: column for name, column in numbers.items() if name != x and np.isfinite(column).any()
    }
    shown = list(drawn)[:MOST_PLAIN_PANELS]
    with figure(2 * ONE_COLUMN, 0.6 + 1.1 * max(1, -(-len(shown) // 3))) as canvas:
        panels = canvas.subplots(max(1, -(-len(shown) // 3)), 3, squeeze=False, sharex=True).flat
        for name, axes in zip(shown, panels, strict=False):
            places = numbers[x] if x else np.arange(drawn[name].size)
            axes.plot(places, drawn[name], ".-", color="0.3", linewidth=0.6, markersize=3)
            axes.set_title(name, fontsize=8)
            axes.grid(**GRID)
        for axes in list(panels):
            axes.set_visible(False)
        left_out = [name for name in columns if name not in (x, *shown)]
        said = f"Not drawn: {', '.join(left_out)}." if left_out else ""
        note_below(
            canvas, "Drawn plainly: what makes this table is not installed.", said, axis=x or "row"
        )
    return canvas
