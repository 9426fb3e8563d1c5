"""Section 2 and Figure 2: what the wave impedance and the anti-aliasing filter do to the transmitted admittance."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from wavesweep.paper.bench import Bench
from wavesweep.paper.measures import (
    HIGH,
    LOW_OF_FIGURE_2,
    WHOLE,
    deviation,
    falls,
    peak,
    rises,
    show,
    show_limits,
    within,
)
from wavesweep.paper.readings import READINGS, set_to
from wavesweep.paper.response import Response, respond
from wavesweep.paper.specs import load_paper
from wavesweep.paper.verdicts import UNSTABLE, Answer, Finding, Statement, once, over
from wavesweep.spec import Spec

IMPEDANCES = (20, 40, 60, 80)
CUTOFFS_HZ = (5, 10, 15, 20)
CLOSE = 0.05  # relative: "behaves like a spring of stiffness" is taken to mean within this


def direct_coupling_shows_the_stiffness(bench: Bench) -> Finding:
    """Inverse of direct coupling's admittance at 0.05 Hz against K_VE = 500 N/m, to 1 %."""
    felt = 1 / np.abs(bench.response("dc").admittance[0])
    return once(Answer(bool(abs(felt - 500) < 5), f"{show(felt, 5)} N/m"))


def larger_b_helps_at_low_frequency(bench: Bench) -> Finding:
    """Mean deviation from the ideal below 0.15 rad/sample for b = 20, 40, 60, 80: whether it falls."""
    return over(lambda *reading: _ordered(bench, reading, LOW_OF_FIGURE_2, falls))


def larger_b_hurts_at_high_frequency(bench: Bench) -> Finding:
    """Mean deviation from the ideal above 0.6 rad/sample for b = 20, 40, 60, 80: whether it rises."""
    return over(lambda *reading: _ordered(bench, reading, HIGH, rises))


def waves_hurt_at_high_frequency(bench: Bench) -> Finding:
    """Mean deviation from the ideal above 0.6 rad/sample against that below 0.15, for each b: whether it is larger."""

    def check(*reading: str) -> Answer:
        found = _family(bench, reading)
        if not found:
            return UNSTABLE
        off = [[deviation(r, bench.response("dc"), band) for r in found] for band in (LOW_OF_FIGURE_2, HIGH)]
        holds = all(high > low for low, high in zip(*off, strict=True))
        return Answer(holds, f"off by {show(off[1])}, at low frequencies by {show(off[0])}")

    return over(check)


def filter_is_a_spring(bench: Bench) -> Finding:
    """Spring in series with K_VE that the admittance towards 0 Hz shows, against 2 b lambda (b = 25), to 5 %."""
    del bench
    no_hold = set_to("wall at the fast rate (no hold)", "rates.ratio=1")

    return over(lambda *reading: _spring(load_paper("pmw", reading)), (*READINGS, no_hold))


def _spring(spec: Spec) -> Answer:
    values = spec.values
    static = respond(spec, [1e-3])
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


def b_is_like_damping(bench: Bench) -> Finding:
    """Damping that the control force puts on the device, Im(impedance)/omega, between 1 and 3 rad/sample on
    average: whether it rises with b and is within a factor of 2 of it."""

    def check(*reading: str) -> Answer:
        found = _family(bench, reading)
        if not found:
            return UNSTABLE
        damping = [_damping(response) for response in found]
        near = all(0.5 < value / b < 2 for value, b in zip(damping, IMPEDANCES, strict=True))
        return Answer(rises(damping) and near, f"{show(damping)} N s/m for b = {show(IMPEDANCES)}")

    return over(check)


def _damping(response: Response) -> float:
    chosen = within(response.omega, (1.0, 3.0))
    return float(np.mean(response.impedance[chosen].imag / (response.omega[chosen] / 0.02)))


def damping_lowers_the_natural_frequency(bench: Bench) -> Finding:
    """First peak of direct coupling for a device's damping of 1.5, 3, 4.5, 6 N s/m: whether its frequency falls."""
    peaks = [peak(bench.response("dc", f"device.damping={d}")) for d in (1.5, 3.0, 4.5, 6.0)]
    return once(Answer(falls(peaks), f"{show(peaks)} rad/sample"))


def larger_b_lowers_the_natural_frequency(bench: Bench) -> Finding:
    """First peak of the admittance for b = 20, 40, 60, 80: whether its frequency falls."""

    def check(*reading: str) -> Answer:
        found = _family(bench, reading)
        if not found:
            return UNSTABLE
        peaks = [peak(response) for response in found]
        return Answer(falls(peaks), f"{show(peaks)} rad/sample")

    return over(check)


def higher_cutoff_nears_the_ideal(bench: Bench) -> Finding:
    """Mean deviation from the ideal up to pi rad/sample for LP1 at 5, 10, 15, 20 Hz, b = 25: whether it falls."""

    def check(*reading: str) -> Answer:
        found = [bench.response("pmw", *reading, f"filters.lp1.cutoff_hz={hz}") for hz in CUTOFFS_HZ]
        if not all(response.stable for response in found):
            return UNSTABLE
        off = [deviation(response, bench.response("dc"), WHOLE) for response in found]
        return Answer(falls(off), f"off by {show(off)}")

    return over(check)


def higher_cutoff_costs_stability(bench: Bench) -> Finding:
    """Stiffest stable wall for LP1 at 5, 10, 15, 20 Hz, b = 25: whether it never rises and falls in the end."""

    def check(*reading: str) -> Answer:
        limits = [bench.limit("pmw", *reading, f"filters.lp1.cutoff_hz={hz}") for hz in CUTOFFS_HZ]
        holds = all(after <= before for before, after in pairwise(limits)) and limits[-1] < limits[0]
        return Answer(holds, show_limits(limits))

    return over(check)


def _family(bench: Bench, reading: tuple[str, ...]) -> list[Response]:
    """The four curves of Figure 2; none where one of them is unstable."""
    found = [bench.response("fig2", *reading, f"b={b}") for b in IMPEDANCES]
    return found if all(response.stable for response in found) else []


def _ordered(bench: Bench, reading: tuple[str, ...], band: tuple[float, float], order) -> Answer:
    found = _family(bench, reading)
    if not found:
        return UNSTABLE
    off = [deviation(response, bench.response("dc"), band) for response in found]
    return Answer(order(off), f"off by {show(off)}")


STATEMENTS = (
    Statement(
        "2",
        "The DC admittance indicates the stiffness transmitted (direct coupling: that of the wall)",
        direct_coupling_shows_the_stiffness,
    ),
    Statement(
        "2, Fig. 2a",
        "Increasing the wave impedance improves transparency at low frequencies",
        larger_b_helps_at_low_frequency,
    ),
    Statement(
        "2, eq. (2)",
        "At low frequencies the anti-aliasing filter behaves like a spring of 2 b lambda",
        filter_is_a_spring,
    ),
    Statement(
        "2, Fig. 2b",
        "Passive multirate wave control adversely affects the admittance at high frequencies",
        waves_hurt_at_high_frequency,
    ),
    Statement(
        "2, Fig. 2b",
        "Increasing the wave impedance degrades transparency at high frequencies",
        larger_b_hurts_at_high_frequency,
    ),
    Statement("2", "Increasing the wave impedance is similar to adding damping to the haptic system", b_is_like_damping),
    Statement("2", "Added damping decreases the first natural frequency", damping_lowers_the_natural_frequency),
    Statement("2, Fig. 2b", "... and so does a larger wave impedance", larger_b_lowers_the_natural_frequency),
    Statement(
        "2",
        "The admittance approaches the ideal when the cutoff of the low-pass filter increases [17]",
        higher_cutoff_nears_the_ideal,
    ),
    Statement("2", "... at the expense of stability [17]", higher_cutoff_costs_stability),
)
