"""Long dead times in which nothing crosses the unit circle: lines of the circle in place of the many states of a delay.

Applies to pieces of a range in which a loop is built with a long dead time. It proves that no eigenvalue crosses the circle
anywhere in the piece, so that all of it is stable, or none; columns in which that is not proved are left to the rest.
"""

import numpy as np

from wavesweep.engine.search.question import Question, Rest, Slices
from wavesweep.engine.stability.certificate import NONE
from wavesweep.engine.stability.intervals import Intervals, in_place


def applies(question: Question, slices: Slices) -> bool:
    """Whether the span is a piece with a long dead time, and stability alone is asked for."""
    from wavesweep.engine.stability.by_lines import LONG

    if not question.in_piece or question.bound:
        return False
    ticks = (slices.loops.values.get(f"block.{name}.ticks", 0) for name in slices.loops.drawing.dead_times)
    return max(ticks, default=0) >= LONG


def find(question: Question, slices: Slices, rest: Rest) -> Intervals:
    """The intervals of columns without a crossing, with those of the others."""
    from wavesweep.engine.search.frames_along import FramesAlong
    from wavesweep.engine.stability.by_lines import unstable_counts

    loops, span, frames = slices.loops, question.span, FramesAlong.of(question, slices.loops, slices.size)
    counts = unstable_counts(frames.frames, frames.errors, span, slices.size, np.stack(frames.bounds), frames.resolved)
    column, doubtful = np.flatnonzero(counts >= 0), np.flatnonzero(counts < 0)
    stable, nowhere, zero = counts[column] == 0, np.full(column.size, np.nan), np.zeros(column.size, int)
    ends = (np.where(stable, end, np.nan) for end in span)
    intervals = Intervals(column, stable - 1, 1 * stable, *ends, nowhere, nowhere, zero + NONE, 0.0 * zero)
    if not doubtful.size:
        return intervals
    return in_place(intervals, doubtful, rest(question, Slices(loops.some(doubtful), doubtful.size)))
