"""The figure of margins: Nyquist curve and Bode plot of the loop that is broken at a signal, and what it has to avoid."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from wavesweep.columns import Columns
from wavesweep.plots.style import ONE_COLUMN, TWO_COLUMNS, assumed, figure, fitting, lines_of, wide

POINTS = 4000
LEAST = 1e-4  # of the largest frequency, the lowest one of the Bode plot
REACH = 2.5  # of the part that is shown, at least; larger loops are cut off
_CURVE, _DISK, _MARK = "#0072B2", "#D55E00", "0.2"


def margins(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `margins` table: L over the frequencies of the frame, the point -1, the circle of the gain 1, and the disk margin.

    Beside it are gain and phase of L over frequency, with the same marks. The curve is computed from the spec of the table.
    """
    from wavesweep.spec import load
    from wavesweep.sweep.broken_loops import broken_at

    loop = broken_at(load(facts["spec"]), facts["cut"])
    angles = np.concatenate([np.geomspace(1e-6, 1e-2, POINTS // 2, endpoint=False), np.linspace(1e-2, 1.0, POINTS)]) * np.pi
    value, omega = (dict(zip(columns["margin"].tolist(), columns[name].tolist(), strict=True)) for name in ("value", "omega"))
    with figure(TWO_COLUMNS, ONE_COLUMN + 0.5) as canvas:
        axis, *bode = canvas.subplot_mosaic([["nyquist", "gain"], ["nyquist", "phase"]]).values()
        turn = np.exp(1j * np.linspace(0, 2 * np.pi, 400))
        axis.plot(turn.real, turn.imag, color="0.7", linewidth=0.8, linestyle="--", label="gain 1")
        L = loop.response(angles)
        axis.plot(L.real, L.imag, color=_CURVE, linewidth=1.2, label=f"L at {facts['cut']}")
        axis.plot(L.real, -L.imag, color=_CURVE, linewidth=0.6, linestyle=":")
        axis.plot([-1], [0], "+", color=_MARK, markersize=8)
        if not np.isnan(omega["disk_gain"]):
            gain = value["disk_gain"]
            disk = -(gain + 1 / gain) / 2 + (gain - 1 / gain) / 2 * turn
            axis.fill(disk.real, disk.imag, color=_DISK, alpha=0.25, linewidth=0, label="disk margin")
        marks = {name: mark for name, mark in (("gain_up", "^"), ("gain_down", "v"), ("phase", "o")) if omega[name] > 0}
        found = {name: complex(loop.response(omega[name] * loop.period)) for name in marks}
        for name, mark in marks.items():
            axis.plot([found[name].real], [found[name].imag], mark, color=_MARK, markersize=4, label=name.replace("_", " "))
        _bode(bode, angles / loop.period, L, {omega[name]: (found[name], mark) for name, mark in marks.items()})
        axis.set_xlim(-REACH, REACH)
        axis.set_ylim(-REACH, REACH)
        axis.set_aspect("equal")
        axis.set(xlabel="real part of L", ylabel="imaginary part of L")
        handles, labels = axis.get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside upper center", ncols=fitting(labels, wide(TWO_COLUMNS)), fontsize=7)
        if facts.get("assumes"):
            canvas.supxlabel("\n".join(lines_of(f"Assumes: {assumed(facts)}.")), fontsize=8)
    return canvas


def _bode(panels: Any, omega: np.ndarray, L: np.ndarray, marks: Mapping[float, tuple[complex, str]]) -> None:
    """Draw gain and phase of L over its frequencies (rad/s); marks: L and the mark at some of them."""
    from matplotlib.ticker import MultipleLocator

    hertz, degrees = omega / (2 * np.pi), np.degrees(np.unwrap(np.angle(L)))
    degrees -= 360 * np.ceil(np.max(degrees, where=np.isfinite(degrees), initial=-360) / 360 - 0.5)  # at most 180
    for axes, values, at in zip(panels, (np.abs(L), degrees), (1.0, -180.0), strict=True):
        axes.plot(hertz, values, color=_CURVE, linewidth=1.2)
        axes.axhline(at, color="0.7", linewidth=0.8, linestyle="--")
        for each, (found, mark) in marks.items():
            level = abs(found) if at > 0 else np.interp(each, omega, degrees)
            axes.plot([each / (2 * np.pi)], [level], mark, color=_MARK, markersize=4)
        axes.set_xscale("log")
        axes.set_xlim(LEAST * hertz[-1], hertz[-1])
        axes.grid(visible=True, color="0.9", linewidth=0.5)
    shown = hertz >= LEAST * hertz[-1]
    panels[0].set(yscale="log", ylabel="gain of L")
    panels[0].set_ylim(0.5 * np.abs(L[shown]).min(), 2 * np.abs(L[shown]).max())
    panels[0].tick_params(labelbottom=False)
    panels[1].set(xlabel="frequency (Hz),\nup to half the frame's rate", ylabel="phase of L (deg)")
    low, high = degrees[shown].min(), degrees[shown].max()
    panels[1].set_ylim(min(low, -180) - 15, max(high, -180) + 15)
    panels[1].yaxis.set_major_locator(MultipleLocator(45 if high - low < 300 else 90))
