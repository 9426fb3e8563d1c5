"""A required region of eigenvalues that is no circle, such as that of a damping ratio, by a search
of its own.

Applies if the bound has one. It proves where the eigenvalues are in that region; a bound on their
size is found beside it by the other methods, and both hold where the intervals have values in
common.
"""

from dataclasses import replace

import numpy as np

from wavesweep.engine._search.question import Question, RequiredRegion, Rest, Slices
from wavesweep.engine._stability.intervals import Intervals, common, in_place
from wavesweep.engine.rows import different

# of the stable values, by which they are exceeded: an end that is one of the region too is found
# with its frequency
BESIDE_STABLE = 1e-3


def applies(question: Question, slices: Slices) -> bool:  # noqa: ARG001
    """Whether the bound has a search of its own."""
    return bool(question.bound and question.bound.cost)


def find(question: Question, slices: Slices, rest: Rest) -> Intervals:
    """The intervals in which every eigenvalue is in the region, looked for where the loops may be
    stable if all of it is inside the circle."""
    bound: RequiredRegion = question.bound  # type: ignore[assignment]  # else it does not apply
    if bound.on_circle:
        inside = _in_region(bound, question, slices)
    else:
        inside = rest(replace(question, bound=None, prover=None), slices)
        open_ = np.isfinite(inside.low)
        if open_.any():
            low = inside.low[open_].min()
            high = inside.high[open_].max()
            beside = BESIDE_STABLE * (high - low)
            span = max(low - beside, question.span[0]), min(high + beside, question.span[1])
            columns = different(inside.column[open_])
            some = Slices(slices.loops.some(columns), columns.size)
            inside = in_place(
                inside, columns, _in_region(bound, replace(question, span=span), some)
            )
    if bound.on_radius:
        return common([inside, rest(replace(question, bound=bound.on_radius), slices)])
    return inside


def _in_region(bound: RequiredRegion, question: Question, slices: Slices) -> Intervals:
    """The intervals in which every eigenvalue is in the region, by its own search."""
    from wavesweep.engine._search.frames_along import FramesAlong, in_own_time

    frames = FramesAlong.of(question, slices.loops, slices.size)
    intervals = bound.intervals(frames, question.span)
    return in_own_time(intervals, slices.loops, question.along)
