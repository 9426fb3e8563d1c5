"""Section 4, Figures 7 and 8: the experiment, simulated tick by tick, and the transmitted impedance."""

from __future__ import annotations

import numpy as np

from wavesweep.paper.bench import Bench
from wavesweep.paper.experiment import CONTROLLERS, deviation_of, estimated, worst_difference
from wavesweep.paper.measures import LOW, WHOLE, natural_frequency, show, stiffness_error, within
from wavesweep.paper.readings import set_to
from wavesweep.paper.specs import load_paper
from wavesweep.paper.statements.transparency import MUCH
from wavesweep.paper.verdicts import UNSTABLE, Answer, Finding, Statement, once, over, untestable

AGREES = 0.02  # relative, between simulated and analytical responses
NEGLIGIBLE = 0.01  # relative, on the response
FEW_TONES = "simulate.frequency_hz=[1,5,10,20]"


def sampling_time_varies_negligibly(bench: Bench) -> Finding:
    """Largest relative change of PMW+LM's simulated admittance at 1, 5, 10 and 20 Hz when ticks are longer or
    shorter by up to a part of the period, against the linear analysis: whether it is below 1 %."""
    del bench
    jitters = [set_to(f"by up to {100 * part:g} % of the period", f"simulate.jitter={part}") for part in (0.02, 0.1, 0.5)]

    def check(*reading: str) -> Answer:
        change = worst_difference(estimated(load_paper("fig7", (FEW_TONES, *reading))))
        return Answer(change < NEGLIGIBLE, f"changes by {show(change)}")

    return over(check, jitters)


def experiment_validates_the_analysis(bench: Bench) -> Finding:
    """Largest relative difference between simulated and analytical admittance, 0.5 to 49.5 Hz: whether below 2 %."""
    off = {name: worst_difference(bench.experiment(name)) for name in CONTROLLERS}
    return once(Answer(max(off.values()) < AGREES, ", ".join(f"{name} {show(value)}" for name, value in off.items())))


def experiment_raises_the_natural_frequency(bench: Bench) -> Finding:
    """First peak of the simulated responses: whether PMW+LM's lies above PMW's."""
    peaks = {name: _peak(bench.experiment(name)) for name in CONTROLLERS}
    numbers = ", ".join(f"{name} {show(value)} rad/sample" for name, value in peaks.items())
    return once(Answer(peaks["PMW+LM"] > peaks["PMW"], numbers))


def experiment_approaches_the_ideal(bench: Bench) -> Finding:
    """Mean deviation of the simulated magnitude from simulated DC up to 0.6 rad/sample: whether at least halved."""
    found, without, ideal = (bench.experiment(name) for name in CONTROLLERS)
    off = [deviation_of(columns, ideal, LOW) for columns in (found, without)]
    return once(Answer(off[0] < off[1] / MUCH, f"PMW+LM off by {show(off[0])}, PMW by {show(off[1])}"))


def impedance_is_closer(bench: Bench) -> Finding:
    """Mean distance of the transmitted impedance's magnitude from 500 N/m up to 0.6 rad/sample, PMW+LM against PMW:
    whether at least halved."""
    return over(lambda *reading: _nearer(bench, reading, LOW))


def impedance_is_closer_everywhere(bench: Bench) -> Finding:
    """The same up to pi rad/sample."""
    return over(lambda *reading: _nearer(bench, reading, WHOLE))


def _nearer(bench: Bench, reading: tuple[str, ...], band: tuple[float, float]) -> Answer:
    loops = [bench.response(name, *reading) for name in ("fig8", "pmw")]
    if not all(loop.stable for loop in loops):
        return UNSTABLE
    off = [stiffness_error(loop, 500.0, band) for loop in loops]
    return Answer(off[0] < off[1] / MUCH, f"off by {show(off[0])} N/m, PMW by {show(off[1])} N/m")


def _peak(columns) -> float:
    chosen = within(columns["omega_Ts"], WHOLE)
    return natural_frequency(columns["omega_Ts"][chosen], np.asarray(columns["admittance_abs"])[chosen])


STATEMENTS = (
    Statement(
        "4",
        "The responses of Figures 7 and 8 were measured with a Phantom Omni on a personal computer under Windows",
        untestable("the rig is not here; its loops are simulated, with the device of the analysis"),
    ),
    Statement("4", "The variation of the sampling time is negligible", sampling_time_varies_negligibly),
    Statement("Abstract; 4, Fig. 7; 5", "The experiments validate the analytical results", experiment_validates_the_analysis),
    Statement(
        "4, Fig. 7 (i)",
        "PMW+LM increases the first natural frequency, and so renders stiffer contacts than PMW",
        experiment_raises_the_natural_frequency,
    ),
    Statement(
        "4, Fig. 7 (ii)",
        "At low frequency PMW+LM approaches the ideal admittance regardless of the low update rate",
        experiment_approaches_the_ideal,
    ),
    Statement(
        "4, Fig. 8",
        "PMW+LM transmits an impedance much closer to 500 N/m than PMW: at low frequencies",
        impedance_is_closer,
    ),
    Statement("4, Fig. 8", "... and over all frequencies of Figure 6", impedance_is_closer_everywhere),
    Statement(
        "5",
        "Robust control should decrease the sensitivity to changes in environment and interface",
        untestable("announced as future work; no such controller is described"),
    ),
)
