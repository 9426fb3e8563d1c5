"""Figures of frequency responses: curves of a table, of a simulation beside the linear loop, and magnitudes as in papers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.plots.style import IDEAL, TWO_COLUMNS, distinct_colour, family_colours, figure, symbol

_LINES = ("-", (0, (5, 1.5)), (0, (3, 1, 1, 1)), (0, (1, 1)))
_PANELS = (
    ("admittance_abs", "admittance (m/N)"),
    ("impedance_abs", "impedance (N/m)"),
    ("admittance_deg", "phase (deg)"),
    ("impedance_deg", "phase (deg)"),
)
_NEAR_ZERO = 0.3  # of the largest: an axis whose values come that close to 0 begins there


@dataclass(frozen=True)
class Curve:
    """The rows of one spec at one combination of the axes, and the style of their curve."""

    rows: dict[str, np.ndarray]
    label: str
    style: dict[str, Any]


def bode(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any], path: Path) -> None:
    """Draw a `bode` table as PNG: magnitude and phase of admittance and impedance, over Hz below and omega T_s above.

    Direct coupling at the fast rate is the ideal, dashed black. If a loop is unstable, its curve is faint. Inaccurate
    numbers are crossed out, and unknown ones are left out. Phases are unwrapped.
    """
    del facts
    curves = list(_curves(columns))
    legend_rows = -(-len(curves) // 3)
    with figure(path, TWO_COLUMNS, 4.0 + 0.17 * legend_rows) as canvas:
        grid = canvas.subplots(2, 2, sharex=True)
        for axes, (name, title) in zip(grid.flat, _PANELS, strict=True):
            _draw_panel(axes, curves, name)
            axes.set_ylabel(title)
        for axes in grid[1]:
            axes.set_xlabel("frequency (Hz)")
        _add_normalised_frequency(grid[0], columns)
        canvas.align_ylabels()
        canvas.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=min(3, len(curves)))


def _draw_panel(axes: Any, curves: list[Curve], name: str) -> None:
    from matplotlib.ticker import MaxNLocator

    for curve in curves:
        values = curve.rows[name]
        drawn = _unwrapped(values) if name.endswith("_deg") else values
        axes.plot(curve.rows["frequency_hz"], drawn, label=curve.label, **curve.style)
        doubted = curve.rows["doubt"] == "rounding"
        if doubted.any():
            axes.plot(curve.rows["frequency_hz"][doubted], drawn[doubted], "x", color=curve.style["color"], markersize=4)
    frequency = np.concatenate([curve.rows["frequency_hz"] for curve in curves])
    if frequency.min() > 0 and frequency.max() > 20 * frequency.min():
        axes.set_xscale("log")
    if name.endswith("_abs"):
        axes.set_yscale("log")
    else:
        axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 1.8, 3.6, 4.5, 9, 10]))
    if frequency.max() > frequency.min():
        axes.set_xlim(frequency.min(), frequency.max())
    axes.grid(visible=True, which="major", color="0.88", linewidth=0.5)


def _unwrapped(degrees: np.ndarray) -> np.ndarray:
    """Remove jumps of a full turn, which would be drawn as vertical lines. A missing value interrupts the curve there only."""
    drawn, known = degrees.copy(), ~np.isnan(degrees)
    drawn[known] = np.unwrap(degrees[known], period=360.0)
    return drawn


def _curves(columns: Mapping[str, np.ndarray]) -> Iterator[Curve]:
    axes = [name for name in list(columns)[: list(columns).index("spec")] if len(np.unique(columns[name])) > 1]
    for index, spec in enumerate(dict.fromkeys(columns["spec"].tolist())):
        responses = _responses(_chosen(columns, columns["spec"] == spec), axes)
        colours = family_colours(len(responses)) if len(responses) > 1 else [distinct_colour(index)]
        for colour, (place, rows) in zip(colours, responses.items(), strict=True):
            style = {"color": colour, "linestyle": _LINES[index % len(_LINES)] if len(responses) > 1 else "-"}
            yield _curve(rows, spec, place if len(responses) > 1 else "", style)


def _responses(columns: Mapping[str, np.ndarray], axes: list[str]) -> dict[str, dict[str, np.ndarray]]:
    """Yield the rows of each combination of the axes, with its name.

    If a controller ignores an axis, the rows are repeated, and one line is enough.
    """
    values = np.stack([columns[name].astype(float) for name in axes] or [np.zeros(len(columns["spec"]))], axis=1)
    found: dict[bytes, tuple[str, dict[str, np.ndarray]]] = {}
    for combination in np.unique(values, axis=0):
        rows = _chosen(columns, (values == combination).all(axis=1))
        place = ", ".join(f"{symbol(name)} = {value:g}" for name, value in zip(axes, combination, strict=False))
        found.setdefault(rows["admittance_re"].tobytes() + rows["impedance_re"].tobytes(), (place, rows))
    return dict(found.values())


def _chosen(columns: Mapping[str, np.ndarray], rows: np.ndarray) -> dict[str, np.ndarray]:
    return {name: column[rows] for name, column in columns.items()}


def _curve(rows: dict[str, np.ndarray], spec: str, place: str, style: dict[str, Any]) -> Curve:
    ideal, stable = rows["controller"][0] == "dc", rows["stable"].all()
    if ideal:
        style = {"color": IDEAL, "linestyle": "--", "zorder": 3}
    words = [f"{spec} (ideal)" if ideal else spec, place, "" if stable else "unstable"]
    return Curve(rows, ", ".join(filter(None, words)), style if stable else {**style, "alpha": 0.35})


def _add_normalised_frequency(top: Any, columns: Mapping[str, np.ndarray]) -> None:
    """Add the axis of omega T_s above, unless the specs have different slow rates."""
    positive = columns["frequency_hz"] > 0
    ratios = columns["omega_Ts"][positive] / columns["frequency_hz"][positive]
    if not len(ratios) or np.ptp(ratios) > 1e-9 * ratios[0]:
        return
    scale = float(ratios[0])
    for axes in top:
        above = axes.secondary_xaxis("top", functions=(lambda hz: hz * scale, lambda omega: omega / scale))
        above.set_xlabel(r"$\omega T_s$ (rad/sample)")


def simulate_response(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any], path: Path) -> None:
    """Draw a `simulate-response` table as PNG: dots for the estimates of the run, a line for the linear loop."""
    del facts
    order = np.argsort(columns["frequency_hz"])
    sorted_columns = {name: column[order] for name, column in columns.items()}
    with figure(path, TWO_COLUMNS, 4.0) as canvas:
        grid = canvas.subplots(2, 2, sharex=True)
        for axes, (name, title) in zip(grid.flat, _PANELS, strict=True):
            _draw_seen(axes, sorted_columns, name)
            axes.set_ylabel(title)
        for axes in grid[1]:
            axes.set_xlabel("frequency (Hz)")
        canvas.align_ylabels()
        handles, labels = grid[0, 0].get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside lower center", ncols=2)


def _draw_seen(axes: Any, columns: Mapping[str, np.ndarray], name: str) -> None:
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


def draw_magnitudes(
    lines: Sequence[Line], panels: Sequence[Panel], title: str, path: Path, level: tuple[float, str] | None = None
) -> None:
    """Draw the lines as PNG, a panel per band, each scaled to its contents; `level` is a value to compare with."""
    with figure(path, TWO_COLUMNS, 2.6) as canvas:
        for axes, panel in zip(np.atleast_1d(canvas.subplots(1, len(panels))), panels, strict=True):
            _draw_band(axes, lines, panel)
            if level is not None:
                axes.axhline(level[0], color="0.6", linewidth=0.8, linestyle=":", label=level[1])
            axes.set_xlabel("normalised frequency (rad/sample)")
        canvas.axes[0].set_ylabel(title)
        handles, labels = canvas.axes[0].get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside lower center", ncols=6)


def _draw_band(axes: Any, lines: Sequence[Line], panel: Panel) -> None:
    colours = family_colours(max(1, sum(line.shade is not None for line in lines)))
    for line in lines:
        # Only what the band shows, so that the vertical axis fits it.
        chosen = (line.omega >= panel.band[0]) & (line.omega <= panel.band[1] * (1 + 1e-9))
        axes.plot(line.omega[chosen], line.magnitude[chosen], **_look(line, colours), label=line.label or None)
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


def _look(line: Line, colours: list[Any]) -> dict[str, Any]:
    colour = IDEAL if line.ideal else distinct_colour(line.hue) if line.shade is None else colours[line.shade]
    if line.dots:
        return {"color": colour, "linestyle": "none", "marker": "o", "markersize": 3}
    return {"color": colour, "linestyle": "--" if line.ideal else "-", "zorder": 3 if line.ideal else 2}
