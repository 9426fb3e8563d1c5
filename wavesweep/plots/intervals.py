"""The figure of stable intervals: where the loop is stable, over the plane of two axes or as bars."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from wavesweep.plots.bars import draw_bars
from wavesweep.plots.hands import draw_hand_bars, draw_hand_regions, hand_handles, lay_out_hands, promised
from wavesweep.plots.layout import Layout, axes_of, lay_out
from wavesweep.plots.region import draw_region
from wavesweep.plots.style import DOUBTFUL, ONE_COLUMN, TWO_COLUMNS, UNKNOWN, family_colours, figure, incomplete, label, symbol

_PANEL_HEIGHT = 2.3  # inches
_LETTERS_PER_INCH = 16


def zwidth(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any], path: Path) -> None:
    """Draw the stable intervals of a `zwidth` or `stability-region` table as PNG.

    The stable region is filled, its holes stay white; its boundary is solid where certified, dashed red where not.
    Slices of which not all is known are hatched outside of their intervals.
    Values of a further axis become panels, those of one more a family of lines; a note says what did not fit.
    """
    layout = (lay_out_hands if "hand" in columns else lay_out)(axes_of(columns))
    shown = layout.shows(columns)
    draw({name: column[shown] for name, column in columns.items()}, facts, path, layout)


def draw(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any], path: Path, layout: Layout) -> None:
    """Draw the same from the rows that the layout shows."""
    del facts
    panels = layout.panel_values or (np.nan,)
    across = 1 if len(panels) == 1 else 2 if len(panels) in (2, 4) else 3
    rows = -(-len(panels) // across)
    width = ONE_COLUMN if across == 1 else TWO_COLUMNS
    height = 2.8 if across == 1 else _PANEL_HEIGHT * rows + 0.4
    with figure(path, width, height) as canvas:
        grid = canvas.subplots(rows, across, sharex=True, sharey=True, squeeze=False)
        for axes, value in zip(grid.flat, panels, strict=False):
            _draw_panel(axes, _rows_where(columns, layout.panels, value), layout)
            if layout.panels is not None:
                axes.set_title(f"{symbol(layout.panels)} = {value:g}")
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        _limit(grid[0, 0], columns, bars=layout.x is None)
        _name_axes(canvas, columns, layout)
        _add_legend(canvas, columns, layout)


def _draw_panel(axes: Any, columns: Mapping[str, np.ndarray], layout: Layout) -> None:
    if layout.x is not None and not (columns["intervals"] > 0).any():
        nothing = "nothing known to be stable" if incomplete(columns).any() else "nowhere stable in the swept range"
        axes.text(0.5, 0.5, nothing, ha="center", va="center", transform=axes.transAxes)
    members = [_rows_where(columns, layout.family, value) for value in layout.members or (np.nan,)]
    if layout.x is None:
        if "hand" in columns:
            draw_hand_bars(axes, columns)
        else:
            draw_bars(axes, members, [f"{v:g}" for v in layout.members])
        return
    if _logarithmic(columns[layout.x]):
        axes.set_xscale("log")
    if "hand" in columns:
        draw_hand_regions(axes, columns, layout.x)
    else:
        for colour, member in zip(family_colours(len(members)), members, strict=True):
            draw_region(axes, member, layout.x, colour, alone=len(members) == 1)
    axes.set_xlim(columns[layout.x].min(), columns[layout.x].max())


def _limit(axes: Any, columns: Mapping[str, np.ndarray], bars: bool) -> None:
    """Show every interval of the table; all panels share these limits, so that they can be compared."""
    bottom, top = np.nanmin(columns["low"], initial=0.0), np.nanmax(columns["high"], initial=0.0)
    limits = (float(bottom), float(top + 0.05 * (top - bottom)) if top > bottom else 1.0)
    axes.set_xlim(limits) if bars else axes.set_ylim(limits)


def _rows_where(columns: Mapping[str, np.ndarray], axis: str | None, value: float) -> dict[str, np.ndarray]:
    chosen = slice(None) if axis is None else columns[axis] == value
    return {name: column[chosen] for name, column in columns.items()}


def _logarithmic(values: np.ndarray) -> bool:
    """Whether an axis was spaced by a constant factor: then it is drawn so."""
    steps = np.unique(values)
    if len(steps) < 4 or steps[0] <= 0:
        return False
    return bool(np.ptp(np.diff(np.log(steps))) < 1e-6 * np.log(steps[-1] / steps[0]))


def _name_axes(canvas: Any, columns: Mapping[str, np.ndarray], layout: Layout) -> None:
    along = label(str(columns["along"][0]))
    bars = layout.x is None
    # The note is a further line of the label: the layout makes room for that, and for nothing that is placed by hand.
    note = wrap(layout.left_out, int(_LETTERS_PER_INCH * canvas.get_figwidth()))
    canvas.supxlabel("\n".join([along if bars else label(layout.x), *note]), fontsize=8)
    across = (label(layout.family) if layout.family else "") if bars else along
    if across:
        canvas.supylabel(across, fontsize=8)


def _add_legend(canvas: Any, columns: Mapping[str, np.ndarray], layout: Layout) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = hand_handles(columns) if "hand" in columns else []
    if layout.x is not None and layout.family is not None:
        colours = family_colours(len(layout.members))
        handles = [Line2D([], [], color=c, label=f"{v:g}") for c, v in zip(colours, layout.members, strict=True)]
    if not (columns["certified"] | promised(columns)).all():
        handles.append(Line2D([], [], color=DOUBTFUL, linestyle="--", label="not certified"))
    if incomplete(columns).any():
        handles.append(Patch(**UNKNOWN, label="not known outside the intervals"))
    if handles:
        title = label(layout.family) if layout.family is not None and len(handles) > 1 else None
        across = 2 if "hand" in columns else 6
        place = {"loc": "outside upper center", "ncols": across, "columnspacing": 1.0, "handlelength": 1.3}
        canvas.legend(handles=handles, title=title, **place)
