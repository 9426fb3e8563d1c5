"""Batches of loops with their numbers: their drift, frames and radii."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loops.batch import Loops
from wavesweep.engine.loops.from_drawing import twins
from wavesweep.engine.loops.multirate import MultirateLoop
from wavesweep.engine.loops.ports import hand_of
from wavesweep.engine.monodromy.drift import MarginalModes, closed_frame, drift_of_drawn, frame_with_reliability
from wavesweep.engine.monodromy.periodic import ticks_of
from wavesweep.engine.stability.spectrum import radius_of


@contextmanager
def named_loops(drawn: MultirateLoop) -> Iterator[None]:
    """Name the blocks if an algebraic loop has no solution."""
    try:
        yield
    except IllPosedLoopError as error:
        blocks = ", ".join(drawn.direct_blocks()) or "the wires"
        raise IllPosedLoopError(
            f"the loop of direct terms through {blocks} has no solution, or none that double precision can find; put a delay "
            "or a hold into it, or change the gain that closes it"
        ) from error


@lru_cache(maxsize=64)  # a compiled loop is asked again and again
def blocks_without_solution(drawing, items):
    """Names of the blocks on a loop of direct terms that has no solution with these numbers; None if all have one."""
    loop = Loops(drawing, dict(items))
    try:
        drawn = loop.drawn()
    except IllPosedLoopError:  # within a plant
        return [block.name for plant in drawing.plants for block in plant.members]
    try:
        with named_loops(drawn):
            ticks_of(drawn, alone=True)
    except IllPosedLoopError:
        return drawn.direct_blocks()
    return None


def drift_of(loops: Loops, out: str = "", watched=(), second: str = "") -> MarginalModes:
    """The drift of loops of a batch, whose numbers that vary are arrays; see `twins` and `drift_of_drawn`."""
    with np.errstate(all="ignore"):
        return _drift(*twins(*loops, out, second), tuple(watched))


_drift = lru_cache(maxsize=256)(drift_of_drawn)  # twins of the same numbers are the same objects


def frames(loops: Loops, drift: MarginalModes) -> np.ndarray:
    """Frame-to-frame matrices less identity, without drift, `(..., n, n)`; see `closed_frame`."""
    drawn = loops.drawn()
    with named_loops(drawn), np.errstate(all="ignore"):
        return closed_frame(drawn, drift)


def frames_with_reliability(drawn: MultirateLoop, drift: MarginalModes):
    """`frames`, and whether their spectral radius is hidden: the arguments of `radius_of`; see `frame_with_reliability`."""
    with named_loops(drawn), np.errstate(all="ignore"):
        return frame_with_reliability(drawn, drift)


def radii_of(loops: Loops, size: int = 1) -> np.ndarray:
    """Spectral radius per frame of each of `size` loops, `(size,)`, without drift, as `radius_of` returns it."""
    frames_of_loops = frames_with_reliability(loops.drawn(), drift_of(loops))
    radii = np.array(np.broadcast_to(radius_of(*frames_of_loops), (size,)))
    if size > 1:
        for at in np.flatnonzero(np.isnan(radii)).tolist():
            alone = loops.one(at)
            radii[at] = radius_of(*frames_with_reliability(alone.drawn(), drift_of(alone))).item()
    return radii


def frames_of(loops: Loops) -> int:
    """How many frames of the drawing are one of its spec: several if nothing in it runs at the slow rate.

    loops: with all numbers of the spec.
    """
    ratio = loops.values.get("rates.ratio", 1)
    return 1 if "rates.ratio" in loops.drawing.reads or isinstance(ratio, float) else ratio


def watched_drift(loops: Loops) -> MarginalModes:
    """The drift as the hand's port sees it."""
    return drift_of(loops, watched=hand_of(loops.drawing).signals)
