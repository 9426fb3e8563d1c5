"""Step responses with their rise time, overshoot and settling time marked."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from wavesweep.engine.response import BAND, Step
from wavesweep.program.plots.sampling import extremes
from wavesweep.program.plots.style import GRID, Look, distinct_colour

MARK = "0.2"
_MARKS = {"rise": ("s", "10 % and 90 %"), "peak": ("X", "farthest"), "settled": (">", "within 2 %")}


def _figures(step: Step) -> Iterator[tuple[str, tuple[float, ...], str]]:
    """Yield rise, peak and settling of a step response, those that it has: kind, times (s) and words."""
    first, second = step.rise_s
    if second > first:
        rise = f"rise time {_in_time(second - first)}"
    else:
        rise = f"rise time < {_in_time(step.period)}"
    if second > 0:
        yield "rise", (first, second), rise
    when = _in_time(step.peak_s)
    if step.overshoot > 0:
        overshoot = f"overshoot {100 * step.overshoot:.4g}\N{NO-BREAK SPACE}% at {when}"
        yield "peak", (step.peak_s,), overshoot
    elif not step.known:
        yield "peak", (step.peak_s,), f"farthest {step.value_at(step.peak_s):.4g} at {when}"
    if step.settling_s > 0:
        settled = f"within 2\N{NO-BREAK SPACE}% after {_in_time(step.settling_s)}"
        yield "settled", (step.settling_s,), settled


def draw_step(axes: Any, step: Step) -> list[tuple[Any, str]]:
    """Draw the step response of T over time; gives the marks for a legend, each with its words."""
    final = step.final
    times = step.time_s[: step.shown]
    values = step.value[: step.shown]
    unit, scale = ("ms", 1e3) if times[-1] < 1 else ("s", 1.0)
    # Samples, up to which each has a dot.
    dots = {"marker": ".", "markersize": 3} if times.size <= 60 else {}
    line = extremes(scale * times, values)
    axes.plot(*line, color=distinct_colour(0), drawstyle="steps-post", **dots)
    axes.axhline(final, color="0.6", linewidth=0.8, linestyle="--")
    axes.set(xlabel=f"time ({unit})", ylabel="step response of T", xlim=(0, scale * times[-1]))
    axes.grid(**GRID)
    if step.settling_s > 0:
        axes.axhspan(final * (1 - BAND), final * (1 + BAND), color="0.85", linewidth=0, zorder=0.5)
    marks = []
    for kind, moments, words in _figures(step):
        style = {"marker": _MARKS[kind][0], "color": MARK, "markersize": 4.5, "linestyle": "none"}
        style |= {"markerfacecolor": "none" if kind == "rise" else MARK}
        reached = [step.value_at(moment) for moment in moments]
        (handle,) = axes.plot(np.multiply(scale, moments), reached, zorder=4, **style)
        marks.append((handle, words))
        if kind == "peak":
            peak = [final, reached[0]]
            axes.plot([scale * moments[0]] * 2, peak, color=MARK, linewidth=1.0)
    return marks


def draw_others(axes: Any, steps: Sequence[tuple[Step, Look]]) -> None:
    """Draw the step responses of a family in a panel that has one; all are shown until the last
    one has come to rest."""
    scale = 1e3 if "ms" in axes.get_xlabel() else 1.0
    for step, look in steps:
        shown = step.time_s <= max(axes.get_xlim()[1] / scale, step.time_s[step.shown - 1])
        line = extremes(scale * step.time_s[shown], step.value[shown])
        axes.plot(
            *line,
            color=look.colour,
            linestyle=look.line,
            linewidth=0.9,
            drawstyle="steps-post",
            zorder=1.9,
        )
        axes.set_xlim(0, max(axes.get_xlim()[1], scale * step.time_s[step.shown - 1]))


def _in_time(seconds: float) -> str:
    if seconds >= 1:
        return f"{seconds:.4g}\N{NO-BREAK SPACE}s"
    return f"{1e3 * seconds:.4g}\N{NO-BREAK SPACE}ms"
