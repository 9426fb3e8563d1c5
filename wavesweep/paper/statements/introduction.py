"""Section 1: what delay does to direct coupling, and what local models in the power domain can do."""

from __future__ import annotations

import numpy as np

from wavesweep.paper.bench import Bench
from wavesweep.paper.measures import LOW, deviation, show, show_limits
from wavesweep.paper.readings import DELAYS, VELOCITIES
from wavesweep.paper.verdicts import UNSTABLE, Answer, Finding, Statement, once, over, untestable

SLOW, WITH_MODEL = 'controller.kind="dc-slow"', 'controller.kind="dc-lm"'
WALLS = (50, 100, 200, 500)  # N/m
ALONG_K_LM = (WITH_MODEL, 'sweep.along="K_LM"', "sweep.K_LM={start=0,stop=20000}")


def delay_degrades_stability(bench: Bench) -> Finding:
    """Stiffest stable wall of direct coupling at 1 kHz, of the slow wall without delay, and delayed by a frame."""

    def check(*reading: str) -> Answer:
        slow = [bench.limit("dc", SLOW, f"environment.delay={delay}", *reading) for delay in (0, 20)]
        limits = [bench.limit("dc", *reading), *slow]
        return Answer(limits[0] > limits[1] > limits[2], show_limits(limits))

    return over(check, VELOCITIES)


def local_model_helps(bench: Bench) -> Finding:
    """Stiffest stable wall, and mean deviation from the ideal below 0.6 rad/sample with a wall of 50 N/m that each can
    render, of the slow wall and of the slow wall with a power-domain local model of K_LM = K_VE."""

    def check(*reading: str) -> Answer:
        limits = [bench.limit("dc", kind, "K_LM=500", *reading) for kind in (SLOW, WITH_MODEL)]
        soft = ("K_VE=50", "K_LM=50")
        ideal, *found = (bench.response("dc", *kind, *soft, *reading) for kind in ((), (SLOW,), (WITH_MODEL,)))
        if not all(response.stable for response in found):
            return UNSTABLE
        off = [deviation(response, ideal, LOW) for response in found]
        numbers = f"{show_limits(limits)}, off by {show(off)}"
        return Answer(limits[1] > limits[0] and off[1] < off[0], numbers)

    return over(check, DELAYS)


def stable_below_the_walls_stiffness(bench: Bench) -> Finding:
    """Whether all K_LM below K_VE are stable with the power-domain local model (the controller `dc-lm`), for walls of
    50, 100, 200, 500 N/m."""
    return over(lambda *reading: _covered(bench, reading, WALLS), DELAYS)


def stable_below_a_stable_walls_stiffness(bench: Bench) -> Finding:
    """The same for those of the four walls that are stable without a local model."""

    def check(*reading: str) -> Answer:
        limit = bench.limit("dc", SLOW, *reading)
        return _covered(bench, reading, [K_VE for K_VE in WALLS if limit > K_VE])

    return over(check, DELAYS)


def _covered(bench: Bench, reading: tuple[str, ...], walls) -> Answer:
    """Whether the stable K_LM begin at 0 and reach K_VE, for each wall; the numbers are of the wall that fails, if
    any."""
    for K_VE in reversed(walls):
        found = bench.stable("dc", *ALONG_K_LM, *reading, f"K_VE={K_VE}")
        if not any(low == 0 and high >= K_VE for low, high in found):
            return Answer(False, f"K_VE = {K_VE} N/m: {_spans(found)}")
    return Answer(True, f"for K_VE = {show(walls)} N/m")


def no_stiffer_model_is_stable(bench: Bench) -> Finding:
    """Whether no K_LM above K_VE is stable with the power-domain local model, K_VE = 500 N/m."""

    def check(*reading: str) -> Answer:
        found = bench.stable("dc", *ALONG_K_LM, *reading)
        return Answer(all(high <= 500 for _, high in found), _spans(found))

    return over(check, DELAYS)


def model_adds_no_range(bench: Bench) -> Finding:
    """Whether a power-domain local model of K_LM = 500 N/m leaves the stiffest stable wall where it is without one."""

    def check(*reading: str) -> Answer:
        without, found = (bench.limit("dc", kind, "K_LM=500", *reading) for kind in (SLOW, WITH_MODEL))
        return Answer(found <= without, f"{show_limits(found)}, without it {show(without, 4)} N/m")

    return over(check, DELAYS)


def substitution(bench: Bench) -> Finding:
    """A local model of 400 N/m at 1 kHz in place of the slow wall of 500 N/m: stiffest stable wall, and the stiffness
    that the hand feels at 0.05 Hz."""
    fast, slow = bench.limit("dc"), bench.limit("dc", SLOW)
    felt = 1 / np.abs(bench.response("dc", "K_VE=400").admittance[0])
    numbers = f"K_VE up to {show(fast, 4)} N/m in place of {show(slow, 4)}; felt {show(felt, 4)} N/m and not 500"
    return once(Answer(fast > slow and abs(felt - 400) < 4, numbers))


def conjunction_threatens(bench: Bench) -> Finding:
    """Whether a K_LM between 0 and 20000 N/m makes a slow wall of 50 N/m unstable that is stable without it."""

    def check(*reading: str) -> Answer:
        alone = bench.response("dc", SLOW, "K_VE=50", *reading).stable
        found = bench.stable("dc", *ALONG_K_LM, "K_VE=50", *reading)
        return Answer(alone and found != [(0.0, np.inf)], _spans(found))

    return over(check, DELAYS)


def _spans(found) -> str:
    spans = [f"({show(low, 4)}, {show(high, 4)})" for low, high in found]
    return f"stable K_LM in {' and '.join(spans)} N/m" if spans else "no K_LM is stable"


_PEOPLE = untestable("a statement on human perception and on other programs' run time")

STATEMENTS = (
    Statement(
        "1",
        "The human touch requires a force refresh rate of about 1 kHz, at which physically based virtual "
        "environments often cannot be simulated",
        _PEOPLE,
    ),
    Statement(
        "1",
        "The delay of the virtual environment degrades the stability of haptic interaction [5, 6]",
        delay_degrades_stability,
    ),
    Statement("1", "A fast local model increases the stability and transparency of the interaction", local_model_helps),
    Statement(
        "1",
        "A power-domain local model is stable if its stiffness is lower than that of the slow virtual environment [3]",
        stable_below_the_walls_stiffness,
    ),
    Statement("1", "... where that environment is stable without it", stable_below_a_stable_walls_stiffness),
    Statement(
        "1",
        "A fixed-stiffness local model cannot increase the gain of the force feedback loop [3]: it is stable "
        "only below the wall's stiffness",
        no_stiffer_model_is_stable,
    ),
    Statement("1", "A fixed-stiffness local model cannot increase the range of contact impedances [3]", model_adds_no_range),
    Statement(
        "1",
        "Passive activation of passive local models guarantees stability [13]; reduced-order models serve "
        "beside or in place of the environment [4, 11]",
        untestable("these controllers are not modelled"),
    ),
    Statement(
        "1",
        "Substituting a local model for the slow environment improves stability, but transparency hinges on the "
        "model's accuracy [13]",
        substitution,
    ),
    Statement("1", "A local model in conjunction with the slow environment may threaten stability [3]", conjunction_threatens),
)
