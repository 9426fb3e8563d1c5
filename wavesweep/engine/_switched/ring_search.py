"""The search for quadratic norms at the places of a ring, in which all matrices of a place shrink.

It begins with matrices that are all alike, the mean A of those at a place, and with their Lyapunov
functions `P_i = e + A' P_j A`; the choices then open, `A + w (A_k - A)`. If there are such norms at
all, there are such of the means, since norms are convex. `norm_check` proves what is found here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Protocol

import numpy as np

from wavesweep.engine._switched.graph import Family, Graph
from wavesweep.engine._switched.norm_check import Norms, shrink_along
from wavesweep.engine._switched.norms import (
    Centre,
    advanced,
    means_of_places,
    periodic_forms,
    recentred,
    units_of_places,
)

STEPS = 40  # of Newton's, which a search takes at least


class RingFamily(Family, Protocol):
    """Matrices at places that follow each other in a ring.

    place: `(symbols,)`, the place of each matrix, 0, 1, ...; graph: a node for each place.
    """

    place: np.ndarray
    graph: Graph


@dataclass(frozen=True, slots=True, eq=False)
class RingSearch:
    """A ring of matrices in units of their own at each place, `z = to x`, `(places, n, n)`."""

    family: RingFamily
    graph: Graph
    to: np.ndarray
    back: np.ndarray

    @staticmethod
    def at_mean(family: RingFamily, x: float) -> RingSearch | None:
        """The ring in units in which the Lyapunov functions of the means are about 1; None if the
        means are not stable."""
        to = units_of_places(family.at(x), family.place)
        return to if to is None else RingSearch(family, family.graph, to, np.linalg.inv(to))

    def at(self, x: float) -> np.ndarray:
        """The matrices of z."""
        return self.to[self.graph.target] @ self.family.at(x) @ self.back[self.graph.source]

    def found(self, x: float, work: float) -> Centre | None:
        """Forms in which all matrices at x shrink, in doubles; None if none are found."""
        A = self.at(x)
        same = means_of_places(A, self.family.place)[self.graph.source]
        identity = np.eye(A.shape[-1])
        P = np.broadcast_to(identity, (self.graph.nodes, *identity.shape))
        forms = len(identity) * (len(identity) + 1) / 2
        band = min(3, self.graph.nodes) * forms  # of a ring: see `Graph.along`
        if self.graph.nodes * forms * band**2 / 3 > work / STEPS:
            return None
        try:
            centre = recentred(Centre(P, self.graph, identity, identity), same, 60)
        except np.linalg.LinAlgError:  # singular to rounding
            return None
        centre, width = opened(centre, lambda w: same + w * (A - same), 0.0, work)
        return centre if width == 1 else None

    def proved(self, *ends: tuple[float, Centre]) -> tuple[Norms, ...] | None:
        """See `Search`."""
        ends = tuple(sorted(ends, key=lambda end: end[0]))
        points = self.family.hull(ends[0][0], ends[-1][0])
        if points is None:
            return None
        norms = []
        for _, centre in ends:
            P = self.to.mT @ centre.norms.P @ self.to
            norms.append(Norms((P + P.mT) / 2, self.graph))
        return tuple(norms) if shrink_along(norms, *points, self.family.follows) else None


def opened(
    centre: Centre, matrices: Callable[[float], np.ndarray], width: float, work: float
) -> tuple[Centre, float]:
    """Return forms of matrices that are less and less alike, and the width at which the search ends:
    1, or where it stalls.

    matrices: of a width. centre: forms for a width, with which it begins.
    """
    while width < 1 and centre.work < work:
        try:
            ahead, next_width = advanced(centre, matrices, width, 1.0)
            ahead = ahead.rounded()
        except np.linalg.LinAlgError:  # singular to rounding
            break
        step = next_width - width
        centre, width = ahead, next_width
        # After the first steps, which are short, one that gains no more has stalled.
        if step < min(2e-3 * width, 0.03 * (1 - width)) or not step:
            break
    return centre, width


def units_of_ring(A: np.ndarray) -> np.ndarray | None:
    """Return units at each place of a ring, `z = to x`, in which its matrices `(places, n, n)` shrink
    every z by nearly the same share, that of the slowest mode; None if the loop is not stable."""
    from scipy.linalg import matrix_balance

    places, n, _ = A.shape
    identity = np.eye(n)
    round_ring = np.zeros((places, n, places, n))
    for place in range(places):
        round_ring[(place + 1) % places, :, place] = A[place]
    _, (sizes, _) = matrix_balance(round_ring.reshape(places * n, -1), permute=False, separate=True)
    sizes = sizes.reshape(places, n)
    A = A * sizes[:, None] / np.roll(sizes, -1, axis=0)[..., None]
    whole = reduce(lambda before, matrix: matrix @ before, A)
    radius = np.abs(np.linalg.eigvals(whole)).max() if np.isfinite(whole).all() else np.inf
    if radius >= 1:
        return None
    forms = periodic_forms(A / ((1 + radius) / 2) ** (1 / places))
    if forms is None:
        return None
    # Of a form: more than rounding may take off.
    floor = 1e-12 * np.trace(forms, axis1=-2, axis2=-1)[:, None, None]
    return np.linalg.cholesky(forms + floor * identity).mT / sizes[:, None]
