"""Dominance of the diagonal of frames along any number, with ball arithmetic where doubles leave a
doubt.

Applies always. Frames are interpolated on panels of the number with a bound on the error;
eigenvalues are held off the unit circle by discs about the diagonal in eigenvectors of a place
nearby. Stretches in doubt are asked of balls, if there is a prover.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine._search.question import Question, Rest, Slices
from wavesweep.engine._stability.intervals import Intervals

if TYPE_CHECKING:
    from wavesweep.engine._search.frames_along import FramesAlong
    from wavesweep.engine.loop import Loops

# of eigenvalues less 1: two that are 1 come out so near to it at least
NEARLY_ONE = 1e-6


def applies(question: Question, slices: Slices) -> bool:  # noqa: ARG001
    """Whether it can be asked: always."""
    return True


def find(question: Question, slices: Slices, rest: Rest) -> Intervals:  # noqa: ARG001
    """The intervals from frames whose diagonal dominates."""
    from wavesweep.engine._search.frames_along import FramesAlong, in_own_time
    from wavesweep.engine._stability.along_any import FROM_ZERO, stable_along_any

    loops = slices.loops
    path = question.along
    span = question.span
    bound = question.bound
    frames = FramesAlong.of(question, loops, slices.size)
    radius = bound.radius_of(frames.period) if bound else None
    frames = replace(frames, radius=radius)
    stops_a_drift = span[0] <= 0 <= span[1] and not bound and _drifts_at_zero_alone(question, loops)
    variable = _variable(question, frames, stops_a_drift)
    balls = None
    if question.prover and not bound:
        balls = question.prover(loops, path, frames.period)
    from_one = stops_a_drift and span[0] == 0 and variable != FROM_ZERO
    intervals = stable_along_any(
        frames.family, span, variable=variable, balls=balls, from_one=from_one
    )
    if stops_a_drift:
        intervals = _meeting_one_at_zero(span, intervals)
    return in_own_time(intervals, loops, path)


def _variable(question: Question, frames: FramesAlong, stops_a_drift: bool) -> str:
    """The variable in which the frames are followed, see `regions_along_any`: FROM_ZERO if
    eigenvalues may leave z = 1 as a power of the number, BENT along a stiffness or a damping."""
    from wavesweep.engine._loops.domain import bends_at_zero
    from wavesweep.engine._stability.along_any import BENT, FROM_ZERO

    drawing = frames.loops.drawing
    if question.span[0] >= 0 and question.number in (drawing.wall or ()):
        return BENT
    if question.span[0] != 0:
        return ""
    if bends_at_zero(drawing, question.along):
        return FROM_ZERO
    if stops_a_drift and _several_are_one_at_zero(frames, frames.period.size):
        return FROM_ZERO
    return ""


def _drifts_at_zero_alone(question: Question, loops: Loops) -> bool:
    """Whether a drift of the loop is stopped by the number alone, so that an eigenvalue is 1
    where the number is 0."""
    at_ends = loops.changed({question.along: np.array(question.span)}).drift_of_frames()
    free = loops.changed({question.along: 0.0}).drift_of_frames()
    return len(free.constant) + len(free.varying) > len(at_ends.constant) + len(at_ends.varying)


def _several_are_one_at_zero(frames: FramesAlong, size: int) -> bool:
    """Whether several eigenvalues seem to be 1 where the number is 0, as those of a free mass,
    which then leave together, as roots of the number."""
    at_zero = frames.frames(np.arange(size), np.zeros(size)).E
    w = np.linalg.eigvals(np.nan_to_num(at_zero))
    return bool(((np.abs(w) < NEARLY_ONE).sum(-1) > 1).any())


def _meeting_one_at_zero(span: tuple[float, float], intervals: Intervals) -> Intervals:
    """Intervals that end at 0 with an eigenvalue 1; an end is there if it is as near as ends are
    promised."""
    from wavesweep.engine._stability.crossings import SLIVER

    nothing = SLIVER * (span[1] - span[0])
    changes = {}
    for end in ("low", "high"):
        value = getattr(intervals, end)
        omega = getattr(intervals, f"{end}_omega")
        at_zero = np.abs(value) <= nothing
        alone = at_zero & ~(omega > 0)  # another mode may cross there as well
        changes[end] = np.where(at_zero, 0.0, value)
        changes[f"{end}_omega"] = np.where(alone, 0.0, omega)
    return replace(intervals, **changes)
