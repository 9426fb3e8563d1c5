"""A cut at the number, where it is one scalar gain of a frame: the unit circle is searched for
crossings.

Applies if the frame without the number has a cut. All crossings are roots of one real polynomial;
between two of them the number of eigenvalues outside of the circle is counted, and the count is
proved by signs or discs.
"""

from dataclasses import replace

import numpy as np

from wavesweep.engine._monodromy.cut import FIRST, SECOND
from wavesweep.engine._search.open_loops import Opened, by_zeros
from wavesweep.engine._search.question import Question, RequiredRegion, Rest, Slices
from wavesweep.engine._stability.intervals import Intervals, by_slice, in_place
from wavesweep.engine._stability.stable import stable_intervals
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.rows import different


def applies(question: Question, slices: Slices) -> bool:  # noqa: ARG001
    """Whether the loops are known without the number, and can be cut there."""
    return slices.opened is not None and slices.opened.loops.cut is not None


def find(question: Question, slices: Slices, rest: Rest) -> Intervals:
    """The intervals from cuts.

    Slices in doubt are cut once more, each as a loop of its own, with its own bounds on rounding in
    place of those of the largest entries of all loops. What stays in doubt, or has no cut then, is
    left to the rest.
    """
    loops = slices.loops
    opened: Opened = slices.opened  # type: ignore[assignment]  # else it does not apply
    intervals = of_cut(opened, question.span, question.bound)
    in_doubt = different(intervals.column[intervals.doubt != Doubt.NONE])
    if not in_doubt.size:
        return intervals
    if opened.alone or slices.size == 1:
        remaining = Slices(loops.some(in_doubt), in_doubt.size)
        return in_place(intervals, in_doubt, rest(question, remaining))
    find_port = question.find_port if opened.loops.port else None
    # A number that is 0 in one of several `Loops` is 0 in all: it may make them drift.
    for alike in by_zeros(loops, in_doubt):
        columns = in_doubt[alike]
        own_loops = loops.some(columns)
        own_cuts = Opened.of_each(own_loops, question.number, columns.size, find_port=find_port)
        alone = Slices(own_loops, columns.size, own_cuts)
        answer = find(question, alone, rest) if applies(question, alone) else rest(question, alone)
        intervals = in_place(intervals, columns, answer)
    return intervals


def of_cut(
    opened: Opened, span: tuple[float, float], bound: RequiredRegion | None = None
) -> Intervals:
    """The intervals of slices whose loops are cut, sorted by slice; loops with equally many
    slices go together."""
    cut = opened.loops.batch(int(opened.loop_of.max()) + 1)
    order = np.argsort(opened.loop_of, kind="stable")
    counts = np.bincount(opened.loop_of)
    starts = np.cumsum(counts) - counts
    batches = []
    for count in different(counts[counts > 0]).tolist():
        alike = np.flatnonzero(counts == count)
        slices = order[starts[alike][:, None] + np.arange(count)]
        loops = cut if alike.size == cut.batch[0] else cut.at(alike)
        radius = bound.radius_of(loops.period) if bound else None
        intervals = stable_intervals(
            loops, SECOND if opened.swapped else FIRST, span, opened.second[slices], radius
        )
        batches.append(replace(intervals, column=slices.reshape(-1)[intervals.column]))
    return by_slice(batches)
