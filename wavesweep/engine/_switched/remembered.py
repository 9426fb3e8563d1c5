"""What frames forget: the directions of the states that every frame of a family sets to zero are
divided out of searches."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from wavesweep.engine._switched.graph import Family
from wavesweep.engine._switched.norm_check import Norms, shrink_along
from wavesweep.engine._switched.norms import Centre, rough_basis
from wavesweep.engine.doubles import NEXT_TO_ZERO

# of the largest singular value, below which a direction counts as one that is set to zero
FORGOTTEN = 1e-12
SLACK_SHARE = 0.1  # of the slack of norms that the directions which are forgotten may take


@dataclass(frozen=True, slots=True, eq=False)
class Remembered:
    """A family for searches: its matrices act on what is remembered of the states, `z = to x` with
    `x = back z`.

    family: the whole, which proofs are about: `enclosed` and `hull` are its own. forgotten: `(n -
    q, n)`, the states that are left out, `w = forgotten x`. Every matrix takes the states with z =
    0 to zero, so products have the same eigenvalues otherwise.
    """

    family: Family
    to: np.ndarray
    back: np.ndarray
    forgotten: np.ndarray

    @staticmethod
    def of(family: Family, numbers: Iterable[float]) -> Remembered:
        """Return the family without what its matrices set to zero at some numbers."""
        A = np.concatenate([family.at(x) for x in numbers])
        basis, inverse = rough_basis(A)
        _, size, turned = np.linalg.svd(
            (inverse @ A @ basis).reshape(-1, A.shape[-1]), full_matrices=False
        )
        observed = size > FORGOTTEN * size[0]
        if observed.all():
            identity = np.eye(A.shape[-1])
            return Remembered(family, identity, identity, identity[:0])
        return Remembered(
            family,
            turned[observed] @ inverse,
            basis @ turned[observed].T,
            turned[~observed] @ inverse,
        )

    @property
    def follows(self) -> np.ndarray:
        """See `Family`."""
        return self.family.follows

    def at(self, x: float) -> np.ndarray:
        """The matrices of z."""
        if self.forgotten.size:
            return self.to @ self.family.at(x) @ self.back
        return self.family.at(x)

    def enclosed(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """The matrices of all states; see `Family`."""
        return self.family.enclosed(x)

    def hull(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray] | None:
        """The hull of the matrices of all states; see `Family`."""
        return self.family.hull(low, high)

    def proved(self, *ends: tuple[float, Centre]) -> tuple[Norms, ...] | None:
        """Norms of all states by forms of z at one number, or at two and those between, in which all
        matrices of that number, or of all between, are proved to shrink; None if they are not."""
        ends = tuple(sorted(ends, key=lambda end: end[0]))
        points = self.hull(ends[0][0], ends[-1][0])
        if points is None:
            return None
        norms: list[Norms] = []
        for (_, centre), place in zip(ends, (0, -1), strict=False):
            norms_at_number = self.norms(centre, points[0][[place]])
            if norms_at_number is None:
                return None
            norms.append(norms_at_number)
        if not shrink_along(norms, *points, self.follows):
            return None
        return tuple(norms)

    def norms(self, centre: Centre, E: np.ndarray) -> Norms | None:
        """Return norms of all states from those of z, in which matrices `I + E` of x shrink if they
        do so in those of z; None if they do not. E: `(points, symbols, n, n)`.

        The norms are `z' P_i z + e w' w`. A matrix takes z to A z and B z, whatever w is. So the
        slack is that of z less `e B' B`, and `e w' w`; e is chosen so that the first stays
        positive.
        """
        norms = centre.norms
        if not self.forgotten.size:
            return norms
        P = norms.P
        graph = norms.graph
        A = (self.back + E @ self.back)[:, graph.symbol]
        moved = self.to @ A
        lost = self.forgotten @ A
        try:
            half = np.linalg.inv(
                np.linalg.cholesky(P[graph.source] - moved.mT @ P[graph.target] @ moved)
            )
        except np.linalg.LinAlgError:
            return None
        largest = np.linalg.norm(lost @ half.mT, axis=(-2, -1)).max() ** 2
        whole = (
            self.to.T @ P @ self.to
            + SLACK_SHARE / max(largest, NEXT_TO_ZERO) * self.forgotten.T @ self.forgotten
        )
        return Norms((whole + whole.mT) / 2, graph)
