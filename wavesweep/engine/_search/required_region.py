"""A required region of eigenvalues that is no circle, such as that of a damping ratio, by a search
of its own.

Applies if the bound has one. It proves where the eigenvalues are in that region; a bound on their
size is found beside it by the other methods, and both hold where the intervals have values in
common.
"""

from dataclasses import replace

from wavesweep.engine._search.question import Question, Rest, Slices
from wavesweep.engine._stability.intervals import Intervals, common


def applies(question: Question, slices: Slices) -> bool:  # noqa: ARG001
    """Whether the bound has a search of its own."""
    return bool(question.bound and question.bound.cost)


def find(question: Question, slices: Slices, rest: Rest) -> Intervals:
    """The intervals in which every eigenvalue is in the region."""
    from wavesweep.engine._search.frames_along import FramesAlong, in_own_time

    bound, frames = question.bound, FramesAlong.of(question, slices.loops, slices.size)
    inside = bound.intervals(
        frames.frames,
        frames.errors,
        frames.turns,
        slices.loops.drawn().ticks,
        question.span,
        slices.size,
        frames.period,
        frames.bounds,
        frames.resolved,
    )
    inside = in_own_time(inside, slices.loops, question.along)
    return (
        common([inside, rest(replace(question, bound=bound.of_size), slices)])
        if bound.of_size
        else inside
    )
