"""Section 2, Figure 2: effects of the wave impedance and the anti-aliasing filter on the transmitted admittance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from reproduce.felt_responses import (
    HIGH,
    LOW_OF_FIGURE_2,
    WHOLE,
    FeltResponse,
    deviation,
    falls,
    peak,
    rises,
    show,
    show_limits,
    within,
)
from reproduce.paper_loops import PaperLoops
from reproduce.readings import DIRECT, NO_HOLD, PMW, Reading, readings, under
from reproduce.verdicts import UNSTABLE, Answer, Finding, Statement, over

IMPEDANCES = (20, 40, 60, 80)
FAMILY = [{"b": b} for b in IMPEDANCES]
CUTOFFS_HZ = (5, 10, 15, 20)
CUTOFFS = [{"filters.lp1.cutoff_hz": hz} for hz in CUTOFFS_HZ]
OF_ONE_CUTOFF = readings(under("device.", "environment.", "filters.lp1.order"))
CLOSE = 0.05  # relative: what is "like" a spring is within this, and what is affected is off by more


def direct_coupling_shows_the_stiffness(paper: PaperLoops) -> Finding:
    """Inverse of direct coupling's admittance at 0.05 Hz against K_VE = 500 N/m, to 1 %."""

    def check(direct: FeltResponse) -> Answer:
        felt = 1 / np.abs(direct.admittance[0])
        return Answer(bool(abs(felt - 500) < 5), f"{show(felt, 5)} N/m")

    return over(DIRECT, check, paper.responses("dc", DIRECT))


def larger_b_helps_at_low_frequency(paper: PaperLoops) -> Finding:
    """Mean deviation from the ideal below 0.15 rad/sample for b = 20, 40, 60, 80: whether it falls."""
    return _over_family(paper, lambda family: _ordered(paper, family, LOW_OF_FIGURE_2, falls))


def larger_b_hurts_at_high_frequency(paper: PaperLoops) -> Finding:
    """Mean deviation from the ideal above 0.6 rad/sample for b = 20, 40, 60, 80: whether it rises."""
    return _over_family(paper, lambda family: _ordered(paper, family, HIGH, rises))


def waves_hurt_at_high_frequency(paper: PaperLoops) -> Finding:
    """Mean deviation from the ideal above 0.6 rad/sample: whether it is more than 5 % for each b of Figure 2."""

    def check(family: Sequence[FeltResponse]) -> Answer:
        off = [deviation(response, paper.response("dc"), HIGH) for response in family]
        return Answer(min(off) > CLOSE, f"off by {show(off)}")

    return _over_family(paper, check)


def filter_is_a_spring(paper: PaperLoops) -> Finding:
    """Spring in series with K_VE that the admittance towards 0 Hz shows, against 2 b lambda (b = 25), to 5 %."""
    tried = (*PMW, Reading((NO_HOLD,)))
    return over(tried, _spring, paper.families("pmw", tried, [{}], (1e-3,)), paper.values("pmw", tried))


def _spring(family: Sequence[FeltResponse], values) -> Answer:
    (static,) = family
    if not static.stable:
        return UNSTABLE
    b, cutoff = values["controller.b"], values["filters.lp1.cutoff_hz"]
    found = 1 / (np.abs(static.admittance[0]) - 1 / values["environment.K_VE"])
    wanted, whole = 2 * b * 2 * np.pi * cutoff, 2 * b / _delay_of_the_way(values)
    numbers = f"{show(found, 4)} N/m against {show(wanted, 4)}, {show(found / wanted)} of it"
    return Answer(bool(abs(found / wanted - 1) < CLOSE), f"{numbers}; 2 b/tau with hold and delay gives {show(whole, 4)}")


def _delay_of_the_way(values) -> float:
    """LP1's group delay at DC, the mean hold and the wall's delay, in s."""
    period, order = 1 / values["rates.fast_hz"], values["filters.lp1.order"]
    warped = 2 / period * np.tan(np.pi * values["filters.lp1.cutoff_hz"] * period)
    held = ((values["rates.ratio"] - 1) / 2 + values["environment.delay"]) * period
    return float(1 / (warped * np.sin(np.pi / (2 * order))) + held)


def b_is_like_damping(paper: PaperLoops) -> Finding:
    """Damping that the control force puts on the device, Im(impedance)/omega, between 1 and 3 rad/sample on
    average: whether it rises with b and is within a factor of 2 of it."""

    def check(family: Sequence[FeltResponse]) -> Answer:
        damping = [_damping(response) for response in family]
        near = all(0.5 < value / b < 2 for value, b in zip(damping, IMPEDANCES, strict=True))
        return Answer(rises(damping) and near, f"{show(damping)} N s/m for b = {show(IMPEDANCES)}")

    return _over_family(paper, check)


def _damping(response: FeltResponse) -> float:
    chosen = within(response.omega, (1.0, 3.0))
    return float(np.mean(response.impedance[chosen].imag / (response.omega[chosen] / 0.02)))


def damping_lowers_the_natural_frequency(paper: PaperLoops) -> Finding:
    """First peak of direct coupling for a device's damping of 1.5, 3, 4.5, 6 N s/m: whether its frequency falls."""
    return over(DIRECT, _peaks_fall, paper.families("dc", DIRECT, [{"device.damping": d} for d in (1.5, 3.0, 4.5, 6.0)]))


def larger_b_lowers_the_natural_frequency(paper: PaperLoops) -> Finding:
    """First peak of the admittance for b = 20, 40, 60, 80: whether its frequency falls."""
    return _over_family(paper, _peaks_fall)


def _peaks_fall(family: Sequence[FeltResponse]) -> Answer:
    peaks = [peak(response) for response in family]
    return Answer(falls(peaks), f"{show(peaks)} rad/sample")


def higher_cutoff_nears_the_ideal(paper: PaperLoops) -> Finding:
    """Mean deviation from the ideal up to pi rad/sample for LP1 at 5, 10, 15, 20 Hz, b = 25: whether it falls."""

    def check(family: Sequence[FeltResponse]) -> Answer:
        if not all(response.stable for response in family):
            return UNSTABLE
        return _ordered(paper, family, WHOLE, falls)

    return over(OF_ONE_CUTOFF, check, paper.families("pmw", OF_ONE_CUTOFF, CUTOFFS))


def higher_cutoff_costs_stability(paper: PaperLoops) -> Finding:
    """Stiffest stable wall for LP1 at 5, 10, 15, 20 Hz, b = 25: whether it never rises and falls in the end."""

    def check(limits: list[float]) -> Answer:
        holds = all(after <= before for before, after in pairwise(limits)) and limits[-1] < limits[0]
        return Answer(holds, show_limits(limits))

    return over(OF_ONE_CUTOFF, check, paper.limit_families("pmw", OF_ONE_CUTOFF, CUTOFFS))


def _over_family(paper: PaperLoops, check: Callable[[Sequence[FeltResponse]], Answer]) -> Finding:
    """Check the four curves of Figure 2 under each reading; if one is unstable, so is the outcome."""

    def seen(family: Sequence[FeltResponse]) -> Answer:
        return check(family) if all(response.stable for response in family) else UNSTABLE

    return over(PMW, seen, paper.families("fig2", PMW, FAMILY))


def _ordered(paper: PaperLoops, family: Sequence[FeltResponse], band: tuple[float, float], order) -> Answer:
    off = [deviation(response, paper.response("dc"), band) for response in family]
    return Answer(order(off), f"off by {show(off)}")


_DAMPING = "“Added damping decreases the first natural frequency of the system and thus degrades transparency.”"

STATEMENTS = (
    Statement(
        "2",
        "“the DC transmitted admittance provides a direct indication of the environment stiffness transmitted to the user” "
        "(by direct coupling)",
        direct_coupling_shows_the_stiffness,
    ),
    Statement(
        "2, Fig. 2a",
        "“increasing the wave impedance improves transparency in the low frequency range”",
        larger_b_helps_at_low_frequency,
    ),
    Statement(
        "2, eq. (2)",
        "“the lowpass anti-aliasing filter behaves like a virtual coupler with spring stiffness ... in the low frequency "
        "range” (of 2 b lambda)",
        filter_is_a_spring,
    ),
    Statement(
        "2, Fig. 2b",
        "“passive multirate wave control adversely affects the transmitted admittance in the high frequency range”",
        waves_hurt_at_high_frequency,
    ),
    Statement("2", "“Increasing the wave impedance is similar to adding damping to the haptic system.”", b_is_like_damping),
    Statement("2", f"{_DAMPING} (the first half, by the device's damping)", damping_lowers_the_natural_frequency),
    Statement("2, Fig. 2b", f"{_DAMPING} (the first half, by the wave impedance)", larger_b_lowers_the_natural_frequency),
    Statement("2, Fig. 2b", f"{_DAMPING} (the second half, by the wave impedance)", larger_b_hurts_at_high_frequency),
    Statement(
        "2",
        "“the transmitted admittance approaches the ideal transmitted admittance ... when the cutoff frequency of the low "
        "pass filter increases”",
        higher_cutoff_nears_the_ideal,
    ),
    Statement(
        "2",
        "“at the expense of stability when the cutoff frequency of the low pass filter increases”",
        higher_cutoff_costs_stability,
    ),
)
