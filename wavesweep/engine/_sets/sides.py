"""Sides of boxes: numbers, or logarithms of those that change by a factor, see `Side`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wavesweep.engine._sets.enclosed_loop import Side
from wavesweep.engine.loop import Loops

LOGARITHMIC_SIDE = 1.5  # ratio of the ends of a range above which a side is its logarithm


class Sides(tuple[Side, ...]):
    """The sides of a box of numbers, in their order."""

    __slots__ = ()

    @staticmethod
    def of(loops: Loops, paths: Sequence[str], ends: np.ndarray, *, swept: bool = False) -> Sides:
        """Return the sides of numbers of loops from `ends[0]` to `ends[1]`, `(2, numbers)`.

        swept: whether the first number is one along which intervals are; above 0 its side is a
        logarithm wherever it is wide.
        """
        sides = [_side_of(loops, path, pair) for path, pair in zip(paths, ends.T, strict=True)]
        if swept and 0 < ends[0, 0] < ends[1, 0] / LOGARITHMIC_SIDE:
            sides[0] = Side(paths[0], 0.0)
        return Sides(sides)

    def places(self, numbers: np.ndarray) -> np.ndarray:
        """Return the places of numbers `(..., sides)`."""
        if self:
            return np.stack(
                [side.place(numbers[..., index]) for index, side in enumerate(self)], -1
            )
        return np.array(numbers)

    def numbers(self, places: np.ndarray) -> np.ndarray:
        """Return the numbers at places `(..., sides)`."""
        if self:
            return np.stack(
                [side.number(places[..., index]) for index, side in enumerate(self)], -1
            )
        return np.array(places)


def _side_of(loops: Loops, path: str, ends: tuple[float, float]) -> Side:
    """The side of a range: a logarithm if it is wide beside how near it comes to where the loop
    is not analytic."""
    low, high = ends
    least, greatest = loops.domain(path, (low, high))
    # The side of a number that may as well be 0 is logarithmic from a decade on.
    if low > 0 and high > 10.0 * low:
        least = max(least, 0.0)
    if not (np.isfinite(least) and high - least > LOGARITHMIC_SIDE * (low - least) > 0):
        return Side(path)
    near_end = np.isfinite(greatest) and greatest - low > LOGARITHMIC_SIDE * (greatest - high) > 0
    return Side(path, least, greatest if near_end else np.inf)
