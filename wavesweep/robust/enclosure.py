"""Matrices that depend on a number, enclosed over an interval of it: a polynomial of second degree with a bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Enclosure:
    """Matrices within `rest` of `centre + s slope + s^2 curve`, s from -1 to 1, `(n, n)` each; rest at least 0.

    Sums and products enclose those of every two matrices at the same s: a Taylor model of second order (M. Berz, K. Makino,
    Verified integration of ODEs and flows using differential algebraic methods on high-order Taylor models, Reliable Computing
    4, 361-369, 1998).
    Accuracy: rounding of the sums is not enclosed; a proof has to leave room for it.
    """

    centre: np.ndarray
    slope: np.ndarray
    curve: np.ndarray
    rest: np.ndarray

    def __add__(self, other: Enclosure) -> Enclosure:
        return Enclosure(self.centre + other.centre, self.slope + other.slope, self.curve + other.curve, self.rest + other.rest)

    def __matmul__(self, other: Enclosure) -> Enclosure:
        (x0, x1, x2), (y0, y1, y2) = ((each.centre, each.slope, each.curve) for each in (self, other))
        size, others = (sum(map(np.abs, parts)) for parts in ((x0, x1, x2), (y0, y1, y2)))
        rest = size @ other.rest + self.rest @ (others + other.rest)
        rest = rest + np.abs(x1) @ np.abs(y2) + np.abs(x2) @ (np.abs(y1) + np.abs(y2))
        return Enclosure(x0 @ y0, x0 @ y1 + x1 @ y0, x0 @ y2 + x1 @ y1 + x2 @ y0, rest)
