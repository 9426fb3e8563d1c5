"""The closed-loop poles of a spec's own loop, with frequency, damping and the states that take part."""

import numpy as np

from wavesweep.core.analyses.lines import lines_in_loops
from wavesweep.core.analyses.loops import drift_of, frames, refuse_singular
from wavesweep.core.columns import Columns
from wavesweep.core.loops.multirate import MultirateLoop
from wavesweep.core.monodromy.drift import TickDrift
from wavesweep.core.spec import Spec
from wavesweep.core.stability.modes import Modes, modes_of
from wavesweep.core.stability.spectrum import damping_ratio
from wavesweep.core.sweep.grid import own_loop

ON_CIRCLE = 1e-6  # distance from the unit circle, up to which a pole is on it: it is known to rounding
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


def named_modes(E, drawn: MultirateLoop, drift: TickDrift) -> tuple[list[str], Modes]:
    """The names of the states of a loop, without those of its drift, and their modes; see `modes_of`."""
    labels, kept = drawn.labels(), len(drift.kept)
    return [labels[drift.states[index]] for index in drift.kept], modes_of(E[:kept, :kept])


def leading(names: list[str], shares: np.ndarray) -> list[str]:
    """The names of the states that take part most in a mode, those with the largest share first."""
    order = np.argsort(-shares, kind="stable")[:MOST]
    return [names[index] for index in order if shares[index] >= LEAST]
