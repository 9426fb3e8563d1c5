"""Sections 3 and 3.2, Figure 6: what filter bank, local model and Kp do to the transmitted admittance."""

from __future__ import annotations

import numpy as np

from wavesweep.paper.bench import Bench
from wavesweep.paper.measures import HIGH, LOW, LOW_OF_FIGURE_2, deviation, peak, show, within
from wavesweep.paper.response import respond
from wavesweep.paper.specs import load_paper
from wavesweep.paper.statements.figure2 import IMPEDANCES
from wavesweep.paper.verdicts import UNSTABLE, Answer, Finding, Statement, over

MUCH = 2.0  # "much" and "significantly" are taken to mean at least by this factor
LITTLE = 0.05  # relative: "little effect" on the stiffness that the hand feels
INDEPENDENT = 0.01  # relative: the spread over b that counts as none


def bank_helps_at_high_frequency(bench: Bench) -> Finding:
    """Mean deviation from the ideal above 0.6 rad/sample, with filter bank and local model but Kp = 0, against
    without."""

    def check(*reading: str) -> Answer:
        return _closer(bench, reading, HIGH, 1.0, "Kp=0")

    return over(check)


def bank_does_little_at_low_frequency(bench: Bench) -> Finding:
    """Stiffness that the hand feels at 0.05 Hz with filter bank and local model but Kp = 0, against without: whether
    they are within 5 %."""

    def check(*reading: str) -> Answer:
        loops = _three(bench, reading, "Kp=0")
        if not loops:
            return UNSTABLE
        found, without, _ = (1 / np.abs(loop.admittance[0]) for loop in loops)
        holds = bool(abs(found / without - 1) <= LITTLE)
        return Answer(holds, f"{show(found, 4)} N/m, without {show(without, 4)} N/m")

    return over(check)


def gain_helps_at_low_frequency(bench: Bench) -> Finding:
    """Mean deviation from the ideal below 0.6 rad/sample with Kp = 20 against Kp = 0, both with the local model."""

    def check(*reading: str) -> Answer:
        found, without = (bench.response("fig6", *reading, f"Kp={Kp}") for Kp in (20, 0))
        if not (found.stable and without.stable):
            return UNSTABLE
        off = [deviation(response, bench.response("dc"), LOW) for response in (found, without)]
        return Answer(off[0] < off[1], f"off by {show(off[0])}, without Kp {show(off[1])}")

    return over(check)


def gain_frees_from_b(bench: Bench) -> Finding:
    """Spread of the admittance over b = 20 to 80 towards 0 Hz with Kp = 20: whether it is below 1 %."""
    return over(lambda *reading: _spread_over_b(bench, reading, 1e-4))


def gain_frees_from_b_in_the_figure(bench: Bench) -> Finding:
    """Spread of the admittance over b = 20 to 80 with Kp = 20, largest up to 0.15 rad/sample: whether it is below 1
    %."""
    return over(lambda *reading: _spread_over_b(bench, reading, None))


def _spread_over_b(bench: Bench, reading: tuple[str, ...], frequency: float | None) -> Answer:
    spreads = []
    for Kp in (20, 0):
        asked = [(*reading, f"Kp={Kp}", f"b={b}") for b in IMPEDANCES]
        curves = [
            bench.response("fig6", *each) if frequency is None else respond(load_paper("fig6", each), [frequency])
            for each in asked
        ]
        if not all(curve.stable for curve in curves):
            return UNSTABLE
        sizes = np.abs([curve.admittance[within(curve.omega, LOW_OF_FIGURE_2)] for curve in curves])
        spreads.append(float((sizes.max(axis=0) / sizes.min(axis=0) - 1).max()))
    return Answer(spreads[0] < INDEPENDENT, f"spread {show(spreads[0])}, without Kp {show(spreads[1])}")


def much_closer_at_low_frequency(bench: Bench) -> Finding:
    """Mean deviation of the magnitude from the ideal up to 0.6 rad/sample, PMW+LM against PMW: whether at least
    halved."""
    return over(lambda *reading: _closer(bench, reading, LOW, MUCH))


def closer_at_high_frequency(bench: Bench) -> Finding:
    """Mean deviation of the magnitude from the ideal above 0.6 rad/sample, PMW+LM against PMW: whether smaller."""
    return over(lambda *reading: _closer(bench, reading, HIGH, 1.0))


def much_closer_at_high_frequency(bench: Bench) -> Finding:
    """Mean deviation of the magnitude from the ideal above 0.6 rad/sample, PMW+LM against PMW: whether at least
    halved."""
    return over(lambda *reading: _closer(bench, reading, HIGH, MUCH))


def natural_frequency_approaches(bench: Bench) -> Finding:
    """First natural frequency of PMW+LM, PMW and DC: whether PMW+LM's is nearer to DC's than PMW's is."""

    def check(*reading: str) -> Answer:
        loops = _three(bench, reading)
        if not loops:
            return UNSTABLE
        found, without, ideal = (peak(loop) for loop in loops)
        numbers = f"{show(found)} rad/sample, PMW {show(without)}, DC {show(ideal)}"
        return Answer(abs(found - ideal) < abs(without - ideal), numbers)

    return over(check)


def renders_stiffer_contact(bench: Bench) -> Finding:
    """Stiffness that the hand feels at 0.05 Hz, PMW+LM against PMW: whether it is larger."""

    def check(*reading: str) -> Answer:
        loops = _three(bench, reading)
        if not loops:
            return UNSTABLE
        found, without, _ = (1 / np.abs(loop.admittance[0]) for loop in loops)
        return Answer(bool(found > without), f"{show(found, 4)} N/m, PMW {show(without, 4)} N/m")

    return over(check)


def _three(bench: Bench, reading: tuple[str, ...], *more: str) -> tuple:
    """PMW+LM, PMW and DC; nothing where one of the first two is unstable."""
    found, without = bench.response("fig6", *reading, *more), bench.response("pmw", *reading)
    return (found, without, bench.response("dc")) if found.stable and without.stable else ()


def _closer(bench: Bench, reading: tuple[str, ...], band: tuple[float, float], factor: float, *more: str) -> Answer:
    loops = _three(bench, reading, *more)
    if not loops:
        return UNSTABLE
    found, without = (deviation(loop, loops[2], band) for loop in loops[:2])
    return Answer(found < without / factor, f"off by {show(found)}, PMW by {show(without)}")


STATEMENTS = (
    Statement("3", "Filter bank and local model improve transparency at high frequencies", bank_helps_at_high_frequency),
    Statement("3", "... but have little effect at low frequencies", bank_does_little_at_low_frequency),
    Statement("3, eq. (3)", "The position term increases transparency at low frequencies", gain_helps_at_low_frequency),
    Statement(
        "3, eq. (3)",
        "It makes the low-frequency performance independent of the wave impedance: towards 0 Hz",
        gain_frees_from_b,
    ),
    Statement("3, eq. (3)", "... and over the low frequencies of Figure 2a", gain_frees_from_b_in_the_figure),
    Statement(
        "Abstract; 3.2, Fig. 6a; 5",
        "At low frequencies the amplitude of PMW+LM is much closer to the ideal than that of PMW",
        much_closer_at_low_frequency,
    ),
    Statement(
        "Abstract; 3.2, Fig. 6b; 5",
        "At high frequencies PMW+LM is closer to the ideal than PMW",
        closer_at_high_frequency,
    ),
    Statement("Abstract; 3.2, Fig. 6b", "... and much (significantly) so", much_closer_at_high_frequency),
    Statement("3.2, Fig. 6b", "The natural frequency approaches that of the ideal system", natural_frequency_approaches),
    Statement("3.2", "PMW+LM renders stiffer contact than PMW", renders_stiffer_contact),
)
