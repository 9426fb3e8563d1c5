"""The loop with an input added to a signal at which it is cut: what comes of it there is the
sensitivity.

With L the loop from the signal back to it, u = d/(1 + L) is the signal behind the input d, and u -
d/2 is d (1 - L)/(1 + L)/2. The largest |1/(1 + L)| is Ms, and 1 over the largest |1/(1 + L) - 1/2|
the disk margin, as `margins` has them.

d is read when the signal is made, once in n ticks, and u is held over these. So the energy of u is
n times that of its samples, and a gain of all ticks is the root of n times that of the samples.
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine.blocks import OUTPUT
from wavesweep.engine.drawing import BLOCK
from wavesweep.engine.errors import UsageError
from wavesweep.engine.expressions import ONE, Tree
from wavesweep.program.analyses.cuts import fault_of_cut
from wavesweep.require.gain_bound import CutBound, GainBound

if TYPE_CHECKING:
    from wavesweep.engine.loop import Loops

PATH = "sweep.require.margins"
INPUT, ALONE, SEEN = "input at the cut", "the input alone", "behind the cut"
LESS_HALF = Tree.number(-0.5)


def seen_at_cut(loops: Loops, bound: CutBound) -> tuple[Loops, tuple[str, str], GainBound]:
    """Return loops with an input at a cut, the input and the signal behind it, and what the gain
    between them has to be below.

    Errors: UsageError for a signal at which the loops cannot be cut, or at which what is bounded is
    not this gain.
    """
    refuse_cut(loops.drawing, bound.cut)
    loops = loops.with_gain_at(bound.cut)
    drawing = loops.drawing
    (behind,) = (block for block in drawing.blocks if block.name == BLOCK)
    wires = dict(drawing.wires)
    wires[f"{BLOCK}.u"] = (*wires[f"{BLOCK}.u"], (INPUT, ONE))
    wires[f"{ALONE}.u"] = ((INPUT, ONE),)
    seen = ((f"{BLOCK}.y", ONE),)
    if bound.centre:
        seen = (*seen, (f"{ALONE}.y", LESS_HALF))
    drawing = replace(
        drawing,
        blocks=(*drawing.blocks, replace(behind, name=ALONE)),
        wires=tuple(wires.items()),
        inputs=(*drawing.inputs, (INPUT, INPUT, "")),
        outputs=(*drawing.outputs, (SEEN, seen, "")),
    )
    loops = loops._replace(drawing=drawing)
    runs = runs_at_cut(loops)
    steps = np.diff([*runs, runs[0] + loops.drawn().ticks])
    if (steps != steps[0]).any():
        raise UsageError(
            f"{PATH}.cut: expected a signal that is made at even steps, found {bound.cut!r}, "
            f"made {steps.min()} to {steps.max()} ticks apart"
        )
    if bound.centre and runs.size > 1:
        raise UsageError(
            f"{PATH}.disk: expected Ms in its place, since {bound.cut!r} is made {runs.size} times "
            "in a frame, and a disk margin is of one factor on all of them"
        )
    return loops, (INPUT, OUTPUT + SEEN), GainBound(INPUT, SEEN, bound.at_most * sqrt(steps[0]))


def refuse_cut(drawing: Any, cut: str) -> None:
    """Raise UsageError for a signal at which loops cannot be cut."""
    fault = fault_of_cut(drawing, cut)
    if fault:
        expected, text_found, hint = fault
        meant = f"; did you mean `{hint}`?" if hint else ""
        raise UsageError(f"{PATH}.cut: expected {expected}, found {text_found}{meant}")


def runs_at_cut(loops: Loops) -> np.ndarray:
    """The ticks of a frame in which a signal is made behind which there is a gain."""
    drawn = loops.drawn()
    (behind,) = (placed for placed in drawn.placed if placed.block.name == BLOCK)
    return np.flatnonzero(behind.runs(drawn.ticks))
