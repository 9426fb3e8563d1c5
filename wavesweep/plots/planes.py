"""Stable regions of several designs over the same plane, within axes that are given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.plots.region import draw_region
from wavesweep.plots.style import ONE_COLUMN, TWO_COLUMNS, family_colours, figure, label


@dataclass(frozen=True, eq=False)
class Plane:
    """One panel: a title, the axis along it, (name, `zwidth` columns) of each design, the top of the axis (N/m).

    mark: a point (x, y) to compare with. note: what the panel's lines cannot say.
    """

    title: str
    x: str
    designs: Sequence[tuple[str, Mapping[str, np.ndarray]]]
    top: float
    mark: tuple[float, float] | None = None
    note: str = ""


def draw_planes(planes: Sequence[Plane], path: Path) -> None:
    """Draw the panels side by side as PNG: stable regions filled, a line where the loop becomes unstable."""
    with figure(path, ONE_COLUMN if len(planes) == 1 else TWO_COLUMNS, 2.8) as canvas:
        grid = np.atleast_1d(canvas.subplots(1, len(planes), sharey=True))
        for axes, plane in zip(grid, planes, strict=True):
            _draw_plane(axes, plane)
        along = str(planes[0].designs[0][1]["along"][0])
        grid[0].set_ylabel(label(along))
        _add_legend(canvas, planes[0])


def _draw_plane(axes: Any, plane: Plane) -> None:
    colours = family_colours(len(plane.designs))
    for colour, (_, columns) in zip(colours, plane.designs, strict=True):
        draw_region(axes, columns, plane.x, colour, alone=False)
    if plane.mark is not None:
        axes.plot(*plane.mark, "x", color="black", markersize=7, zorder=4)
    columns = plane.designs[0][1]
    axes.set_xlim(columns[plane.x].min(), columns[plane.x].max())
    axes.set_ylim(0.0, plane.top)
    axes.set_xlabel(label(plane.x))
    axes.set_title(plane.title)
    axes.text(0.5, 0.5, plane.note, ha="center", va="center", transform=axes.transAxes)


def _add_legend(canvas: Any, plane: Plane) -> None:
    from matplotlib.lines import Line2D

    colours = family_colours(len(plane.designs))
    handles = [Line2D([], [], color=c, label=name) for c, (name, _) in zip(colours, plane.designs, strict=True)]
    canvas.legend(handles=handles, loc="outside lower center", ncols=4)
