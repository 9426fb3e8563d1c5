"""The figure of the response that a simulation shows, over that of the linear loop."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.plots.style import IDEAL, TWO_COLUMNS, distinct_colour, figure

_PANELS = (
    ("admittance_abs", "admittance (m/N)"),
    ("impedance_abs", "impedance (N/m)"),
    ("admittance_deg", "phase (deg)"),
    ("impedance_deg", "phase (deg)"),
)


def simulate_response(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any], path: Path) -> None:
    """Draw a `simulate-response` table as PNG: dots as estimated from the run, a line as the linear loop has it."""
    del facts
    order = np.argsort(columns["frequency_hz"])
    sorted_columns = {name: column[order] for name, column in columns.items()}
    with figure(path, TWO_COLUMNS, 4.0) as canvas:
        grid = canvas.subplots(2, 2, sharex=True)
        for axes, (name, title) in zip(grid.flat, _PANELS, strict=True):
            _draw_panel(axes, sorted_columns, name)
            axes.set_ylabel(title)
        for axes in grid[1]:
            axes.set_xlabel("frequency (Hz)")
        canvas.align_ylabels()
        handles, labels = grid[0, 0].get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside lower center", ncols=2)


def _draw_panel(axes: Any, columns: Mapping[str, np.ndarray], name: str) -> None:
    frequency, linear, seen = columns["frequency_hz"], columns[f"linear_{name}"], columns[name]
    if name.endswith("_deg"):
        linear = np.unwrap(linear, period=360.0)
        seen = linear + (seen - linear + 180.0) % 360.0 - 180.0  # on the same turn as the line
    else:
        axes.set_yscale("log")
    line = {"marker": "_", "markersize": 14} if len(frequency) == 1 else {}
    axes.plot(frequency, linear, color=IDEAL, linewidth=0.9, label="linear loop", **line)
    axes.plot(frequency, seen, "o", color=distinct_colour(0), markersize=3, label="simulated")
    axes.grid(visible=True, color="0.9", linewidth=0.5)
