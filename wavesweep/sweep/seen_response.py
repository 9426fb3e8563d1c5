"""The response that a simulation shows, beside that of the linear loop, as a table."""

from collections.abc import Sequence

import numpy as np

from wavesweep.analysis.response import prepare, respond
from wavesweep.analysis.simulation import Simulation, Tone, estimate
from wavesweep.analysis.spectrum import spectral_radius
from wavesweep.diagram import draw
from wavesweep.lifted import cut_at_wall
from wavesweep.spec import Spec
from wavesweep.sweep.response_columns import doubt_of, parts_of


def seen_response(spec: Spec, simulation: Simulation, tones: Sequence[Tone]) -> dict[str, np.ndarray]:
    """Give the columns of the table `simulate-response`, a row per tone; see `estimate` for the accuracy."""
    values = spec.values
    seen = estimate(simulation.signals, tones, values["rates.fast_hz"], simulation.frame)
    # The normalised frequency is that of the slow rate, also for dc, whose frame is one tick.
    seen["omega_Ts"] = 2 * np.pi * seen["frequency_hz"] * values["rates.ratio"] / values["rates.fast_hz"]
    diagram, wall = draw(values), (values["environment.K_VE"], values["environment.B_VE"])
    loop, stable = prepare(diagram, *wall), spectral_radius(cut_at_wall(diagram), *wall) < 1
    named = {"spec": spec.name, "controller": values["controller.kind"]}
    columns = {name: np.full(len(tones), word, dtype=object) for name, word in named.items()} | seen
    linear = respond(loop, seen["frequency_hz"])
    columns |= parts_of("linear_admittance", linear.admittance) | parts_of("linear_impedance", linear.impedance)
    errors = (linear.admittance_error, linear.impedance_error)
    columns |= {f"linear_{name}_error": error for name, error in zip(("admittance", "impedance"), errors, strict=True)}
    return columns | {"doubt": doubt_of(errors, stable, loop.lost)}
