"""Sides of boxes: numbers, or logarithms of those that change by a factor, see `Side`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.engine.drawing import Drawing
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import Side
from wavesweep.for_all.ranges import Covering

INWARD = 1e-12  # of an end, or of a side, by which an end stays within what is proved
LOGARITHMIC_SIDE = 1.5  # ratio of the ends of a range above which a side is its logarithm


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


def side_of(
    drawing: Drawing, values: Mapping[str, object], path: str, ends: tuple[float, float]
) -> Side:
    """Return the side of a range: a logarithm if it is wide beside how near it comes to where
    the loop is not analytic."""
    low, high = ends
    least, most = Loops(drawing, values).domain(path, (low, high))
    # The side of a number that may as well be 0 is logarithmic from a decade on.
    if low > 0 and high > 10.0 * low:
        least = max(least, 0.0)
    if not (np.isfinite(least) and high - least > LOGARITHMIC_SIDE * (low - least) > 0):
        return Side(path)
    return Side(
        path,
        least,
        most if np.isfinite(most) and most - low > LOGARITHMIC_SIDE * (most - high) > 0 else np.inf,
    )


def as_sides(numbers: np.ndarray, sides: Sequence[Side]) -> np.ndarray:
    """Return places of sides at numbers `(..., sides)`."""
    if sides:
        return np.stack([side.place(numbers[..., at]) for at, side in enumerate(sides)], -1)
    return np.array(numbers)


def as_numbers(places: np.ndarray, sides: Sequence[Side]) -> np.ndarray:
    """Return the numbers at places of sides `(..., sides)`."""
    if sides:
        return np.stack([side.number(places[..., at]) for at, side in enumerate(sides)], -1)
    return np.array(places)
