"""The closed-loop poles of a spec's own loop, with frequency, damping and the states that take part."""

from dataclasses import replace

import numpy as np

from wavesweep.core.analyses.intervals import job_over
from wavesweep.core.analyses.lines import lines_in_loops
from wavesweep.core.analyses.loops import drift_of, frames, refuse_singular
from wavesweep.core.columns import Columns
from wavesweep.core.loops.multirate import MultirateLoop
from wavesweep.core.monodromy.drift import TickDrift
from wavesweep.core.spec import Axis, Spec
from wavesweep.core.stability.spectrum import damping_ratio, eigenvalues
from wavesweep.core.sweep.grid import drawn_groups, make_grid, own_loop
from wavesweep.core.sweep.running import in_memory
from wavesweep.margins.modes import Modes, modes_of

ON_CIRCLE = 1e-6  # distance of a pole from the unit circle at an end, which is known to rounding
MOST = 3  # states that are named of a mode
LEAST = 0.05  # share of a mode, below which a state is not named


def poles(spec: Spec) -> Columns:
    """The columns of all poles per frame, the slowest first; what drifts is left out.

    frequency_hz: as it is seen once a frame; shown_hz: the strongest line that a spectrum of the states shows; second_hz: the
    next one, if it has more than a third of the energy.

    Errors: SpecError for a loop without a solution.
    """
    loop = own_loop(spec)
    refuse_singular(spec, loop.drawing)
    drawn, drift = loop.drawn(), drift_of(loop)
    period = float(drawn.period * drawn.ticks)
    names, (delta, shares) = named_modes(frames(loop, drift), drawn, drift)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.log1p(delta) / period
        columns = {
            "z_re": 1 + delta.real,
            "z_im": delta.imag,
            "radius": np.abs(1 + delta),
            "s_re": s.real,
            "s_im": s.imag,
            "frequency_hz": np.abs(s.imag) / (2 * np.pi),
            "damping_ratio": damping_ratio(delta),
            "time_constant_s": -1 / s.real,
        }
        hz = lines_in_loops(loop, np.log1p(delta)[:, None])
    columns |= {"states": np.array([", ".join(leading(names, each)) for each in shares], object)}
    return columns | {"shown_hz": hz[:, 0], "second_hz": hz[:, 1]}


UNITS = {"z_re": "1", "z_im": "1", "radius": "1", "s_re": "1/s", "s_im": "rad/s", "frequency_hz": "Hz", "damping_ratio": "1"}
UNITS |= {"time_constant_s": "s", "states": "", "shown_hz": "Hz", "second_hz": "Hz"}


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


def named_modes(E, drawn: MultirateLoop, drift: TickDrift) -> tuple[list[str], Modes]:
    """The names of the states of a loop, without those of its drift, and their modes; see `modes_of`."""
    labels, kept = drawn.labels(), len(drift.kept)
    return [labels[drift.states[index]] for index in drift.kept], modes_of(E[:kept, :kept])


def leading(names: list[str], shares: np.ndarray) -> list[str]:
    """The names of the states that take part most in a mode, those with the largest share first."""
    order = np.argsort(-shares, kind="stable")[:MOST]
    return [names[index] for index in order if shares[index] >= LEAST]
