"""Section 1: effects of delay on direct coupling, and the use of local models in the power domain."""

from __future__ import annotations

import numpy as np

from reproduce.felt_responses import LOW, deviation, show, show_limits
from reproduce.paper_loops import PaperLoops
from reproduce.readings import COUPLED, SLOW
from reproduce.verdicts import UNSTABLE, Answer, Finding, Statement, over, untestable

SLOW_WALL, WITH_MODEL = {"controller.kind": "dc-slow"}, {"controller.kind": "dc-lm"}
WALL = 500.0  # N/m
COUPLED_MODEL = ('controller.kind="dc-vc-lm"', 'sweep.along="K_LM"', "sweep.K_LM={start=0,stop=20000}")
ALONG_K_LM = ('controller.kind="dc-lm"', 'sweep.along="K_LM"', "sweep.K_LM={start=0,stop=20000}")


def delay_degrades_stability(paper: PaperLoops) -> Finding:
    """Stiffest stable wall of direct coupling at 1 kHz, of the slow wall without delay, and delayed by a frame."""
    changes = [{}, *({**SLOW_WALL, "environment.delay": delay} for delay in (0, 20))]

    def check(limits: list[float]) -> Answer:
        return Answer(limits[0] > limits[1] > limits[2], show_limits(limits))

    return over(SLOW, check, paper.limit_families("dc", SLOW, changes))


def local_model_helps(paper: PaperLoops) -> Finding:
    """Stiffest stable wall, and mean deviation from the ideal below 0.6 rad/sample with a wall of 50 N/m that each can
    render, of the slow wall and of the slow wall with a power-domain local model of K_LM = K_VE."""
    soft = {"K_VE": 50, "K_LM": 50}
    limits = paper.limit_families("dc", SLOW, [{**kind, "K_LM": 500} for kind in (SLOW_WALL, WITH_MODEL)])
    loops = paper.families("dc", SLOW, [soft, {**soft, **SLOW_WALL}, {**soft, **WITH_MODEL}])

    def check(limits: list[float], loops: list) -> Answer:
        ideal, *found = loops
        if not all(response.stable for response in found):
            return UNSTABLE
        off = [deviation(response, ideal, LOW) for response in found]
        return Answer(limits[1] > limits[0] and off[1] < off[0], f"{show_limits(limits)}, off by {show(off)}")

    return over(SLOW, check, limits, loops)


def substitution(paper: PaperLoops) -> Finding:
    """A local model of 400 N/m at 1 kHz in place of the slow wall of 500 N/m: stiffest stable wall, and the stiffness
    that the hand feels at 0.05 Hz."""
    limits = paper.limit_families("dc", SLOW, [{}, SLOW_WALL])

    def check(limits: list[float], model) -> Answer:
        (fast, slow), felt = limits, 1 / np.abs(model.admittance[0])
        numbers = f"K_VE up to {show(fast, 4)} N/m in place of {show(slow, 4)}; felt {show(felt, 4)} N/m and not 500"
        return Answer(bool(fast > slow and abs(felt - 400) < 4), numbers)

    return over(SLOW, check, limits, paper.responses("dc", SLOW, {"K_VE": 400}))


def conjunction_threatens(paper: PaperLoops) -> Finding:
    """Whether a K_LM between 0 and 20000 N/m makes a slow wall of 50 N/m unstable that is stable without it."""
    found = [paper.stable_along("dc", *ALONG_K_LM, "K_VE=50", *reading.overrides) for reading in SLOW]

    def check(alone, spans: list) -> Answer:
        return Answer(alone.stable and spans != [(0.0, np.inf)], _spans(spans))

    return over(SLOW, check, paper.responses("dc", SLOW, {**SLOW_WALL, "K_VE": 50}), found)


def stable_below_the_wall(paper: PaperLoops) -> Finding:
    """With a virtual coupling (`dc-vc-lm`; 1000 N/m and 5 N*s/m unless a reading says otherwise, since [3] is not at hand):
    whether every K_LM from 0 to K_VE = 500 N/m is stable."""
    spans = [paper.stable_along("dc", *COUPLED_MODEL, *reading.overrides) for reading in COUPLED]
    return over(COUPLED, lambda found: Answer(any(low == 0 and high >= WALL for low, high in found), _spans(found)), spans)


def no_stiffer_model(paper: PaperLoops) -> Finding:
    """The same loops: whether some K_LM is stable, and none above K_VE = 500 N/m, up to 20000 N/m."""
    spans = [paper.stable_along("dc", *COUPLED_MODEL, *reading.overrides) for reading in COUPLED]
    return over(COUPLED, lambda found: Answer(bool(found) and all(high <= WALL for _, high in found), _spans(found)), spans)


def no_stiffer_wall(paper: PaperLoops) -> Finding:
    """Stiffest stable wall of the virtual coupling without a local model (`dc-vc`), and with one of 500 and 1000 N/m
    (`dc-vc-lm`): whether neither makes it stiffer."""
    kinds = [{"controller.kind": "dc-vc"}, *({"controller.kind": "dc-vc-lm", "K_LM": K} for K in (500, 1000))]
    limits = paper.limit_families("dc", COUPLED, kinds)

    def check(found: list[float]) -> Answer:
        return Answer(max(found[1:]) <= found[0], show_limits(found)) if max(found) else UNSTABLE

    return over(COUPLED, check, limits)


def _spans(found: list[tuple[float, float]]) -> str:
    spans = [f"({show(low, 4)}, {show(high, 4)})" for low, high in found]
    return f"stable K_LM in {' and '.join(spans)} N/m" if spans else "no K_LM is stable"


STATEMENTS = (
    Statement(
        "1",
        "“The human touch requires a force refresh rate of about 1 KHz ... physically-based virtual environments oftentimes "
        "cannot be simulated at the speed needed for high-fidelity force control”",
        untestable("a statement on human perception and on other programs' run time"),
    ),
    Statement(
        "1",
        "“The delay of computationally demanding virtual environments is a well-recognized factor degrading the stability or "
        "passivity of haptic interaction [5, 6].” (stability)",
        delay_degrades_stability,
    ),
    Statement(
        "1",
        "“the fast local model ... increases the stability and transparency of the haptic interaction”",
        local_model_helps,
    ),
    Statement(
        "1",
        "“to show that the simulation loop is stable if the local stiffness is lower than the stiffness of the slow virtual "
        "environment”",
        stable_below_the_wall,
    ),
    Statement(
        "1",
        "“The results in [3] indicate that a fixed stiffness local model cannot be used to increase the gain of the force "
        "feedback loop”",
        no_stiffer_model,
    ),
    Statement(
        "1",
        "“and thus, to increase the range of contact impedances that can be rendered to users interacting in slowly updated "
        "virtual environments”",
        no_stiffer_wall,
    ),
    Statement(
        "1",
        "“The resulting passive interaction forces guarantee stable interaction ... a real-time technique has been offered to "
        "generate a lower-order approximation of a full order virtual environment model.”",
        untestable("these controllers are not modelled"),
    ),
    Statement(
        "1",
        "“Substituting a local model for a slow virtual environment improves the stability of the haptic interaction ... but "
        "the transparency of the interaction hinges on the accuracy of the local model.”",
        substitution,
    ),
    Statement(
        "1",
        "“Using a local model in conjunction with the slow virtual environment may threaten the stability of the haptic "
        "system [3].”",
        conjunction_threatens,
    ),
)
