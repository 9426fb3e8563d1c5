"""What is there at the ends of intervals that are found: the lines of a spectrum, and what is asked
of a port.

These are passes of their own over the ends of the loops of a batch. p: the ends low and high, `(2,
n)`. omega: of the oscillation that starts there (rad/s). place: of the loop of each pair in the
batch, `(n,)`.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from wavesweep.engine._drawing.drawing import name_of
from wavesweep.engine._search.lines_of_loops import lines_in_loops, strongest_in_cut
from wavesweep.engine._search.open_loops import FindPort, Opened
from wavesweep.engine._search.question import Question
from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops


@dataclass(frozen=True, slots=True)
class AtPort:
    """What is computed of a port of loops at the ends of intervals.

    fields: of the records, for the low and the high ends. find_port: see `open_loops`. values: what
    is written there, a function of the arguments of `lines_at_ends`.
    """

    fields: tuple[str, str]
    find_port: FindPort
    values: Callable[..., np.ndarray]


def lines_at_ends(
    question: Question,
    loops: Loops,
    opened: Opened | None,
    place: np.ndarray,
    p: np.ndarray,
    omega: np.ndarray,
) -> np.ndarray:
    """The strongest line (Hz) of the oscillation that starts at each end, `(2, n)`; NaN if none.

    Ends that a gain sets have an omega with a minus. opened: the loops without the number.
    """
    bound = question.bound
    lines = np.full(p.shape, np.nan)
    end, row = np.nonzero(~np.isnan(omega) & ~np.signbit(omega))
    p = p[end, row]
    omega = omega[end, row]
    place = place[row]
    if opened and opened.loops.cut and (bound is None or bound.on_circle):
        lines[end, row] = strongest_in_cut(loops.drawing, opened, place, omega, bound)
        return lines
    strongest = omega / (2 * np.pi)
    few = 1 if name_of(question.along) in loops.drawing.timing else 256  # modes at once
    p = np.where(p == 0, NEXT_TO_ZERO, p)
    for first in range(0, place.size, few):
        batch = slice(first, first + few)
        varied = loops.at_any_value_of(question.along).some(place[batch])
        varied = varied.changed({question.along: p[batch]})
        with suppress(IllPosedLoopError):
            drawn = varied.drawn()
            if drawn.ticks == 1:
                continue
            period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), p[batch].shape)
            s = 1j * (omega[batch] * period)[:, None]
            if bound:
                s = bound.logarithms(period, omega[batch])
            strongest[batch] = lines_in_loops(varied, s)[:, 0]
    lines[end, row] = strongest
    return lines
