"""The closed-loop poles over a number, and their figure: a root locus in the plane of the frame."""

from dataclasses import replace
from typing import Any

import numpy as np

from wavesweep.core.analyses.intervals import job_over
from wavesweep.core.analyses.loops import drift_of, frames
from wavesweep.core.analyses.poles import ON_CIRCLE
from wavesweep.core.plots.scales import is_logarithmic
from wavesweep.core.plots.style import DOUBTFUL, GRID, ONE_COLUMN, family_map, figure, note_below
from wavesweep.core.plots.words import assumption, label, symbol, unit
from wavesweep.core.spec import Axis, Spec
from wavesweep.core.stability.spectrum import eigenvalues
from wavesweep.core.sweep.grid import drawn_groups, make_grid
from wavesweep.core.sweep.running import in_memory

LOCUS = 300  # values of the number by default
REACH = 1.5  # what is farther from 0 is not shown
ROOM = 1.05  # about the unit circle, which is shown whole
STEP = 0.2  # between neighbouring values of the number, up to which a line joins two poles


def poles_over(spec: Spec, axis: Axis) -> tuple[np.ndarray, np.ndarray]:
    """The poles per frame of the loops over the values of an axis: the value and z of each pole, `(poles,)` both.

    What drifts is left out, and so are loops whose frame is not known.
    """
    grid = make_grid(spec, (axis,))
    found = []
    for members, loops in drawn_groups(spec, grid.loop_values(np.arange(grid.loops)), grid.loops, rates=True):
        delta, known = eigenvalues(frames(loops.read, drift_of(loops.read)))
        delta = np.broadcast_to(delta, (members.size, delta.shape[-1]))
        known = np.broadcast_to(known, members.shape)
        at = grid.axis_columns(members)[axis.name]
        found.append((np.repeat(at[known], delta.shape[-1]), 1 + delta[known].ravel()))
    numbers, z = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(numbers, kind="stable")
    return numbers[order], z[order]


def ends_on_circle(spec: Spec, axis: Axis) -> list[tuple[float, np.ndarray, float, bool]]:
    """Ends of stable intervals between the least and the largest value of an axis: the value, the poles there that are on the
    unit circle, the strongest line of their oscillation (Hz), and whether the end is certified.

    None of a number that decides how the loop is built, or without a range.
    """
    if axis.structural or not axis.start < axis.stop:
        return []
    span = replace(axis, values=())
    rows, found = in_memory(job_over(make_grid(spec, (), axis.path), span)), []
    for end in ("low", "high"):
        columns = (rows[name] for name in (end, f"{end}_omega", f"{end}_hz", "certified"))
        for value, omega, hz, certified in zip(*columns, strict=True):
            if np.isfinite(value) and np.isfinite(omega):  # one that stability sets
                z = poles_over(spec, replace(axis, values=(float(value),)))[1]
                found.append((float(value), z[np.abs(np.abs(z) - 1) <= ON_CIRCLE], float(hz), bool(certified)))
    return sorted((each for each in found if each[1].size), key=lambda each: each[0])  # what drifts there is left out


def locus_of(spec: Spec, axis: Axis) -> Any:
    """Draw the poles per frame of a spec over the values of an axis, which colours have, the unit circle, and the ends of the
    stable intervals between them.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm, Normalize

    from wavesweep.core.analyses.assumptions import assumes

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
