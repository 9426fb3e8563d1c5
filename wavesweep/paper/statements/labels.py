"""What is left of the lost figures of responses: tick labels, from which the size of the curves can be told."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.paper.bench import Bench
from wavesweep.paper.measures import HIGH, LOW, LOW_OF_FIGURE_2, WHOLE, show, within
from wavesweep.paper.readings import PMW, PMW_LM
from wavesweep.paper.response import Response
from wavesweep.paper.statements.figure2 import FAMILY
from wavesweep.paper.verdicts import UNSTABLE, Answer, Finding, Statement, over


@dataclass(frozen=True)
class Axis:
    """A vertical axis: the figure, the band that it shows, its highest tick label and the one below, mm/N."""

    figure: str
    band: tuple[float, float]
    below: float
    top: float


AXES = (
    Axis("2a", LOW_OF_FIGURE_2, 2, 4),
    Axis("2b", WHOLE, 10, 15),
    Axis("6a", LOW, 4, 5),
    Axis("6b", HIGH, 5, 10),
)


def fits(axis: Axis) -> Callable[[Bench], Finding]:
    """Give the judge of one axis."""

    def judge(bench: Bench) -> Finding:
        """Largest magnitude among the figure's curves: whether it lies between the two highest legible tick labels,
        in mm/N."""

        def check(loops: Sequence[Response]) -> Answer:
            if not all(loop.stable for loop in loops):
                return UNSTABLE
            curves = [*loops, bench.response("dc")]
            largest = max(1e3 * np.abs(curve.admittance[within(curve.omega, axis.band)]).max() for curve in curves)
            return Answer(bool(axis.below < largest <= axis.top), f"{show(largest)} mm/N")

        if axis.figure.startswith("2"):
            return over(PMW, check, bench.families("fig2", PMW, FAMILY))
        both = zip(*(bench.responses(name, PMW_LM) for name in ("fig6", "pmw")), strict=True)
        return over(PMW_LM, check, list(both))

    return judge


STATEMENTS = tuple(
    Statement(
        f"Fig. {axis.figure}, labels",
        f"The axis of Figure {axis.figure} goes to {axis.top:g} mm/N, the label below is {axis.below:g}, as far as they are "
        "legible, and the curves fill it",
        fits(axis),
    )
    for axis in AXES
)
