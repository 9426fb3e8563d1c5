"""The figure of a device found from a log: measured and fitted position, what is left, and its
spectrum."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.program.columns import Columns
from wavesweep.program.plots.labels import as_it_stands
from wavesweep.program.plots.sampling import extremes
from wavesweep.program.plots.style import (
    GRID,
    IDEAL,
    TWO_COLUMNS,
    distinct_colour,
    figure,
    is_narrow,
    note_below,
    warn_above,
)


def _draw_spectrum(panel: Any, columns: Columns, facts: Mapping[str, Any], unit: str) -> None:
    """Draw the spectrum of the residual over that of the encoder and white noise."""
    hertz, density, white = _spectrum(columns, facts)
    panel.loglog(hertz, density, color=distinct_colour(1), linewidth=1.0, label="residual")
    look = {"color": "0.5", "linewidth": 0.8, "linestyle": "--"}
    panel.loglog(hertz, white, label="encoder and\nwhite noise", **look)
    panel.set(ylabel=f"spectrum\n({unit}/√Hz)", xlabel="frequency (Hz)")


def identify(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw an `identify` table: force, measured and fitted position, the residual with half a
    step either way, its spectrum."""
    from wavesweep.identification.log import CURRENTS, MOTIONS
    from wavesweep.identification.table import READ, unit_said

    measured = facts.get("measured", "position")
    times = columns["time_s"]
    if "axes" in facts:  # one after the other
        times = facts["period_s"] * np.arange(len(times))
    unit = unit_said(READ[measured], facts).replace("^2", "²")
    names = CURRENTS if facts.get("circuit") else MOTIONS if facts["turns"] else {}
    place = f"{names.get(measured, measured).replace('_', ' ')} ({unit})"
    force = "torque (N·m)" if facts["turns"] else "force (N)"
    with figure(TWO_COLUMNS, 5.2) as canvas:
        panels = canvas.subplots(4, 1, height_ratios=[1, 2, 1.4, 1.8])
        panels[0].plot(*extremes(times, columns["force"]), color=distinct_colour(2), linewidth=0.9)
        panels[0].set_ylabel("voltage (V)" if facts.get("circuit") else force)
        look = {"color": distinct_colour(0), "linewidth": 1.6, "label": "measured"}
        panels[1].plot(*extremes(times, columns[measured]), **look)
        look = {"color": IDEAL, "linewidth": 0.8, "linestyle": "--", "label": "fitted"}
        panels[1].plot(*extremes(times, columns["fitted"]), **look)
        panels[1].set_ylabel(place)
        residual = extremes(times, columns["residual"])
        panels[2].plot(*residual, color=distinct_colour(1), linewidth=0.7)
        look = {"color": "0.6", "linewidth": 0.7, "linestyle": ":"}
        for side in (-0.5, 0.5) if facts["resolution"] else ():
            said = "half a step" if side > 0 else None
            panels[2].axhline(side * facts["resolution"], label=said, **look)
        panels[2].set(ylabel=f"residual ({unit})", xlabel="time (s)")
        _draw_spectrum(panels[3], columns, facts, unit)
        _legends(panels, [1, 2, 3] if facts["resolution"] else [1, 3])
        for axes in panels:
            axes.grid(**GRID)
            axes.margins(x=0)
        for axes in panels[:2]:
            axes.sharex(panels[2])
            axes.tick_params(labelbottom=False)
        _title(canvas, facts, "log")
        canvas.align_ylabels()
    return canvas


def _legends(panels: Any, labelled: list[int]) -> None:
    """The legends: beside the panels that are labelled or, if the figure is narrow, a single one
    above them."""
    if is_narrow():
        handles = [line for axes in panels[1:] for line in axes.get_legend_handles_labels()[0]]
        names = [line.get_label().replace("\n", " ") for line in handles]
        panels[0].legend(
            handles, names, loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=2, fontsize=7
        )
        return
    for axes in panels[labelled]:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7)


def identify_response(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw an `identify-response` table: modulus and phase, measured and fitted, and how far
    they are apart."""
    hertz = columns["frequency_hz"]
    with figure(TWO_COLUMNS, 4.4) as canvas:
        panels = canvas.subplots(3, 1, sharex=True, height_ratios=[2, 1.4, 1.2])
        phase = np.unwrap(columns["fitted_deg"], period=360)
        apart = (columns["measured_deg"] - columns["fitted_deg"] + 180) % 360 - 180
        curves = ((columns["measured_abs"], columns["fitted_abs"]), (phase + apart, phase))
        for axes, (measured, fitted) in zip(panels, curves, strict=False):
            axes.plot(
                hertz, measured, ".", color=distinct_colour(0), markersize=4, label="measured"
            )
            axes.plot(hertz, fitted, color=IDEAL, linewidth=0.9, label="fitted")
        panels[2].plot(
            hertz, 100 * columns["residual_abs"], ".", color=distinct_colour(1), markersize=4
        )
        panels[0].set(xscale="log", yscale="log", ylabel="admittance (m/N)")
        panels[0].legend(loc="upper right", fontsize=7)
        panels[1].set_ylabel("phase (deg)")
        panels[2].set(ylabel="apart by (%)", xlabel="frequency (Hz)")
        for axes in panels:
            axes.grid(**GRID)
        _title(canvas, facts, "response")
        canvas.align_ylabels()
    return canvas


def _title(canvas: Any, facts: Mapping[str, Any], source: str) -> None:
    """The numbers that were found below the panels, and above them a warning if the model does
    not explain what was read."""
    from wavesweep.identification.device_spec import spoken

    if "load_mass" in facts["parameters"]:
        names = ("mass", "load_mass", "coupling_stiffness")
    else:
        names = ("mass", "damping")
    numbers = (
        f"{name} {spoken(estimate)}"
        for name, estimate in facts["parameters"].items()
        if name in names
    )
    note_below(canvas, as_it_stands(", ".join(numbers).replace("*", "·")))
    warn_above(canvas, "" if facts["explained"] else f"the model does not explain the {source}")


def _spectrum(columns, facts):
    """Frequencies (Hz), the amplitude density of the residual over bands, and that of white
    errors of the encoder and noise."""
    residual = columns["residual"][columns["weight"] > 0]
    period = facts["period_s"]
    residual = residual - residual.mean()
    power = np.abs(np.fft.rfft(residual))[1:] ** 2 * 2 * period / len(residual)
    # 64 bands of the spectrum, equally wide in octaves.
    edges = np.unique(np.round(np.geomspace(1, len(power) + 1, 65)).astype(int)) - 1
    sizes = np.diff(edges)
    density = np.sqrt(np.add.reduceat(power, edges[:-1]) / sizes)
    hertz = (edges[:-1] + edges[1:] + 1) / 2 / (len(residual) * period)
    variance = facts["resolution"] ** 2 / 12 + facts["residual"]["white_noise"] ** 2
    return (
        hertz,
        np.maximum(density, NEXT_TO_ZERO),
        np.full(len(hertz), np.sqrt(2 * period * variance)),
    )
