"""Sections 3 and 3.2, Figure 6: effects of filter bank, local model and Kp on the transmitted admittance.

Also the tick labels of Figures 2 and 6, the only remains of these figures, from which the size of the curves follows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from reproduce.felt_responses import HIGH, LOW, LOW_OF_FIGURE_2, WHOLE, FeltResponse, deviation, peak, show, within
from reproduce.paper_loops import PaperLoops
from reproduce.readings import PMW, PMW_LM
from reproduce.specs import load_paper
from reproduce.statements.figure2 import FAMILY
from reproduce.verdicts import UNSTABLE, Answer, Finding, Statement, over

MUCH = 2.0  # "much" and "significantly" are taken to mean at least by this factor
LITTLE = 0.05  # relative: "little effect" on the stiffness that the hand feels
INDEPENDENT = 0.01  # relative: the spread over b that counts as none
STATIC_HZ = 1e-4

WITHOUT_KP = {"Kp": 0}


def bank_helps_at_high_frequency(paper: PaperLoops) -> Finding:
    """Mean deviation from the ideal above 0.6 rad/sample, with filter bank and local model but Kp = 0, against
    without."""
    return _closer(paper, HIGH, 1.0, WITHOUT_KP)


def bank_does_little_at_low_frequency(paper: PaperLoops) -> Finding:
    """Stiffness that the hand feels at 0.05 Hz with filter bank and local model but Kp = 0, against without: whether
    they are within 5 %."""

    def check(found: FeltResponse, without: FeltResponse) -> Answer:
        felt = [1 / np.abs(loop.admittance[0]) for loop in (found, without)]
        holds = bool(abs(felt[0] / felt[1] - 1) <= LITTLE)
        return Answer(holds, f"{show(felt[0], 4)} N/m, without {show(felt[1], 4)} N/m")

    return _both(paper, check, WITHOUT_KP)


def gain_helps_at_low_frequency(paper: PaperLoops) -> Finding:
    """Mean deviation from the ideal below 0.6 rad/sample with Kp = 20 against Kp = 0, both with the local model."""

    def check(found: FeltResponse, without: FeltResponse) -> Answer:
        if not (found.stable and without.stable):
            return UNSTABLE
        off = [deviation(response, paper.response("dc"), LOW) for response in (found, without)]
        return Answer(off[0] < off[1], f"off by {show(off[0])}, without Kp {show(off[1])}")

    return over(PMW_LM, check, paper.responses("fig6", PMW_LM), paper.responses("fig6", PMW_LM, WITHOUT_KP))


def gain_frees_from_b(paper: PaperLoops) -> Finding:
    """Spread of the admittance over b = 20 to 80 towards 0 Hz with Kp = 20: whether it is below 1 %."""
    return _spread_over_b(paper, slice(0, 1))


def gain_frees_from_b_in_the_figure(paper: PaperLoops) -> Finding:
    """Spread of the admittance over b = 20 to 80 with Kp = 20, largest up to 0.15 rad/sample: whether it is below 1
    %."""
    return _spread_over_b(paper, slice(1, None))


def _spread_over_b(paper: PaperLoops, chosen: slice) -> Finding:
    own = np.asarray(load_paper("fig6").frequency_hz)
    low = own[within(paper.response("fig6").omega, LOW_OF_FIGURE_2)]
    found = paper.families("fig6", PMW_LM, FAMILY, (STATIC_HZ, *low.tolist()))

    def check(family: Sequence[FeltResponse]) -> Answer:
        if not all(curve.stable for curve in family):
            return UNSTABLE
        sizes = np.abs([curve.admittance[chosen] for curve in family])
        spread = float((sizes.max(axis=0) / sizes.min(axis=0) - 1).max())
        return Answer(spread < INDEPENDENT, f"spread {show(spread)}")

    return over(PMW_LM, check, found)


def much_closer_at_low_frequency(paper: PaperLoops) -> Finding:
    """Mean deviation of the magnitude from the ideal up to 0.6 rad/sample, PMW+LM against PMW: whether at least
    halved."""
    return _closer(paper, LOW, MUCH)


def closer_at_high_frequency(paper: PaperLoops) -> Finding:
    """Mean deviation of the magnitude from the ideal above 0.6 rad/sample, PMW+LM against PMW: whether smaller."""
    return _closer(paper, HIGH, 1.0)


def much_closer_at_high_frequency(paper: PaperLoops) -> Finding:
    """Mean deviation of the magnitude from the ideal above 0.6 rad/sample, PMW+LM against PMW: whether at least
    halved."""
    return _closer(paper, HIGH, MUCH)


def natural_frequency_approaches(paper: PaperLoops) -> Finding:
    """First natural frequency of PMW+LM, PMW and DC: whether PMW+LM's is nearer to DC's than PMW's is."""

    def check(*loops: FeltResponse) -> Answer:
        found, without, ideal = (peak(loop) for loop in (*loops, paper.response("dc")))
        numbers = f"{show(found)} rad/sample, PMW {show(without)}, DC {show(ideal)}"
        return Answer(abs(found - ideal) < abs(without - ideal), numbers)

    return _both(paper, check)


def renders_stiffer_contact(paper: PaperLoops) -> Finding:
    """Stiffness that the hand feels at 0.05 Hz, PMW+LM against PMW: whether it is larger."""

    def check(*loops: FeltResponse) -> Answer:
        found, without = (1 / np.abs(loop.admittance[0]) for loop in loops)
        return Answer(bool(found > without), f"{show(found, 4)} N/m, PMW {show(without, 4)} N/m")

    return _both(paper, check)


def _both(paper: PaperLoops, check, change=None) -> Finding:
    """Check PMW+LM and PMW under each reading; if one of them is unstable, the outcome is "unstable"."""

    def seen(*loops: FeltResponse) -> Answer:
        return check(*loops) if all(loop.stable for loop in loops) else UNSTABLE

    return over(PMW_LM, seen, paper.responses("fig6", PMW_LM, change), paper.responses("pmw", PMW_LM))


def _closer(paper: PaperLoops, band: tuple[float, float], factor: float, change=None) -> Finding:
    def check(*loops: FeltResponse) -> Answer:
        found, without = (deviation(loop, paper.response("dc"), band) for loop in loops)
        return Answer(found < without / factor, f"off by {show(found)}, PMW by {show(without)}")

    return _both(paper, check, change)


@dataclass(frozen=True)
class FigureAxis:
    """A vertical axis: the figure, the band that it shows, its highest tick label and the one below, mm/N."""

    figure: str
    band: tuple[float, float]
    below: float
    top: float


AXES = (
    FigureAxis("2a", LOW_OF_FIGURE_2, 2, 4),
    FigureAxis("2b", WHOLE, 10, 15),
    FigureAxis("6a", LOW, 4, 5),
    FigureAxis("6b", HIGH, 5, 10),
)


def fits(axis: FigureAxis) -> Callable[[PaperLoops], Finding]:
    """Give the judge of one axis."""

    def judge(paper: PaperLoops) -> Finding:
        """Largest magnitude among the figure's curves: whether it lies between the two highest legible tick labels,
        in mm/N."""

        def check(loops: Sequence[FeltResponse]) -> Answer:
            if not all(loop.stable for loop in loops):
                return UNSTABLE
            curves = [*loops, paper.response("dc")]
            largest = max(1e3 * np.abs(curve.admittance[within(curve.omega, axis.band)]).max() for curve in curves)
            return Answer(bool(axis.below < largest <= axis.top), f"{show(largest)} mm/N")

        if axis.figure.startswith("2"):
            return over(PMW, check, paper.families("fig2", PMW, FAMILY))
        both = zip(*(paper.responses(name, PMW_LM) for name in ("fig6", "pmw")), strict=True)
        return over(PMW_LM, check, list(both))

    return judge


_INDEPENDENT = (
    "“The additional term in Equation (3) makes the low-frequency control performance independent of the wave impedance.”"
)
_BETTER = "“much better performance that passive multi rate wave control (PMW) both at low and at high frequencies”"

STATEMENTS = (
    Statement(
        "3",
        "“The filter bank and local model shown in Figure 3 improve the transparency of the passive multi rate wave control "
        "of haptic interaction with a slowly updated virtual environment in the high frequency range”",
        bank_helps_at_high_frequency,
    ),
    Statement(
        "3",
        "“but have little effect on the performance of the system in the low-frequency range”",
        bank_does_little_at_low_frequency,
    ),
    Statement(
        "3, eq. (3)",
        "“Increased transparency in low frequencies is achieved via adding an additional term to the returning wave at the "
        "user's side”",
        gain_helps_at_low_frequency,
    ),
    Statement("3, eq. (3)", f"{_INDEPENDENT} (towards 0 Hz)", gain_frees_from_b),
    Statement("3, eq. (3)", f"{_INDEPENDENT} (over the frequencies of Figure 2a)", gain_frees_from_b_in_the_figure),
    Statement(
        "Abstract; 3.2, Fig. 6a; 5",
        "“In the low frequency range, the amplitude response of PMW+LM is much closer to the ideal”",
        much_closer_at_low_frequency,
    ),
    Statement("Abstract; 3.2, Fig. 6b; 5", f"{_BETTER} (at high frequencies: better)", closer_at_high_frequency),
    Statement("Abstract; 3.2, Fig. 6b", f"{_BETTER} (at high frequencies: much better)", much_closer_at_high_frequency),
    Statement(
        "3.2, Fig. 6b",
        "“In the high frequency range, the natural frequency approaches the natural frequency of the ideal system (DC).”",
        natural_frequency_approaches,
    ),
    Statement(
        "3.2",
        "“the proposed architecture can render stiffer contact than the passive multi rate wave controller without local model "
        "of interaction”",
        renders_stiffer_contact,
    ),
)

LABELS = tuple(
    Statement(
        f"Fig. {axis.figure}, labels",
        f"The axis of Figure {axis.figure} goes to {axis.top:g} mm/N, the label below is {axis.below:g}, as far as they are "
        "legible, and the curves fill it",
        fits(axis),
    )
    for axis in AXES
)
