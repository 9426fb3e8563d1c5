"""Forms at the places of ticks that take any times, for `proofs.sets`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wavesweep.engine.sets import Polynomials
from wavesweep.engine.switched import Centre, Graph, opened, recentred, units_of_ring

WORK = 2e10  # operations of a search, as of one in `late_ticks`


@dataclass(frozen=True, slots=True, eq=False)
class AtPlaces:
    """The rule by which ticks come, with forms of its own, see `OwnForms` of `engine.switched`.

    follows: of the control points of all ticks, sorted by place. places: of ticks in a period.
    """

    follows: np.ndarray
    places: int

    @property
    def whole(self) -> AtPlaces:
        """What has the rule."""
        return self

    def found(self, A: Polynomials) -> tuple[Centre, np.ndarray] | None:
        """Forms at the places in which all ticks shrink in the middle of a cell, and their slopes:
        from ticks that are all alike, the mean of those at a place, to the ones that there are."""
        symbols, n, _ = A.rest.shape
        mean = A.terms[0].reshape(self.places, -1, n, n).mean(1)
        to = units_of_ring(mean)
        if to is None:
            return None
        symbol = np.arange(symbols)
        place = symbol * self.places // symbols
        graph = Graph(place, symbol, (place + 1) % self.places)
        after, before = to[graph.target], np.linalg.inv(to)[place]
        alike = after @ mean[place] @ before
        terms = after @ A.terms[: 1 + A.numbers] @ before
        one = np.eye(n)
        start = Centre(np.broadcast_to(one, to.shape), graph, one, one)
        centre, width = opened(
            recentred(start, alike, 60), lambda w: alike + w * (terms[0] - alike), 0.0, WORK
        )
        if width < 1:
            return None
        centre, slopes = centre.rounded().sloped(terms)
        P = np.concatenate([centre.P[None], slopes])
        P = to.mT @ centre.inverse.mT @ P @ centre.inverse @ to
        centre = Centre((P[0] + P[0].mT) / 2, graph, one, one).rounded()
        return centre, centre.basis.mT @ P[1:] @ centre.basis
