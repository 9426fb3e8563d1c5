"""The response that a simulation shows, beside that of the linear loop, as a table."""

from collections.abc import Sequence

import numpy as np

from wavesweep.analysis.march import Simulation
from wavesweep.analysis.march.estimation import estimate
from wavesweep.analysis.march.inputs import Tone
from wavesweep.analysis.response import prepare, steady_state
from wavesweep.diagram import draw
from wavesweep.spec import Spec
from wavesweep.sweep.response_columns import parts_of


def seen_response(spec: Spec, simulation: Simulation, tones: Sequence[Tone]) -> dict[str, np.ndarray]:
    """Give the columns of the table `simulate-response`, a row per tone; see `estimate` for the accuracy."""
    values = spec.values
    seen = estimate(simulation.signals, tones, values["rates.fast_hz"], simulation.frame)
    # The normalised frequency is that of the slow rate, also for dc, whose frame is one tick.
    seen["omega_Ts"] = 2 * np.pi * seen["frequency_hz"] * values["rates.ratio"] / values["rates.fast_hz"]
    loop = prepare(draw(values), values["environment.K_VE"], values["environment.B_VE"])
    named = {"spec": spec.name, "controller": values["controller.kind"]}
    columns = {name: np.full(len(tones), word, dtype=object) for name, word in named.items()} | seen
    for name, response in zip(("admittance", "impedance"), steady_state(loop, seen["frequency_hz"]), strict=True):
        columns |= parts_of(f"linear_{name}", response)
    return columns
