"""Pieces of a range, where the number is a time that loops are built with: dead times of other
whole ticks are other loops.

Applies if the number is in the timing of the drawing. Within a piece the loops are built alike, so
that what is proved of each piece holds up to both of its ends, and the pieces cover the range.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from wavesweep.engine._drawing.drawing import name_of
from wavesweep.engine._search.interval_records import RECORD, records_of
from wavesweep.engine._search.question import Question, Rest, Slices
from wavesweep.engine._stability.intervals import Intervals, by_slice, joined, without_seams
from wavesweep.engine.loop import Loops
from wavesweep.engine.rows import distinct_rows

LEAST_WORK = 1000  # of a piece of a range, in squares of states: some 60 ms


def applies(question: Question, slices: Slices) -> bool:
    """Whether loops are built in another way at other values of the number."""
    return question.number in slices.loops.drawing.timing


def find(question: Question, slices: Slices, rest: Rest) -> Intervals:
    """The intervals of all pieces, those that meet as one."""
    loops = slices.loops
    times = {}
    for path, values in loops.values.items():
        if np.ndim(values) and name_of(path) in loops.drawing.timing:
            times[path] = values
    first, label = distinct_rows(times, slices.size)
    batches = []
    for number, place in enumerate(first.tolist()):
        columns = np.flatnonzero(label == number)
        alike = loops.some(columns)
        loop = loops.some(place)
        pieces = []
        for piece in pairwise(loop.breaks(question.along, question.span)):
            pieces.append(_in_piece(question, piece, alike, loop, columns.size, rest))
        intervals = without_seams(joined(pieces))
        batches.append(replace(intervals, column=columns[intervals.column]))
    return by_slice(batches)


def about(
    question: Question, loop: Loops, value: float, work: float, rest: Rest
) -> tuple[np.ndarray, tuple[float, float]]:
    """The intervals of a single loop about a value of the number as records, and the part of the
    range that was searched.

    It grows piece by piece, the nearest first, until the interval of the value has both of its
    ends, or the work is spent: a piece with n states takes LEAST_WORK + n n. It is counted, so that
    the result does not depend on the machine.
    """
    ends = loop.breaks(question.along, question.span)
    place = min(max(int(np.searchsorted(ends, value)) - 1, 0), len(ends) - 2)
    first = place
    last = place + 1
    pieces = []
    while True:
        piece = ends[place], ends[place + 1]
        pieces.append(_in_piece(question, piece, loop, loop, 1, rest))
        built = loop.changed(_built(question, piece, loop))
        work -= LEAST_WORK + len(built.drift_of_frames().states) ** 2
        records = records_of(without_seams(joined(pieces)), RECORD)
        inside = records[(records["low"] <= value) & (value <= records["high"])]
        low = np.fmin(inside["low"], inside["open_low"])
        high = np.fmax(inside["high"], inside["open_high"])
        below = np.inf  # distances of the value from the pieces that the interval may go on in
        above = np.inf
        if first > 0 and (low == ends[first]).all():
            below = value - ends[first - 1]
        if last + 1 < len(ends) and (high == ends[last]).all():
            above = ends[last + 1] - value
        if np.isinf(min(below, above)) or work < 0:
            return records, (ends[first], ends[last])
        place = first - 1 if below < above else last
        first = min(first, place)
        last = max(last, place + 1)


def _in_piece(
    question: Question,
    piece: tuple[float, float],
    loops: Loops,
    loop: Loops,
    size: int,
    rest: Callable[..., Any],
) -> Intervals:
    """The intervals in a piece of the range in which the loops are built as one of them is."""
    built = loops.changed(_built(question, piece, loop))
    return rest(replace(question, span=piece), Slices(built, size))


def _built(question: Question, piece: tuple[float, float], loop: Loops) -> dict[str, int]:
    """The whole numbers of ticks that the loop is built with in a piece of the range."""
    middle = loop.changed({question.along: sum(piece) / 2})
    return {path: int(ticks) for path, ticks in middle.building().items()}
