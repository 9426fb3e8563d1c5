"""Figures in the axes of the paper: boundaries of stable regions side by side, and magnitudes over normalised frequency."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesweep.program.analyses.plane_columns import curves_of
from wavesweep.program.plots.labels import label
from wavesweep.program.plots.plane_regions import region_of
from wavesweep.program.plots.region_figures import Bars, draw_at_values, draw_region, handles_of, view_of
from wavesweep.program.plots.scales import scale_magnitudes
from wavesweep.program.plots.style import (
    IDEAL,
    LINES,
    ONE_COLUMN,
    TWO_COLUMNS,
    Look,
    distinct_colour,
    family_looks,
    figure,
    fitting,
    wide,
)

NEAR_ZERO = 0.3  # of the largest: an axis whose values come that close to 0 begins there
MARKS = "osv^D<>p"


@dataclass(frozen=True, eq=False)
class Plane:
    """One panel: a title, the axis along it, (name, `zwidth` columns, facts) of each design, the top of the axis (N/m).

    mark: a point (x, y) to compare with. note: text in the middle of the panel.
    """

    title: str
    x: str
    designs: Sequence[tuple[str, Mapping[str, np.ndarray], Mapping[str, Any]]]
    top: float
    mark: tuple[float, float] | None = None
    note: str = ""


def draw_planes(planes: Sequence[Plane]) -> Any:
    """Draw the panels side by side: the boundaries of stable regions, with strokes to the unstable side."""
    width = wide(ONE_COLUMN if len(planes) == 1 else TWO_COLUMNS)
    with figure(width, 2.8) as canvas:
        grid = np.atleast_1d(canvas.subplots(1, len(planes), sharey=True))
        for axes, plane in zip(grid, planes, strict=True):
            view = view_of(plane.x, False, width / len(planes), 2.8)
            for look, (_, columns, facts) in zip(family_looks(len(plane.designs)), plane.designs, strict=True):
                region = region_of(*curves_of([columns], view, facts), view)
                draw_region(axes, region, look, filled=False)
                draw_at_values(axes, region.bars, look, Bars())
            if plane.mark is not None:
                axes.plot(*plane.mark, "x", color="black", markersize=7, zorder=4)
            x = plane.designs[0][1][plane.x]
            axes.set(xlim=(x.min(), x.max()), ylim=(0.0, plane.top), xlabel=label(plane.x), title=plane.title)
            axes.text(0.5, 0.5, plane.note, ha="center", va="center", transform=axes.transAxes)
        grid[0].set_ylabel(label(str(planes[0].designs[0][1]["along"][0])))
        names = [name for name, *_ in planes[0].designs]
        canvas.legend(handles=handles_of(names), loc="outside lower center", ncols=fitting(names, width))
    return canvas


@dataclass(frozen=True, eq=False)
class Line:
    """One curve: its label (empty for none), frequency (rad/sample), magnitude and style.

    ideal: dashed black. shade: place in an ordered family. hue: place in a set without an order. dots: no line.
    """

    label: str
    omega: np.ndarray
    magnitude: np.ndarray
    ideal: bool = False
    shade: int | None = None
    hue: int = 0
    dots: bool = False


@dataclass(frozen=True)
class Panel:
    """The band of frequencies that a panel shows (rad/sample), and whether its magnitudes have a logarithmic scale."""

    band: tuple[float, float]
    logarithmic: bool


def draw_magnitudes(lines: Sequence[Line], panels: Sequence[Panel], title: str, level: tuple[float, str] | None = None) -> Any:
    """Draw the lines, a panel per band, each scaled to its contents; `level` is a value to compare with."""
    with figure(TWO_COLUMNS, 2.6) as canvas:
        for axes, panel in zip(np.atleast_1d(canvas.subplots(1, len(panels))), panels, strict=True):
            _draw_band(axes, lines, panel)
            if level is not None:
                axes.axhline(level[0], color="0.6", linewidth=0.8, linestyle=":", label=level[1])
            axes.set_xlabel("normalised frequency (rad/sample)")
        canvas.axes[0].set_ylabel(title)
        handles, labels = canvas.axes[0].get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside lower center", ncols=fitting(labels, wide(TWO_COLUMNS)))
    return canvas


def _draw_band(axes: Any, lines: Sequence[Line], panel: Panel) -> None:
    looks = family_looks(max(1, sum(line.shade is not None for line in lines)))
    for line in lines:
        # Only what the band shows, so that the vertical axis fits it.
        chosen = (line.omega >= panel.band[0]) & (line.omega <= panel.band[1] * (1 + 1e-9))
        axes.plot(line.omega[chosen], line.magnitude[chosen], **_look(line, looks), label=line.label or None)
    axes.set_xlim(panel.band)
    if panel.logarithmic:
        scale_magnitudes(axes)
    elif axes.dataLim.ymin < NEAR_ZERO * axes.dataLim.ymax:
        axes.set_ylim(bottom=0)
    axes.grid(visible=True, color="0.9", linewidth=0.5)


def _look(line: Line, looks: list[Look]) -> dict[str, Any]:
    if line.ideal:
        look = Look(IDEAL, "--")
    elif line.shade is None:
        look = Look(distinct_colour(line.hue), LINES[0 if line.hue == 0 else line.hue % len(LINES)])
    else:
        look = looks[line.shade]
    if line.dots:
        marker = "^" if line.ideal else MARKS[line.hue % len(MARKS)]
        return {"color": look.colour, "linestyle": "none", "marker": marker, "markersize": 3}
    return {"color": look.colour, "linestyle": look.line, "zorder": 3 if line.ideal else 2}
