"""What holds up a proof over a box where its budget ends."""

import numpy as np

from wavesweep.engine._sets.sides import Sides
from wavesweep.engine._switched.boxes import Covering
from wavesweep.engine._switched.brackets import LeftOpen

INWARD = 1e-12  # of an end, or of a side, by which an end stays within what is proved


def left_open(covering: Covering, sides: Sides, whole: np.ndarray, *, up: bool) -> LeftOpen | None:
    """Return what holds a proof up on its way along the first of its sides; None if nothing does.

    whole: the box of the proof, `(2, sides)`.
    """
    if not covering.open:
        return None
    cells = np.array(covering.open)
    cells = cells[cells[:, 0 if up else 1, 0] == covering.end]
    other_sides = whole[:, 1:]
    wide = other_sides[0] < other_sides[1]
    widths = (cells[:, 1, 1:] - cells[:, 0, 1:])[:, wide]
    shares = (widths / (other_sides[1] - other_sides[0])[wide]).prod(1)
    ends = sides.numbers(np.array([cells[:, 0].min(0), cells[:, 1].max(0)]))
    return LeftOpen(tuple(side.path for side in sides), ends, float(shares.sum()))
