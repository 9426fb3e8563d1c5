"""What holds up a proof over a box where its budget ends."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.engine.sets import Side, as_numbers
from wavesweep.for_all.ranges import Covering

INWARD = 1e-12  # of an end, or of a side, by which an end stays within what is proved


@dataclass(frozen=True, slots=True, eq=False)
class LeftOpen:
    """What holds a proof up where its budget ends.

    paths: of the numbers of its sides, in their order. ends: of the box around it `(2, sides)`, as
    numbers. share: of all values of the numbers but the first that it has.
    """

    paths: tuple[str, ...]
    ends: np.ndarray
    share: float


def left_open(
    found: Covering, sides: Sequence[Side], whole: np.ndarray, *, up: bool
) -> LeftOpen | None:
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
    ends = as_numbers(np.array([cells[:, 0].min(0), cells[:, 1].max(0)]), sides)
    return LeftOpen(tuple(side.path for side in sides), ends, float(shares.sum()))
