"""The stiffness that a hand feels at rest: of loops, and at the ends of their stable intervals."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from wavesweep.engine.blocks import (
    FACTOR,
    PRODUCT,
    MultirateLoop,
    Ports,
)
from wavesweep.engine.drawing import Drawing, name_of
from wavesweep.engine.errors import IllPosedLoopError, UsageError
from wavesweep.engine.frames import Opened, by_zeros
from wavesweep.engine.intervals import AtPort, Question, record_type
from wavesweep.engine.loop import Loops
from wavesweep.haptics.resting import DcGain, frame_dcgain, shows_at_rest, tick_dcgain

FELT = ("felt_low", "felt_high")
RECORD = record_type(*((name, "<f8") for name in FELT))
"""Records of intervals with the stiffness that is felt at their ends."""
# of an end, how far from it is looked where a mode has the frame's own period there
BESIDE_END = 1e-4


def feels(drawing: Drawing) -> bool:
    """Whether a loop has a hand that may feel a wall."""
    return bool(drawing.hand and drawing.wall)


def felt_of(loops: Loops, size: int) -> np.ndarray:
    """The stiffness (N/m) that the hand feels at rest in each of `size` loops, `(size,)`; NaN
    where it is not known."""
    felt = np.full(size, np.nan)
    try:
        _fill_felt(felt, loops)
    except UsageError:  # no plant has the position of the port
        return felt
    except IllPosedLoopError:
        if size == 1:
            return felt
        arrays = {
            path: np.broadcast_to(v, (size,)) for path, v in loops.values.items() if np.ndim(v)
        }
        loops = loops.changed(arrays)
        return np.concatenate([felt_of(loops.some([index]), 1) for index in range(size)])
    return felt


def dcgain_of(loops: Loops) -> DcGain | None:
    """Loops at rest, whichever blocks run in a tick; None if something drifts at the hand, or a tick
    in which all blocks run is not known."""
    drift = loops.drift_at_hand()
    if not (drift.constant or drift.varying):
        with suppress(
            IllPosedLoopError
        ):  # of direct terms through blocks that need not run together
            return tick_dcgain(loops.drawn(), Ports.of_hand(loops.drawing))
    return None


def _fill_felt(felt, loops):
    """Write what is known of `felt_of` into the array."""
    size = felt.size
    at_rest = dcgain_of(loops)
    if at_rest:
        felt[:] = at_rest.stiffness(np.arange(size), np.zeros(size))
    unknown = np.flatnonzero(np.isnan(felt))
    if not unknown.size:
        return
    from wavesweep.engine.response import Lifted, ports_by_rate, static_response

    for members, port in ports_by_rate(loops.some(unknown), unknown.size):
        response = static_response(Lifted.of(port))
        # The relative error up to which a stiffness counts as known.
        stiffness = np.where(response.impedance_error <= 1e-6, response.impedance.real, np.nan)
        felt[unknown[members]] = stiffness
        if size > 1 and port.rest().going:  # one may stand still where those about it go on
            for index in unknown[members][np.isnan(stiffness)].tolist():
                felt[index] = felt_of(loops.some([index]), 1)[0]


def hand_in_frame(
    drawn: MultirateLoop, drawing: Drawing, numbers: tuple[str, ...], read: tuple[str, ...]
) -> Ports | None:
    """The hand, if its loops may feel a wall, and a frame without the numbers shows the force
    against it; see `FindPort`."""
    if not feels(drawing) or any(drawing.seen_by_hand(number) for number in numbers):
        return None
    hand = Ports.of_hand(drawing)
    if shows_at_rest(drawn, hand, read):
        return hand
    return None


def stiffness_at_ends(
    question: Question, loops: Loops, opened: Opened | None, place, p, omega
) -> np.ndarray:
    """The stiffness (N/m) felt at both ends of intervals, `(2, n)`; see `lines_at_ends`."""
    if not feels(loops.drawing):
        return np.full(p.shape, np.nan)
    felt = _known_at_ends(question, loops, opened, place, p)
    unknown = np.flatnonzero(np.isnan(felt).any(0))
    if not unknown.size:
        return felt
    in_pieces = name_of(question.along) in loops.drawing.timing
    at_any_value = loops.at_any_value_of(question.along)
    place = place[unknown]

    def stiffness(rows, values):
        """Of loops that are built as they are at the values, which in pieces of a range is
        another way for each."""
        columns = place[rows]
        if in_pieces:
            batches = np.arange(values.size)[:, None]
        else:
            batches = by_zeros(loops, columns)
        result = np.empty(values.size)
        for alike in batches:
            result[alike] = felt_along(
                at_any_value.some(columns[alike]), question.along, values[alike]
            )
        return result

    felt[:, unknown] = felt_at_ends(p[:, unknown], omega[:, unknown], stiffness)
    return felt


FELT_AT_ENDS = AtPort(FELT, hand_in_frame, stiffness_at_ends)


def felt_along(loops: Loops, path: str, p: np.ndarray) -> np.ndarray:
    """The stiffness (N/m) felt at rest in loops at values p of a number, `(n,)`."""
    return felt_of(loops.changed({path: p}), p.size)


def felt_at_ends(p: np.ndarray, omega: np.ndarray, stiffness: Callable) -> np.ndarray:
    """The stiffness felt at both ends of intervals along a number that is no wall, `(2, n)`.

    stiffness(rows, values): that of the loops of these pairs of ends, at these values of the
    number. A 0 takes a branch out of the loop, so ends at 0 are computed apart. At a crossing of z
    = 1 a frame does not determine the state at rest, since a mode that alternates from tick to tick
    repeats in it; the stiffness is smooth there, and follows from both sides.
    """
    shape, row = p.shape, np.tile(np.arange(p.shape[1]), 2)
    p, omega, felt = p.ravel(), omega.ravel(), np.empty(p.size)
    with np.errstate(all="ignore"):
        for ends in (np.flatnonzero(p == 0), np.flatnonzero(p != 0)):
            if ends.size:
                felt[ends] = stiffness(row[ends], p[ends])
        ends = np.flatnonzero((omega == 0) & (p != 0))
        if ends.size:
            sides = np.multiply.outer(
                [1 - BESIDE_END, 1 + BESIDE_END, 1 - 2 * BESIDE_END, 1 + 2 * BESIDE_END], p[ends]
            )
            moved = stiffness(np.tile(row[ends], 4), sides.ravel()).reshape(4, -1)
            near, far = moved[0] + moved[1], moved[2] + moved[3]
            # The relative difference of two such looks, beyond which nothing is felt that is
            # the same on both sides
            felt[ends] = np.where(
                np.abs(near - far) <= 1e-3 * np.abs(near), (4 * near - far) / 6, np.nan
            )
    return felt.reshape(shape)


def _known_at_ends(question, loops, opened, place, p):
    """The stiffness at both ends of loops whose number is one scalar gain, `(2, n)`; NaN where
    it is not known by that."""
    ends = p.ravel()
    twice = np.tile(place, 2)
    at_rest = opened and _frame_at_rest(opened)
    if not at_rest:
        of_tick = _tick_at_rest(question, loops)
        if of_tick:
            return of_tick.stiffness(twice, ends).reshape(p.shape)
        return np.full(p.shape, np.nan)
    return _of_slices(opened, at_rest, twice, ends).reshape(p.shape)


def _frame_at_rest(opened: Opened) -> DcGain | None:
    """The loops without their number as the hand feels them at rest; None if their frame does
    not show it."""
    loops = opened.loops
    if not loops.port:
        return None
    return loops.remembered(
        "at rest", lambda: frame_dcgain(loops.drawn, loops.port, loops.frame, loops.drift)
    )


def _tick_at_rest(question, loops) -> DcGain | None:
    """The loops at rest from a tick, if the number is one scalar gain of them."""
    if not loops.drawing.scalar_place(question.number) or loops.drawing.seen_by_hand(
        question.number
    ):
        return None
    with suppress(IllPosedLoopError):
        drift = loops.changed({question.along: np.array(question.span)}).drift_at_hand()
        if not (drift.constant or drift.varying):
            drawn = loops.changed({question.along: 1.0}).drawn(question.number)
            return tick_dcgain(drawn, Ports.of_hand(loops.drawing), PRODUCT, FACTOR)
    return None


def _of_slices(opened: Opened, at_rest: DcGain, slices, p) -> np.ndarray:
    """The stiffness that is felt of the slices `slices` if their number is p, `(n,)` all; NaN if the
    frame hides it."""
    second = opened.second[slices]
    first, second_value = (second, p) if opened.swapped else (p, second)
    return at_rest.stiffness(opened.loop_of[slices], first, second_value)
