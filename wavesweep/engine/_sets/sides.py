"""Sides of boxes: numbers, or logarithms of those that change by a factor, see `Side`."""

from collections.abc import Mapping, Sequence

import numpy as np

from wavesweep.engine._drawing.drawing import Drawing
from wavesweep.engine._sets.enclosed_loop import Side
from wavesweep.engine.loop import Loops

LOGARITHMIC_SIDE = 1.5  # ratio of the ends of a range above which a side is its logarithm


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
