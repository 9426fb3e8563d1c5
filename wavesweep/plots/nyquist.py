"""The figure of margins: Nyquist curve and open-loop Bode plot of a loop that is broken at a signal, with its margins."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wavesweep.columns import Columns
from wavesweep.plots.style import GRID, TWO_COLUMNS, assumption, figure, fitting, is_narrow, note_below, wide

LEAST = 1e-4  # of the largest frequency, the lowest one of the Bode plot
FIRST, STEP, NEXT, ROUNDS = 600, 0.03, 1e-10, 24  # angles; change of ln L between neighbours, and least angle (rad)
LOCI = 500  # angles at which the eigenvalues of a lifted L are drawn as points
ROOM = 0.08  # of the Nyquist plot, beyond what it has to show
FARTHEST = 4.0  # of L, up to which the Nyquist plot follows it; it shows the circle, the disk and the marks whole
_CURVE, _DISK, _MARK = "#0072B2", "#D55E00", "0.2"
_MARKS = {"gain_up": "^", "gain_down": "v", "phase": "o", "delay": "D"}
_TURN = np.exp(1j * np.linspace(0, 2 * np.pi, 721))


def margins(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `margins` table: L over the frequencies of the frame, the point -1, the circle of the gain 1, and the disk margin.

    Beside it are gain (dB) and phase of L over frequency, with the margins as lines between the curve and its limit. The curve
    is computed from the spec of the table, so densely that no step shows.
    """
    from wavesweep.analyses.broken_loops import broken_at
    from wavesweep.spec import load

    loop = broken_at(load(facts["spec"]), facts["cut"])
    angles = dense_angles(loop.response) if loop.times == 1 else np.geomspace(LEAST, 1.0, LOCI) * np.pi
    L, hertz = np.ravel(loop.response(angles)), np.repeat(angles, loop.times) / loop.period / (2 * np.pi)
    style = {"linewidth": 1.2} if loop.times == 1 else {"linestyle": "none", "marker": ".", "markersize": 1.5}
    rows = zip(*(columns[name].tolist() for name in ("margin", "value", "omega")), strict=True)
    table = {name: (value, omega) for name, value, omega in rows}
    crossed = {name: table[name] for name in _MARKS if name in table and table[name][1] > 0}
    marks = {name: _met(np.ravel(loop.response(omega * loop.period)), name, v) for name, (v, omega) in crossed.items()}
    narrow = is_narrow()
    with figure(TWO_COLUMNS, 7.0 if narrow else 4.0) as canvas:
        mosaic = [["nyquist"], ["gain"], ["phase"]] if narrow else [["nyquist", "gain"], ["nyquist", "phase"]]
        panels = canvas.subplot_mosaic(mosaic, height_ratios=[2, 1, 1] if narrow else [1, 1])
        _draw_nyquist(panels["nyquist"], L, _disk(*table["disk_gain"]), marks, table, facts["cut"], style)
        _draw_bode(panels["gain"], panels["phase"], hertz, L, {name: (table[name][1], at) for name, at in marks.items()}, style)
        handles, labels = panels["nyquist"].get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside upper center", ncols=fitting(labels, wide(TWO_COLUMNS)), fontsize=7)
        note_below(canvas, assumption(facts))
    return canvas


def _met(loci: np.ndarray, name: str, value: float) -> complex:
    """The value of L, or the eigenvalue of a lifted one, that the factor of a margin brings to -1."""
    factor = value if name.startswith("gain") else np.exp(1j * np.radians(value)) if name == "phase" else -1 / loci
    return complex(loci[np.argmin(np.minimum(np.abs(1 + factor * loci), np.abs(1 + np.conj(factor) * loci)))])


def dense_angles(response: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Angles up to pi between which ln L changes little, so that neither plot shows a step at a resonance."""
    angles = np.concatenate([np.geomspace(1e-6, 1e-2, FIRST // 3, endpoint=False), np.linspace(1e-2, 1.0, FIRST)]) * np.pi
    values = response(angles)
    for _ in range(ROUNDS):
        with np.errstate(divide="ignore", invalid="ignore"):
            turned = np.abs(np.log(values[1:] / values[:-1]))
        wide_steps = (turned > STEP) & np.isfinite(turned) & (np.diff(angles) > NEXT)
        if not wide_steps.any():
            break
        between = (angles[:-1] + angles[1:])[wide_steps] / 2
        order = np.argsort(np.concatenate([angles, between]), kind="stable")
        angles, values = (np.concatenate(pair)[order] for pair in ((angles, between), (values, response(between))))
    return angles


def _disk(gain: float, omega: float) -> np.ndarray | None:
    """The disk about -1 that L leaves free, with the gains `gain` and 1/gain at its ends; None if there is no limit."""
    return None if np.isnan(omega) else -(gain + 1 / gain) / 2 + (gain - 1 / gain) / 2 * _TURN


def _draw_nyquist(
    axes: Any,
    L: np.ndarray,
    disk: np.ndarray | None,
    marks: Mapping[str, complex],
    table: Mapping[str, tuple[float, float]],
    cut: str,
    style: Mapping[str, Any],
) -> None:
    near = np.where(np.abs(L) <= FARTHEST, L, np.nan)
    axes.plot(_TURN.real, _TURN.imag, color="0.6", linewidth=0.8, linestyle="--", label="gain 1")
    several = "marker" in style
    axes.plot(L.real, L.imag, color=_CURVE, label=f"{'eigenvalues of ' * several}L at {cut}", **style)
    axes.plot(L.real, -L.imag, color=_CURVE, **(style if several else {"linewidth": 0.6, "linestyle": ":"}))
    axes.plot([-1], [0], "+", color=_MARK, markersize=8)
    if disk is not None:
        said = f"disk margin {table['disk'][0]:.3g}"
        axes.fill(disk.real, disk.imag, facecolor=_DISK, edgecolor=_DISK, alpha=0.25, linewidth=0.8, label=said)
    for name, at in marks.items():
        said = in_words(name, *table[name])
        axes.plot([at.real], [at.imag], _MARKS[name], color=_MARK, markersize=4, markerfacecolor=_face(name), label=said)
    whole = np.concatenate([_TURN, [*marks.values()], disk if disk is not None else [-1]])
    reach = np.concatenate([whole, near[np.abs(near) <= 1.15 * np.abs(whole).max()]])
    for part, limit in ((reach.real, axes.set_xlim), (np.append(reach.imag, -reach.imag), axes.set_ylim)):
        room = ROOM * np.ptp(part)
        limit(part.min() - room, part.max() + room)
    axes.set_aspect("equal")
    axes.set(xlabel="real part of L", ylabel="imaginary part of L")
    axes.grid(**GRID)


def _face(name: str) -> str:
    return "none" if name == "delay" else _MARK  # it often lies where the phase margin does


def in_words(name: str, value: float, omega: float) -> str:
    """A margin as the legend has it, with the frequency of its crossing."""
    said = {"gain_up": "gain up", "gain_down": "gain down"}.get(name, name)
    size = {"phase": f"{value:.3g}°", "delay": f"{1e3 * value:.4g} ms"}.get(name)
    size = size or f"{value:.3g} ({20 * np.log10(value) if value > 0 else -np.inf:.3g} dB)"
    return f"{said} {size} at {omega / (2 * np.pi):.4g} Hz"


def _draw_bode(
    gain: Any,
    phase: Any,
    hertz: np.ndarray,
    L: np.ndarray,
    marks: Mapping[str, tuple[float, complex]],
    style: Mapping[str, Any],
) -> None:
    """Draw gain (dB) and phase of L over its frequencies; marks: rad/s and L of each margin.

    The eigenvalues of a lifted L have no order, so their phases are those of one turn.
    """
    from matplotlib.ticker import MultipleLocator

    several = "marker" in style
    degrees = -(-np.degrees(np.angle(L)) % 360) if several else np.degrees(np.unwrap(np.angle(L)))
    degrees -= 360 * np.ceil(np.max(degrees, where=np.isfinite(degrees), initial=-360) / 360 - 0.5)  # at most 180
    with np.errstate(divide="ignore"):
        decibels = 20 * np.log10(np.abs(L))
    shown = (hertz >= LEAST * hertz[-1]) & np.isfinite(decibels)
    for axes, values, limit in ((gain, decibels, 0.0), (phase, degrees, -180.0)):
        axes.plot(hertz, values, color=_CURVE, **style)
        axes.axhline(limit, color="0.6", linewidth=0.8, linestyle="--")
        for name, (omega, at) in marks.items():
            place, turned = omega / (2 * np.pi), -(-np.degrees(np.angle(at)) % 360)
            if not several:
                turned += 360 * np.round((np.interp(place, hertz, degrees) - turned) / 360)
            end = 0.0 if axes is gain else -180 + 360 * np.round((turned + 180) / 360)
            level = 20 * np.log10(abs(at)) if axes is gain else turned
            if (axes is gain) == name.startswith("gain"):  # from the curve to the limit: the margin
                axes.plot([place, place], [level, end], color=_MARK, linewidth=1.0)
            axes.plot([place], [level], _MARKS[name], color=_MARK, markersize=4, markerfacecolor=_face(name))
        axes.set_xscale("log")
        axes.set_xlim(LEAST * hertz[-1], hertz[-1])
        low, high = min(values[shown].min(), limit), max(values[shown].max(), limit)
        axes.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))
        axes.grid(**GRID)
    gain.set_ylabel("gain of L (dB)")
    gain.tick_params(labelbottom=False)
    gain.yaxis.set_major_locator(MultipleLocator(_step(gain.get_ylim(), (5, 10, 20, 40, 60))))
    phase.set(xlabel="frequency (Hz), up to half the frame's rate", ylabel="phase of L (deg)")
    phase.yaxis.set_major_locator(MultipleLocator(_step(phase.get_ylim(), (15, 45, 90, 180, 360))))


def _step(limits: tuple[float, float], steps: tuple[int, ...]) -> int:
    """The least of some steps with which an axis has at most seven ticks."""
    return next((step for step in steps if limits[1] - limits[0] <= 7 * step), steps[-1])
