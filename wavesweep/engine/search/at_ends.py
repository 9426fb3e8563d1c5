"""What is there at the ends of intervals that are found: the stiffness that a hand feels, and the lines of a spectrum.

This is a pass of its own over the ends of the loops of a batch. p: the ends low and high, `(2, n)`. omega: of the oscillation
that starts there (rad/s). place: of the loop of each pair in the batch, `(n,)`.
"""

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from wavesweep.engine.drawing.drawing import name_of
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops
from wavesweep.engine.loops.dead_time import timing
from wavesweep.engine.loops.from_drawing import FACTOR, PRODUCT, scalar_place, seen_by_hand
from wavesweep.engine.loops.ports import hand_of
from wavesweep.engine.rows import different
from wavesweep.engine.search.lines_of_loops import lines_in_loops, strongest_in_cut
from wavesweep.engine.search.open_loops import TINY, Opened, by_zeros
from wavesweep.engine.search.question import Question

BATCH = 256  # modes that are followed through their frames at once
BESIDE = 1e-4  # of an end, how far from it is looked where a mode has the frame's own period there
AGREED = 1e-3  # relative difference of two such looks, beyond which nothing is felt that is the same on both sides


def stiffness_at_ends(question: Question, loops: Loops, opened: Opened | None, place, p, omega) -> np.ndarray:
    """The stiffness (N/m) felt at both ends of intervals, `(2, n)`; opened: the loops without the number."""
    at_rest = opened if opened and opened.loops.at_rest else _dcgain(question, loops)
    felt, unknown = np.empty(p.shape), np.arange(place.size)
    if at_rest is not None:
        ends, twice = p.ravel(), np.tile(place, 2)
        both = at_rest.stiffness(twice, ends)
        hidden = np.flatnonzero(np.isnan(both) & ~np.isnan(ends))
        if hidden.size and at_rest is opened and opened.loops.second:
            columns = different(twice[hidden])
            for alike in by_zeros(loops, columns):
                few = columns[alike]
                alone = Opened.of_each(loops.some(few), question.number, few.size, felt=True)
                if alone and alone.loops.at_rest:
                    rows = hidden[np.isin(twice[hidden], few)]
                    both[rows] = alone.stiffness(np.searchsorted(few, twice[rows]), ends[rows])
        felt = both.reshape(p.shape)
        unknown = np.flatnonzero(np.isnan(felt).any(0))
    if not unknown.size:
        return felt
    in_pieces, place = name_of(question.along) in timing(loops.drawing), place[unknown]

    def stiffness(rows, values):
        """Of loops that are built as they are at the values, which in pieces of a range is another way for each."""
        result, columns, buildable = np.empty(values.size), place[rows], _buildable(loops, question.along)
        for alike in np.arange(values.size)[:, None] if in_pieces else by_zeros(loops, columns):
            result[alike] = felt_along(buildable.some(columns[alike]), question.along, values[alike])
        return result

    felt[:, unknown] = felt_at_ends(p[:, unknown], omega[:, unknown], stiffness)
    return felt


def felt_at_ends(p: np.ndarray, omega: np.ndarray, stiffness: Callable) -> np.ndarray:
    """The stiffness felt at both ends of intervals along a number that is no wall, `(2, n)`.

    stiffness(rows, values): that of the loops of these pairs of ends, at these values of the number. A 0 takes a branch out of
    the loop, so ends at 0 are computed apart. At a crossing of z = 1 a frame does not determine the state at rest, since a mode
    that alternates from tick to tick repeats in it; the stiffness is smooth there, and follows from both sides.
    """
    shape, row = p.shape, np.tile(np.arange(p.shape[1]), 2)
    p, omega, felt = p.ravel(), omega.ravel(), np.empty(p.size)
    with np.errstate(all="ignore"):
        for ends in (np.flatnonzero(p == 0), np.flatnonzero(p != 0)):
            if ends.size:
                felt[ends] = stiffness(row[ends], p[ends])
        ends = np.flatnonzero((omega == 0) & (p != 0))
        if ends.size:
            sides = np.multiply.outer([1 - BESIDE, 1 + BESIDE, 1 - 2 * BESIDE, 1 + 2 * BESIDE], p[ends])
            moved = stiffness(np.tile(row[ends], 4), sides.ravel()).reshape(4, -1)
            near, far = moved[0] + moved[1], moved[2] + moved[3]
            felt[ends] = np.where(np.abs(near - far) <= AGREED * np.abs(near), (4 * near - far) / 6, np.nan)
    return felt.reshape(shape)


def felt_along(loops: Loops, along: str, p: np.ndarray) -> np.ndarray:
    """The stiffness (N/m) felt at rest in loops at values p of a number, `(n,)`."""
    from wavesweep.engine.response.at_hand import felt_of

    return felt_of(loops.changed({along: p}), p.size)


def _dcgain(question, loops):
    """The loops at rest, if the number is one scalar gain of them."""
    if not scalar_place(loops.drawing, question.number) or seen_by_hand(loops.drawing, question.number):
        return None
    with suppress(IllPosedLoopError):
        drift = loops.changed({question.along: np.array(question.span)}).drift_at_hand()
        if not (drift.constant or drift.varying):
            from wavesweep.engine.response.resting import tick_dcgain

            drawn = loops.changed({question.along: 1.0}).drawn(question.number)
            return tick_dcgain(drawn, hand_of(loops.drawing), PRODUCT, FACTOR)
    return None


def _buildable(loops, along):
    """The loops at any value of the number: without the whole numbers of ticks of dead times, which follow from it."""
    building = loops.drawing.building if name_of(along) in timing(loops.drawing) else ()
    return Loops(loops.drawing, {path: v for path, v in loops.values.items() if path not in building})


def lines_at_ends(question: Question, loops: Loops, opened: Opened | None, place, p, omega) -> np.ndarray:
    """The strongest line (Hz) of the oscillation that starts at each end, `(2, n)`; NaN where no mode starts.

    Ends that a gain sets have an omega with a minus. opened: the loops without the number.
    """
    bound, lines = question.bound, np.full(p.shape, np.nan)
    end, row = np.nonzero(~np.isnan(omega) & ~np.signbit(omega))
    p, omega, place = p[end, row], omega[end, row], place[row]
    if opened and opened.loops.cut and (bound is None or bound.on_circle):
        lines[end, row] = strongest_in_cut(loops.drawing, opened, place, omega, bound)
        return lines
    strongest, few = omega / (2 * np.pi), 1 if name_of(question.along) in timing(loops.drawing) else BATCH
    for batch in (slice(first, first + few) for first in range(0, place.size, few)):
        varied = _buildable(loops, question.along).some(place[batch])
        varied = varied.changed({question.along: np.where(p[batch] == 0, TINY, p[batch])})
        with suppress(IllPosedLoopError):
            drawn = varied.drawn()
            period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), p[batch].shape)
            if drawn.ticks > 1:
                s = bound.logarithms(period, omega[batch]) if bound else 1j * (omega[batch] * period)[:, None]
                strongest[batch] = lines_in_loops(varied, s)[:, 0]
    lines[end, row] = strongest
    return lines
