"""Families of matrices that a loop may apply one after the other, and that depend on one number."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

ROUNDING = 4 * np.finfo(float).eps  # of the terms of a sum of two products


class Family(Protocol):
    """Matrices `(symbols, n, n)`, one for each kind of frame, that depend on one number x.

    follows: which kind may come after which, `(symbols, symbols)`: `follows[i, j]` if j may come after i.
    """

    follows: np.ndarray

    def at(self, x: float) -> np.ndarray:
        """Return the matrices at x in doubles, as the search needs them, `(symbols, n, n)`."""

    def enclosed(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the matrices at x less identity, and bounds on the errors of their entries."""

    def hull(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Return matrices less identity, `(points, symbols, n, n)`, and bounds on the errors of their entries.

        The matrices of every number from low to high are within the bounds of the convex hull of the points. None if there are
        no such points, as beside a pole.
        """


@dataclass(frozen=True, slots=True, eq=False)
class Affine:
    """Matrices `constant + x slope`, as they stand; constant, slope: `(symbols, n, n)`; follows: see `Family`."""

    constant: np.ndarray
    slope: np.ndarray
    follows: np.ndarray

    @staticmethod
    def of(constant, slope=None, follows=None) -> "Affine":
        """Return the family; by default x changes nothing, and every matrix may come after every other one."""
        constant = np.asarray(constant, float)
        slope = np.zeros_like(constant) if slope is None else np.asarray(slope, float)
        return Affine(constant, slope, np.ones((len(constant),) * 2, bool) if follows is None else np.asarray(follows, bool))

    def at(self, x: float) -> np.ndarray:
        """See `Family`."""
        return self.constant + x * self.slope

    def enclosed(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """See `Family`."""
        eye = np.eye(self.constant.shape[-1])
        return self.at(x) - eye, ROUNDING * (np.abs(self.constant) + np.abs(x * self.slope) + eye)

    def hull(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
        """See `Family`."""
        return tuple(map(np.stack, zip(self.enclosed(low), self.enclosed(high), strict=True)))
