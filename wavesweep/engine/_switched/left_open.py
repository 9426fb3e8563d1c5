"""What holds up a proof over a box where its budget ends."""

import numpy as np

from wavesweep.engine._sets.sides import Sides
from wavesweep.engine._switched.boxes import Covering
from wavesweep.engine._switched.brackets import LeftOpen

INWARD = 1e-12  # of an end, or of a side, by which an end stays within what is proved


def left_open(found: Covering, sides: Sides, whole: np.ndarray, *, up: bool) -> LeftOpen | None:
    """Return what holds a proof up on its way along the first of its sides; None if nothing does.

    whole: the box of the proof, `(2, sides)`.
    """
    if not found.open:
        return None
    cells = np.array(found.open)
    cells = cells[cells[:, 0 if up else 1, 0] == found.end]
    others = whole[:, 1:]
    wide = others[0] < others[1]
    widths = (cells[:, 1, 1:] - cells[:, 0, 1:])[:, wide]
    shares = (widths / (others[1] - others[0])[wide]).prod(1)
    ends = sides.numbers(np.array([cells[:, 0].min(0), cells[:, 1].max(0)]))
    return LeftOpen(tuple(side.path for side in sides), ends, float(shares.sum()))
