"""The figure of the closed-loop poles over a number: a root locus in the plane of the frame."""

from typing import Any

import numpy as np

from wavesweep.core.plots.scales import is_logarithmic
from wavesweep.core.plots.style import DOUBTFUL, GRID, ONE_COLUMN, family_map, figure, note_below
from wavesweep.core.plots.words import assumption, label, symbol, unit
from wavesweep.core.spec import Axis, Spec

LOCUS = 300  # values of the number by default
REACH = 1.5  # what is farther from 0 is not shown
ROOM = 1.05  # about the unit circle, which is shown whole
STEP = 0.2  # between neighbouring values of the number, up to which a line joins two poles


def locus_of(spec: Spec, axis: Axis) -> Any:
    """Draw the poles per frame of a spec over the values of an axis, which colours have, the unit circle, and the ends of the
    stable intervals between them.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm, Normalize

    from wavesweep.core.analyses.assumptions import assumes
    from wavesweep.margins.poles import ends_on_circle, poles_over

    facts = {"spec": spec.tables(), "spec_name": spec.name, "assumes": assumes(spec, [axis.path])}
    name, (numbers, z), ends = axis.name, poles_over(spec, axis), ends_on_circle(spec, axis)
    norm = (LogNorm if is_logarithmic(numbers) else Normalize)(numbers.min(), numbers.max())
    with figure(1.3 * ONE_COLUMN, 1.1 * ONE_COLUMN + 0.17 * (1 + len(ends))) as canvas:
        axes, turn = canvas.subplots(), np.exp(1j * np.linspace(0, 2 * np.pi, 721))
        axes.plot(turn.real, turn.imag, color="0.6", linewidth=0.8)
        dots = axes.scatter(z.real, z.imag, c=numbers, cmap=family_map(), norm=norm, s=4, linewidths=0, zorder=2)
        steps, values = _steps(numbers, z)
        axes.add_collection(LineCollection(steps, array=values, cmap=family_map(), norm=norm, linewidths=1.2, zorder=2))
        canvas.colorbar(dots, ax=axes, label=label(name, facts), shrink=0.85)
        for n, (value, on_circle, hz, certified) in enumerate(ends):
            words = f"{symbol(name)} = {value:.6g} {unit(name, facts)}".rstrip() + (f", {hz:.4g} Hz" if hz else "")
            style = {"markerfacecolor": "none", "markersize": 7, "color": "black" if certified else DOUBTFUL}
            said = words + ("" if certified else ", not certified")
            axes.plot(on_circle.real, on_circle.imag, "osD^v<>"[n % 7], linestyle="none", label=said, zorder=3, **style)
        shown = np.concatenate([z[np.abs(z) <= REACH], turn])
        for part, limit in ((shown.real, axes.set_xlim), (shown.imag, axes.set_ylim)):
            limit(ROOM * part.min(), ROOM * part.max())
        axes.set_aspect("equal")
        axes.set(xlabel="real part of z", ylabel="imaginary part of z")
        axes.grid(**GRID)
        if ends:
            canvas.legend(title="ends of stable intervals", fontsize=7, title_fontsize=7, loc="outside upper center")
        note_below(canvas, assumption(facts))
    return canvas


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
