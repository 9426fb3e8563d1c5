"""The figure of poles in the plane of the frame: the modes of a loop by name, or their root
locus over a number."""

from collections.abc import Mapping
from textwrap import fill
from typing import Any

import numpy as np

from wavesweep.engine.poles import GONE
from wavesweep.poles.table import modes
from wavesweep.program.columns import Columns
from wavesweep.program.plots.labels import assumption, label, symbol, unit
from wavesweep.program.plots.scales import is_logarithmic
from wavesweep.program.plots.style import (
    DOUBTFUL,
    GRID,
    ONE_COLUMN,
    distinct_colour,
    family_map,
    figure,
    note_below,
    wide,
)

REACH = 1.5  # what is farther from 0 is not shown
ROOM_OF_CIRCLE = 1.05  # about the unit circle, which is shown whole
NAMED = 6  # modes with a mark of their own
RATIOS = (0.1, 0.3, 0.5, 0.7)  # of damping, each with a line
LETTERS, BESIDE = 19.0, 0.6  # of a legend in an inch, and inches for its marks
_MARKS = "osD^v<>"
_CIRCLE = np.exp(1j * np.linspace(0, 2 * np.pi, 721))


def poles(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `poles` table: the unit circle, lines of equal damping ratio from frame to frame,
    and the poles."""
    name = facts["over"]
    z = columns["z_re"] + 1j * columns["z_im"]
    entries = len(facts["ends"]) if name else NAMED
    width = 1.3 * ONE_COLUMN
    narrower = min(1.0, wide(width) / width)  # which a circle is in both directions
    with figure(width, 1.1 * ONE_COLUMN * narrower + 0.17 * (1 + entries)) as canvas:
        axes = canvas.subplots()
        axes.plot(_CIRCLE.real, _CIRCLE.imag, color="0.6", linewidth=0.8)
        for ratio in RATIOS:
            rate = 1j - ratio / np.sqrt(1 - ratio**2)
            spiral = np.exp(np.linspace(0, np.pi, 181) * rate)
            for side in (spiral, spiral.conj()):
                axes.plot(side.real, side.imag, color="0.85", linewidth=0.6, zorder=1)
        if name:
            _root_locus(canvas, axes, columns, facts, z)
        else:
            _named(canvas, axes, columns, z)
        shown = np.concatenate([z[np.abs(z) <= REACH], _CIRCLE])
        axes.set_xlim(ROOM_OF_CIRCLE * shown.real.min(), ROOM_OF_CIRCLE * shown.real.max())
        axes.set_ylim(ROOM_OF_CIRCLE * shown.imag.min(), ROOM_OF_CIRCLE * shown.imag.max())
        axes.set_aspect("equal")
        axes.set(xlabel="real part of z", ylabel="imaginary part of z")
        axes.locator_params(axis="x", nbins=6)
        axes.grid(**GRID)
        beyond = int((np.abs(z) > REACH).sum())
        far = f"Not shown: {beyond} poles beyond {REACH:g}." if beyond else ""
        ratios = f"{', '.join(map(str, RATIOS[:-1]))} and {RATIOS[-1]}"
        pale = f"Grey: |z| = 1; paler: damping ratios of {ratios}."
        note_below(canvas, pale, assumption(facts), far)
    return canvas


def _draw_legend(canvas: Any, axes: Any, **options: Any) -> None:
    """The legend above the panel, its texts in lines that are no wider than the figure."""
    handles, labels = axes.get_legend_handles_labels()
    letters = int(LETTERS * (canvas.get_figwidth() - BESIDE))
    lines = [fill(label, letters) for label in labels]
    breaks = sum(line.count("\n") for line in lines)
    canvas.set_figheight(canvas.get_figheight() + 0.13 * breaks)
    canvas.legend(handles, lines, fontsize=7, loc="outside upper center", **options)


def _named(canvas: Any, axes: Any, columns: Columns, z: np.ndarray) -> None:
    """The poles of a loop, the slowest modes with a mark and their frequency, damping and
    states."""
    axes.plot(z.real, z.imag, "x", color="0.3", markersize=4, zorder=2, label="poles")
    lasting = [mode for mode in modes(columns) if mode["radius"] > GONE]
    for n, mode in enumerate(lasting[:NAMED]):
        if mode["shown_hz"]:
            rings = f"{mode['shown_hz']:.4g} Hz, damping ratio {mode['shown_damping_ratio']:.3g}"
        else:
            rings = f"no oscillation, {mode['time_constant_s'] or 0:.4g} s"
        axes.plot(
            [mode["z_re"], mode["z_re"]],
            [mode["z_im"], -mode["z_im"]],
            _MARKS[n],
            label=f"{rings}: {mode['states']}",
            color=distinct_colour(n),
            markerfacecolor="none",
            markersize=7,
            linestyle="none",
            zorder=3,
        )
    if lasting:
        _draw_legend(canvas, axes)


def _root_locus(
    canvas: Any, axes: Any, columns: Columns, facts: Mapping[str, Any], z: np.ndarray
) -> None:
    """The poles over the values of a number, which colours have, and the ends of the stable
    intervals between them."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm, Normalize

    name = facts["over"]
    finite = np.isfinite(z)
    numbers = columns[name][finite]
    z = z[finite]
    scale = LogNorm if is_logarithmic(numbers) else Normalize
    norm = scale(numbers.min(), numbers.max())
    dots = axes.scatter(
        z.real, z.imag, c=numbers, cmap=family_map(), norm=norm, s=4, linewidths=0, zorder=2
    )
    steps, values = _steps(numbers, z)
    way = LineCollection(
        steps, array=values, cmap=family_map(), norm=norm, linewidths=1.2, zorder=2
    )
    axes.add_collection(way)
    canvas.colorbar(dots, ax=axes, label=label(name, facts), shrink=0.85)
    for n, (value, real, imaginary, hz, certified, *_) in enumerate(facts["ends"]):
        said = f"{symbol(name)} = {value:.6g} {unit(name, facts)}".rstrip()
        if hz:
            said += f", {hz:.4g} Hz"
        if not certified:
            said += ", not certified"
        colour = "black" if certified else DOUBTFUL
        look = {"markerfacecolor": "none", "markersize": 7, "linestyle": "none", "zorder": 3}
        mark = _MARKS[n % len(_MARKS)]
        axes.plot(real, imaginary, mark, label=said, color=colour, **look)
    if facts["ends"]:
        _draw_legend(canvas, axes, title="ends of stable intervals", title_fontsize=7)


def _steps(numbers: np.ndarray, z: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """The steps of the poles from each value of the number to the next, each to the one that
    follows it, and the values."""
    from scipy.optimize import linear_sum_assignment

    values = np.unique(numbers)
    poles = np.split(z, np.searchsorted(numbers, values[1:]))
    steps = []
    colours = []
    for value, before, after in zip(values, poles, poles[1:], strict=False):
        far = np.abs(before[:, None] - after[None])
        nearest = far == np.minimum(far.min(0), far.min(1, keepdims=True))
        for a, b in zip(*linear_sum_assignment(far), strict=True):
            # Beyond this step between neighbouring values a line joins poles that are each other's
            # nearest alone.
            if far[a, b] < 0.2 or nearest[a, b]:
                step = np.array([before[a], after[b]])
                steps.append(np.column_stack([step.real, step.imag]))
                colours.append(value)
    return steps, np.array(colours)
