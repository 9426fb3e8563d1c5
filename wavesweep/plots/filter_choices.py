"""The figure of filter choices: how much the channel exceeds 1 over LP1's cutoff, a line per order."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.plots.style import TWO_COLUMNS, family_colours, figure

_FLOOR = 1e-10
_PANELS = (("channel_norm", "pmw: channel norm - 1"), ("bank_norm", "pmw-lm, way out: norm - 1"))


def filter_choices(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any], path: Path) -> None:
    """Draw a `passivity-filters` table as PNG: without the local model at the left, with it at the right."""
    del facts
    orders = np.unique(columns["lp1_order"]).tolist()
    with figure(path, TWO_COLUMNS, 2.9) as canvas:
        panels = canvas.subplots(1, 2, sharey=True)
        for panel, (name, title) in zip(panels, _PANELS, strict=True):
            for colour, order in zip(family_colours(len(orders)), orders, strict=True):
                rows = columns["lp1_order"] == order
                excess = np.maximum(columns[name][rows] - 1, _FLOOR)
                panel.plot(columns["lp1_cutoff_hz"][rows], excess, color=colour, label=f"{order}", marker=".", linewidth=1)
            panel.set_yscale("log")
            panel.set_xlabel("LP1 cutoff (Hz)")
            panel.set_ylabel(title)
            panel.grid(visible=True, color="0.9", linewidth=0.5)
        panels[0].set_ylim(_FLOOR / 3, 1)
        handles, labels = panels[0].get_legend_handles_labels()
        canvas.legend(handles, labels, title="order", loc="outside upper center", ncols=8)
