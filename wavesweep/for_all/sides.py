"""Sides of boxes: numbers, or logarithms of those that change by a factor, see `Side`."""

from collections.abc import Mapping, Sequence

import numpy as np

from wavesweep.engine.drawing.drawing import Drawing
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets.enclosed_loop import Side

WIDE = 1.5  # ratio of the ends of a range above which a side is its logarithm
DECADE = 10.0  # the same for a number that may as well be 0


def side_of(drawing: Drawing, values: Mapping[str, object], path: str, ends: tuple[float, float]) -> Side:
    """Return the side of a range: a logarithm if it is wide beside how near it comes to where the loop is not analytic."""
    low, high = ends
    least, most = Loops(drawing, values).domain(path, (low, high))
    if low > 0 and high > DECADE * low:
        least = max(least, 0.0)
    if not (np.isfinite(least) and high - least > WIDE * (low - least) > 0):
        return Side(path)
    return Side(path, least, most if np.isfinite(most) and most - low > WIDE * (most - high) > 0 else np.inf)


def as_sides(numbers: np.ndarray, sides: Sequence[Side]) -> np.ndarray:
    """Return places of sides at numbers `(..., sides)`."""
    return np.stack([side.place(numbers[..., at]) for at, side in enumerate(sides)], -1) if sides else np.array(numbers)


def as_numbers(places: np.ndarray, sides: Sequence[Side]) -> np.ndarray:
    """Return the numbers at places of sides `(..., sides)`."""
    return np.stack([side.number(places[..., at]) for at, side in enumerate(sides)], -1) if sides else np.array(places)
