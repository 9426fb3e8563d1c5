"""Frames of a loop at values of a parameter, and whether they are analytic in it."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.rows import Rows

STEEPEST = np.pi / 2  # turn between two points of a rim, beyond which it may be another turn


@dataclass(frozen=True, slots=True)
class Frames(Rows):
    """Frames at values of a parameter. E: `(n, order, order)`, less identity. pivot: `(n,)`, analytic in the parameter and zero
    where an algebraic loop has no solution, so that the frame has a pole there. condition: `(n,)`, see `Block`.
    """

    E: np.ndarray
    pivot: np.ndarray
    condition: np.ndarray

    @staticmethod
    def of(found) -> "Frames":
        """The same, or matrices without algebraic loops."""
        return found if isinstance(found, Frames) else Frames(found, *np.ones((2, len(found))))


def pole_inside(pivot) -> np.ndarray:
    """Whether a frame may have a pole inside of a rim; pivot: `(rims, points)` at points of its upper half, in their order.

    A pole of small weight leaves no trace in samples about it, but the pivot has a zero there, and by the argument principle it
    turns once about 0 along the rim. What lies on the lower half are the conjugates.
    """
    around = np.concatenate([pivot, np.conj(pivot[:, ::-1]), pivot[:, :1]], axis=-1)
    with np.errstate(all="ignore"):
        turns = np.angle(around[:, 1:] / around[:, :-1])
        return ~((np.abs(turns) < STEEPEST).all(-1) & (np.abs(turns.sum(-1)) < 1))
