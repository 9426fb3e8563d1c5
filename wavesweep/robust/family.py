"""Families of matrices that a loop may apply one after the other, and that depend on one number."""

from typing import Protocol

import numpy as np


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
