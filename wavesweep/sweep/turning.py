"""Intervals of built-in controllers beside a spring that hardly anything damps, examined tick by tick.

Such a device may turn by whole circles within a frame, and then the frame has lost the digits that its ends depend on (see
`wavesweep.lifted.rounding.turned`).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wavesweep.analysis.doubt import NONE, ROUNDING
from wavesweep.analysis.intervals import Intervals
from wavesweep.diagram import draw

LOCAL = "dc-lm"  # the controller whose local model is a spring on the device
TURN, DAMPED = 0.5, 1e-3  # rad, and share of its velocity, that the device alone turns and loses in a frame


def examined(found: Intervals, along: str, span, values: Mapping[str, object], walls: Mapping[str, np.ndarray]) -> Intervals:
    """The intervals, in doubt where rounding within the ticks could move them.

    values: of the loops, flat, `(loops,)` or one for all; walls: path -> values, `(loops, walls)`, whose columns they are, the
    walls of a loop one after the other. Only elements are examined at an end of which the device turns by more than TURN in a
    frame and is damped by less than DAMPED.
    """
    if not (np.any(values["operator.stiffness"]) or values["controller.kind"] == LOCAL or along == "operator.stiffness"):
        return found
    size, of_each = next(iter(walls.values())).shape
    flat = {path: np.repeat(each, of_each) if np.ndim(each) else each for path, each in values.items()}
    flat |= {path: np.ravel(each) for path, each in walls.items()}
    period = np.broadcast_to(draw(values).ratio / np.asarray(flat["rates.fast_hz"], float), (size * of_each,))
    some = np.flatnonzero(_hardly_damped(found, along, flat, period))
    if not some.size:
        return found
    from wavesweep.analysis.intervals.shaken import shaken
    from wavesweep.diagram.uneven import Uneven
    from wavesweep.sweep.drawn_loops import drift_of
    from wavesweep.sweep.drawn_task import Along

    drawing = Uneven(values["controller.kind"])
    loops = Along(drawing, along, flat, drift_of(drawing, {**flat, along: 1.0}, flat))
    lost = shaken(found.take(some), span, period, loops.errors)
    doubt = np.zeros(period.size, int)
    np.maximum.at(doubt, found.column[some], np.where(lost, ROUNDING, NONE))
    return replace(found, doubt=np.maximum(found.doubt, doubt[found.column]))


def _hardly_damped(found, along, values, period):
    hardly = np.zeros(found.column.size, bool)
    for end in (found.low, found.high):
        each = {path: value[found.column] if np.ndim(value) else value for path, value in values.items()} | {along: end}
        mass, damping = (each[f"device.{name}"] + each[f"operator.{name}"] for name in ("mass", "damping"))
        spring = each["operator.stiffness"] + (each["local_model.K_LM"] if each["controller.kind"] == LOCAL else 0.0)
        with np.errstate(all="ignore"):
            turn, lost = np.sqrt(np.abs(spring / mass)) * period[found.column], np.abs(damping / mass) * period[found.column]
            hardly |= (turn > TURN) & (lost < DAMPED)
    return hardly
