"""Magnitudes over normalised frequency, on plain axes and in bands: how the field's papers draw responses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.plots.style import IDEAL, TWO_COLUMNS, distinct_colour, family_colours, figure

_NEAR_ZERO = 0.3  # of the largest: an axis whose values come that close to 0 begins there


@dataclass(frozen=True, eq=False)
class Line:
    """One curve: its label (empty for none), frequency (rad/sample), magnitude, and what it looks like.

    ideal: dashed black. shade: place in an ordered family. hue: place among things without an order. dots: no line.
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
    """The band of frequencies that a panel shows (rad/sample), and whether its magnitudes go by factors."""

    band: tuple[float, float]
    logarithmic: bool


def draw_magnitudes(
    lines: Sequence[Line], panels: Sequence[Panel], title: str, path: Path, level: tuple[float, str] | None = None
) -> None:
    """Draw the lines as PNG, a panel per band, each scaled to what it shows; `level` is a value to compare with."""
    with figure(path, TWO_COLUMNS, 2.6) as canvas:
        for axes, panel in zip(np.atleast_1d(canvas.subplots(1, len(panels))), panels, strict=True):
            _draw_panel(axes, lines, panel)
            if level is not None:
                axes.axhline(level[0], color="0.6", linewidth=0.8, linestyle=":", label=level[1])
            axes.set_xlabel("normalised frequency (rad/sample)")
        canvas.axes[0].set_ylabel(title)
        handles, labels = canvas.axes[0].get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside lower center", ncols=6)


def _draw_panel(axes: Any, lines: Sequence[Line], panel: Panel) -> None:
    colours = family_colours(max(1, sum(line.shade is not None for line in lines)))
    for line in lines:
        # Only what the band shows, so that the vertical axis fits it.
        chosen = (line.omega >= panel.band[0]) & (line.omega <= panel.band[1] * (1 + 1e-9))
        axes.plot(line.omega[chosen], line.magnitude[chosen], **_style(line, colours), label=line.label or None)
    axes.set_xlim(panel.band)
    if panel.logarithmic:
        _by_factors(axes)
    elif axes.dataLim.ymin < _NEAR_ZERO * axes.dataLim.ymax:
        axes.set_ylim(bottom=0)
    axes.grid(visible=True, color="0.9", linewidth=0.5)


def _by_factors(axes: Any) -> None:
    """Set a logarithmic scale with plain numbers at 1, 2, 5; powers of ten alone would leave one label or none."""
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())


def _style(line: Line, colours: list[Any]) -> dict[str, Any]:
    colour = IDEAL if line.ideal else distinct_colour(line.hue) if line.shade is None else colours[line.shade]
    if line.dots:
        return {"color": colour, "linestyle": "none", "marker": "o", "markersize": 3}
    return {"color": colour, "linestyle": "--" if line.ideal else "-", "zorder": 3 if line.ideal else 2}
