"""The closed-loop poles of a spec's own loop, with frequency, damping and the states that take part."""

import numpy as np

from wavesweep.loops.from_drawing import assembled
from wavesweep.monodromy.drift import closed_frame
from wavesweep.rows import Columns
from wavesweep.spec import Spec
from wavesweep.stability.modes import Modes, modes_of
from wavesweep.stability.spectrum import damping_ratio
from wavesweep.sweep.drawn_loops import drift_of, named_loops, refuse_singular
from wavesweep.sweep.grid import own_loop

MOST = 3  # states that are named of a mode
LEAST = 0.05  # share of a mode, below which a state is not named


def poles(spec: Spec) -> Columns:
    """The columns of all poles per frame, the slowest first; what drifts is left out.

    Errors: SpecError for a loop without a solution.
    """
    (delta, shares), names, period = own_modes(spec)
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
    return columns | {"states": np.array([", ".join(leading(names, each)) for each in shares], object)}


UNITS = {"z_re": "1", "z_im": "1", "radius": "1", "s_re": "1/s", "s_im": "rad/s", "frequency_hz": "Hz", "damping_ratio": "1"}
UNITS |= {"time_constant_s": "s", "states": ""}


def own_modes(spec: Spec) -> tuple[Modes, list[str], float]:
    """The modes of the spec's own loop, the names of its states, and the period of its frame (s)."""
    drawing, values = own_loop(spec)
    refuse_singular(spec, drawing)
    drawn, drift = assembled(drawing, values), drift_of(drawing, values)
    with named_loops(drawn), np.errstate(all="ignore"):
        E, kept = closed_frame(drawn, drift), len(drift.kept)
    labels = drawn.labels()
    names = [labels[drift.states[index]] for index in drift.kept]
    return modes_of(E[:kept, :kept]), names, float(drawn.period * drawn.ticks)


def leading(names: list[str], shares: np.ndarray) -> list[str]:
    """The names of the states that take part most in a mode, those with the largest share first."""
    order = np.argsort(-shares, kind="stable")[:MOST]
    return [names[index] for index in order if shares[index] >= LEAST]
