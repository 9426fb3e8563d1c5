"""The figure of poles in the plane of the frame: the modes of a loop by name, or their root locus over a number."""

from collections.abc import Mapping
from textwrap import fill
from typing import Any

import numpy as np

from wavesweep.engine.poles import GONE
from wavesweep.poles.table import modes
from wavesweep.program.columns import Columns
from wavesweep.program.plots.labels import assumption, label, symbol, unit
from wavesweep.program.plots.scales import is_logarithmic
from wavesweep.program.plots.style import DOUBTFUL, GRID, ONE_COLUMN, distinct_colour, family_map, figure, note_below

REACH = 1.5  # what is farther from 0 is not shown
ROOM = 1.05  # about the unit circle, which is shown whole
STEP = 0.2  # between neighbouring values of the number, up to which a line joins two poles
NAMED = 6  # modes with a mark of their own
RATIOS = (0.1, 0.3, 0.5, 0.7)  # of damping, each with a line
LETTERS, BESIDE = 19.0, 0.6  # of a legend in an inch, and inches for its marks
_MARKS = "osD^v<>"
_TURN = np.exp(1j * np.linspace(0, 2 * np.pi, 721))


def poles(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `poles` table: the unit circle, lines of equal damping ratio from frame to frame, and the poles."""
    name, z = facts["over"], columns["z_re"] + 1j * columns["z_im"]
    with figure(1.3 * ONE_COLUMN, 1.1 * ONE_COLUMN + 0.17 * (1 + (len(facts["ends"]) if name else NAMED))) as canvas:
        axes = canvas.subplots()
        axes.plot(_TURN.real, _TURN.imag, color="0.6", linewidth=0.8)
        for ratio in RATIOS:
            spiral = np.exp(np.linspace(0, np.pi, 181) * (1j - ratio / np.sqrt(1 - ratio**2)))
            for side in (spiral, spiral.conj()):
                axes.plot(side.real, side.imag, color="0.85", linewidth=0.6, zorder=1)
        _root_locus(canvas, axes, columns, facts, z) if name else _named(canvas, axes, columns, z)
        shown = np.concatenate([z[np.abs(z) <= REACH], _TURN])
        for coordinates, limit in ((shown.real, axes.set_xlim), (shown.imag, axes.set_ylim)):
            limit(ROOM * coordinates.min(), ROOM * coordinates.max())
        axes.set_aspect("equal")
        axes.set(xlabel="real part of z", ylabel="imaginary part of z")
        axes.grid(**GRID)
        beyond = int((np.abs(z) > REACH).sum())
        far = f"Not shown: {beyond} poles beyond {REACH:g}." if beyond else ""
        pale = f"Grey: |z| = 1; paler: damping ratios of {', '.join(map(str, RATIOS[:-1]))} and {RATIOS[-1]}."
        note_below(canvas, pale, assumption(facts), far)
    return canvas


def _draw_legend(canvas: Any, axes: Any, **options: Any) -> None:
    """The legend above the panel, its texts in lines that are no wider than the figure."""
    handles, labels = axes.get_legend_handles_labels()
    lines = [fill(label, int(LETTERS * (canvas.get_figwidth() - BESIDE))) for label in labels]
    canvas.set_figheight(canvas.get_figheight() + 0.13 * sum(line.count("\n") for line in lines))
    canvas.legend(handles, lines, fontsize=7, loc="outside upper center", **options)


def _named(canvas: Any, axes: Any, columns: Columns, z: np.ndarray) -> None:
    """The poles of a loop, the slowest modes with a mark and their frequency, damping and states."""
    axes.plot(z.real, z.imag, "x", color="0.3", markersize=4, zorder=2, label="poles")
    lasting = [mode for mode in modes(columns) if mode["radius"] > GONE]
    for n, mode in enumerate(lasting[:NAMED]):
        hz, tau = mode["shown_hz"], mode["time_constant_s"]
        rings = f"{hz:.4g} Hz, damping ratio {mode['shown_damping_ratio']:.3g}" if hz else f"no oscillation, {tau or 0:.4g} s"
        style = {"color": distinct_colour(n), "markerfacecolor": "none", "markersize": 7, "linestyle": "none", "zorder": 3}
        axes.plot([mode["z_re"]] * 2, [mode["z_im"], -mode["z_im"]], _MARKS[n], label=f"{rings}: {mode['states']}", **style)
    if lasting:
        _draw_legend(canvas, axes)


def _root_locus(canvas: Any, axes: Any, columns: Columns, facts: Mapping[str, Any], z: np.ndarray) -> None:
    """The poles over the values of a number, which colours have, and the ends of the stable intervals between them."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm, Normalize

    name, finite = facts["over"], np.isfinite(z)
    numbers, z = columns[name][finite], z[finite]
    norm = (LogNorm if is_logarithmic(numbers) else Normalize)(numbers.min(), numbers.max())
    dots = axes.scatter(z.real, z.imag, c=numbers, cmap=family_map(), norm=norm, s=4, linewidths=0, zorder=2)
    steps, values = _steps(numbers, z)
    axes.add_collection(LineCollection(steps, array=values, cmap=family_map(), norm=norm, linewidths=1.2, zorder=2))
    canvas.colorbar(dots, ax=axes, label=label(name, facts), shrink=0.85)
    for n, (value, real, imaginary, hz, certified) in enumerate(facts["ends"]):
        words = f"{symbol(name)} = {value:.6g} {unit(name, facts)}".rstrip() + (f", {hz:.4g} Hz" if hz else "")
        style = {"markerfacecolor": "none", "markersize": 7, "color": "black" if certified else DOUBTFUL}
        said = words + ("" if certified else ", not certified")
        axes.plot(real, imaginary, _MARKS[n % len(_MARKS)], linestyle="none", label=said, zorder=3, **style)
    if facts["ends"]:
        _draw_legend(canvas, axes, title="ends of stable intervals", title_fontsize=7)


def _steps(numbers: np.ndarray, z: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """The steps of the poles from each value of the number to the next, each to the one that follows it, and the values."""
    from scipy.optimize import linear_sum_assignment

    values = np.unique(numbers)
    poles = np.split(z, np.searchsorted(numbers, values[1:]))
    steps, colours = [], []
    for value, before, after in zip(values, poles, poles[1:], strict=False):
        far = np.abs(before[:, None] - after[None])
        for a, b in zip(*linear_sum_assignment(far), strict=True):
            if far[a, b] < STEP:
                steps.append(np.array([(before[a].real, before[a].imag), (after[b].real, after[b].imag)]))
                colours.append(value)
    return steps, np.array(colours)
