"""What is said of a log that does not tell the mass: whether its columns are of other rows, and
which piece of it does."""

from dataclasses import replace

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.identification.log import Log
from wavesweep.identification.model import Model
from wavesweep.identification.prediction.fitting import predicted, refuse_friction_below_zero
from wavesweep.identification.prediction.search import FEWEST, MOST
from wavesweep.program.csv_files import seconds

ROWS_SHIFTED = 3000  # rows with which a column is shifted
SHORTEST_PIECE = 200  # rows of a piece at least


def help_for(model: Model, log: Log, resolution: float) -> str:
    """What would help to know the mass, as the end of a message; empty if nothing is found.

    resolution: step of the readings.
    """
    return _other_rows(model, log, resolution) or _piece(model, log, resolution)


def _other_rows(model, log, resolution):
    """Whether the log tells the mass if one column is shifted, by more rows than a delay may
    have."""
    if model.delay is not None:
        return ""
    reach = int(MOST - FEWEST)
    log = replace(log, force=log.force[:ROWS_SHIFTED], reading=log.reading[:ROWS_SHIFTED])
    # A column is shifted to four times the range of delays, either way.
    shifts = range(reach // 2, 4 * reach, reach // 2)
    for shift in (*shifts, *(-rows for rows in shifts)):
        force = log.force
        reading = log.reading
        if shift < 0:
            force = force[:shift]
            reading = reading[-shift:]
        else:
            force = force[shift:]
            reading = reading[:-shift]
        if len(force) < SHORTEST_PIECE:
            continue
        prediction = _known(model, replace(log, force=force, reading=reading), resolution)
        if prediction is not None:
            late = prediction.numbers["delay"] - shift
            side = "behind" if late > 0 else "ahead of"
            return f"; the reading seems to be {abs(late):.0f} rows {side} its force: are the two columns of the same time?"
    return ""


def _piece(model, log, resolution):
    """The piece of the log that tells the mass best, the longest first."""
    rows = len(log.force)
    for count in (2, 4, 8):  # equal pieces of a log
        length = rows // count
        if length < SHORTEST_PIECE:
            break
        best = np.inf, ""
        for first in range(0, length * count, length):
            part = replace(
                log,
                force=log.force[first : first + length],
                reading=log.reading[first : first + length],
            )
            prediction = _known(model, part, resolution)
            if prediction is not None and prediction.half[0] < best[0]:
                begins, ends = (log.start + log.period * row for row in (first, first + length - 1))
                low = np.exp(prediction.theta[0] - prediction.half[0])
                high = np.exp(prediction.theta[0] + prediction.half[0])
                said = f"; the piece from {seconds(begins)} to {seconds(ends)} s alone gives {low:.3g} to {high:.3g}: cut it out"
                best = prediction.half[0], said
        if best[1]:
            return best[1]
    return ""


def _known(model, log, resolution):
    """The fit by predictions, if it knows the mass.

    Of many pieces one seems to know it by chance: with a delay that is anything, or a negative
    damping.
    """
    if np.ptp(log.reading) < 3 * resolution or not np.ptp(log.force):
        return None
    try:
        prediction = predicted(
            model, log.force, log.reading - log.reading[0], log.period, resolution
        )
        refuse_friction_below_zero(prediction)
    except (UsageError, np.linalg.LinAlgError):
        return None
    half = dict(zip(prediction.model.names, prediction.half, strict=True))
    knows_delay = half.get("delay", 0.0) < 1.0  # half the width of its interval (ticks)
    with_damping = prediction.numbers["damping"] + half["damping"] > 0
    # The highest over the lowest mass of a piece that helps.
    if 2 * half["log_mass"] < np.log(1.2) and knows_delay and with_damping:
        return prediction
    return None
