"""What is proved and what is refuted of a loop whose ticks take any time within an interval.

Nodes of a graph are the places of ticks in a frame, perhaps with the cells of lengths that the last
ticks were in; each has a form of degree two, or of four or eight as one of `squares`. An edge is a
control point of a cell, and all control points of a cell lead from a node to the same node: so the
form decreases in every tick of the cell, see `tick_curves`. `norm_check` proves what is found here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from wavesweep.engine.doubles import UNIT_ROUNDING
from wavesweep.engine.switched import (
    Bracket,
    Centre,
    Graph,
    Norms,
    Refuted,
    Verdict,
    covered,
    driven,
    is_refuted,
    opened,
    recentred,
    shrink_along,
    units_of_ring,
)
from wavesweep.late_ticks.patterns import (
    growing,
    in_words,
    nearest_growing,
    word_of,
)
from wavesweep.late_ticks.squares import enclosed_square, square_of_curves, squared
from wavesweep.late_ticks.tick_curves import DEGREE, LateTicks

# of a number, or of the way that is left: stretches that are shorter are not tried
LEAST_STEP = 3e-4
OPERATIONS_OF_BRACKET = 2e10  # operations of searches for norms, for each side: some seconds
OPERATIONS_OF_STEP = 6e8  # of Newton's: graphs and degrees that need more are not tried
MOST_SQUARES = 2  # forms of degree 8: higher ones were not tried
SHORT = 1e-3  # of a refuted number, how far before it a proof ends
MOST_REMEMBERED = 4  # ticks, of which each doubles the nodes: more were not tried
# Shares of an interval, at which a proof begins.
STARTS = (0.3, 0.05, 0.6, 0.01, 0.15, 0.9, 1e-3)
# Of a number, or of the way that is left: with what less is gained, the next search is tried as well, and a tenth ends
# them.
WORTH = 0.2

TicksWith = Callable[[int], LateTicks]
"""The ticks of a loop, with their lengths in at least so many cells."""


@dataclass(frozen=True, eq=False)
class Search:
    """The search for forms in which ticks decrease, on a graph whose nodes remember the cells of the
    last ticks.

    squares: how often ticks are squared; forms are of degree `2^(squares + 1)`. to: units at each
    place, `z = to x`; None for those of x.
    """

    ticks: LateTicks
    remembered: int = 0
    squares: int = 0
    to: np.ndarray | None = None

    @cached_property
    def back(self) -> np.ndarray:
        """The states x of those in the units, `x = back z`."""
        return np.linalg.inv(self.to)

    @cached_property
    def points(self) -> int:
        """The number of control points of a cell."""
        return DEGREE * 2**self.squares + 1

    @cached_property
    def histories(self) -> list[tuple[int, ...]]:
        """The cells of the last ticks, of each node of a place."""
        return list(product(range(self.ticks.cells), repeat=self.remembered))

    @cached_property
    def graph(self) -> Graph:
        """The graph of all control points."""
        places, cells = self.ticks.places, self.ticks.cells
        number = {history: index for index, history in enumerate(self.histories)}
        edges = []
        for place, cell, history in product(range(places), range(cells), self.histories):
            source = place * len(number) + number[history]
            target = (place + 1) % places * len(number) + number[(*history, cell)[1:]]
            first = (place * cells + cell) * self.points
            edges += [(source, first + point, target) for point in range(self.points)]
        return Graph(*np.array(edges).T)

    @cached_property
    def follows(self) -> np.ndarray:
        """Which control points may come after which."""
        place = np.repeat(np.arange(self.ticks.places), self.ticks.cells * self.points)
        return (place[:, None] + 1) % self.ticks.places == place

    @cached_property
    def place(self) -> np.ndarray:
        """The place of each node."""
        return np.repeat(np.arange(self.ticks.places), len(self.histories))

    @cached_property
    def cost(self) -> float:
        """Rough number of operations of a step of Newton's, as `norms` has it."""
        n = self.ticks.slots.shape[1]
        for _ in range(self.squares + 1):
            n = n * (n + 1) // 2
        _, apart = self.graph.along
        return self.graph.nodes * n * (min(self.graph.nodes, apart + 1) * n) ** 2 / 3

    def finer(self, ticks_with: TicksWith) -> list[Search]:
        """What is tried next: forms of a higher degree, then one more tick remembered; without what
        needs too many operations."""
        finer = []
        if not self.remembered and self.squares < MOST_SQUARES:
            finer.append(replace(self, squares=self.squares + 1))
        if self.remembered < MOST_REMEMBERED:
            ticks = ticks_with(max(2, self.ticks.cells))
            finer.append(replace(self, ticks=ticks, remembered=self.remembered + 1))
        return [search for search in finer if search.cost < OPERATIONS_OF_STEP]

    def at(self, x: float, width: float = 1.0) -> np.ndarray:
        """The matrices of the control points, `A + width (A_k - A)` with the mean A of those at a
        place."""
        A = self.ticks.in_slots(self.ticks.family.at(x))
        if self.to is not None:
            A = np.roll(self.to, -1, axis=0)[:, None, None] @ A @ self.back[:, None, None]
        alike = A.mean((1, 2), keepdims=True)
        curves = (alike + width * (A - alike))[None]
        for _ in range(self.squares):
            curves = square_of_curves(curves)
        return curves.reshape(-1, *curves.shape[-2:])

    def alike(self, x: float) -> Forms | None:
        """Forms for ticks that are all alike, the mean of those at a place, in units of their own;
        None if these ticks are not stable."""
        to = units_of_ring(self.at(x, 0.0)[:: self.ticks.cells * self.points])
        if to is None:
            return None
        search = replace(self, to=to)
        identity = np.eye(to.shape[-1])
        P = np.broadcast_to(identity, (self.graph.nodes, *identity.shape))
        start = Centre(P, self.graph, identity, identity).rounded()
        return Forms(search, x, recentred(start, search.at(x, 0.0), 60))

    def proved(self, *ends: tuple[float, Centre]) -> tuple[Norms, ...] | None:
        """Norms in which the squared ticks shrink, by forms at one number, or at two and those
        between, if that is proved for the number, or for all between; else None."""
        ends = tuple(sorted(ends, key=lambda end: end[0]))
        points = self.ticks.family.hull(ends[0][0], ends[-1][0])
        if points is None:
            return None
        E, dE = points
        A = np.eye(E.shape[-1]) + E
        dA = dE + UNIT_ROUNDING * np.abs(A)
        # Units of the states alone, powers of 2.
        units = np.exp2(np.round(np.log2(np.abs(self.back).max(-1))))
        into = units[:, None, None, None] / np.roll(units, -1, axis=0)[:, None, None, :, None]
        A, dA = (self.ticks.in_slots(matrix) * into for matrix in (A, dA))
        to = self.to * units[:, None]
        for _ in range(self.squares):
            A, dA = enclosed_square(A, dA)
            to = squared(to)
        shape = (len(A), -1, *A.shape[-2:])
        E = A - np.eye(A.shape[-1])
        dE = dA + UNIT_ROUNDING * np.abs(E)
        to = to[self.place]
        norms = []
        for _, centre in ends:
            P = to.mT @ centre.norms.P @ to
            norms.append(Norms((P + P.mT) / 2, self.graph))
        shrink = shrink_along(norms, E.reshape(shape), dE.reshape(shape), self.follows)
        return tuple(norms) if shrink else None


@dataclass(frozen=True, eq=False)
class Forms:
    """Forms of a search in which ticks at a number decrease, in doubles, if they are no wider apart
    than a share of what they are."""

    search: Search
    x: float
    centre: Centre
    width: float = 0.0

    @property
    def proved(self) -> bool:
        """Whether all ticks are proved to decrease."""
        return self.width == 1 and bool(self.search.proved((self.x, self.centre)))

    def opened(self) -> Forms:
        """The forms of ticks that are less and less alike, until the search stalls."""
        centre, width = opened(
            self.centre,
            lambda wider: self.search.at(self.x, wider),
            self.width,
            OPERATIONS_OF_BRACKET,
        )
        return replace(self, centre=centre, width=width)

    def walked(self, goal: float) -> Forms:
        """The last forms of a proof without a gap towards a goal."""
        # Steps of a hundredth of a number lead to a thousandth of it within 1000.
        _, x, centre = covered(
            self.search, self.centre, self.x, goal, LEAST_STEP, OPERATIONS_OF_BRACKET, 1000
        )
        return replace(self, centre=centre, x=x)

    def finer(self, search: Search) -> Forms | None:
        """These forms in a search on a finer graph, or of a higher degree, near their own centre;
        None if these are singular to rounding.

        They begin at less than the width that is reached, unless nodes remember cells: less wide
        ticks of a cell are in no convex hull of the wider ones.
        """
        before = self.search
        width = self.width if before.remembered else 0.9 * self.width
        cells = before.ticks.cells
        ratio = search.ticks.cells // cells
        nodes = []
        for place, history in product(range(search.ticks.places), search.histories):
            node = place
            for cell in history[len(history) - before.remembered :]:
                node = node * cells + cell // ratio
            nodes.append(node)
        try:
            centre = self.centre
            if width < self.width:
                centre = recentred(centre, before.at(self.x, width), 20)
            maps = [centre.P[nodes], centre.basis, centre.inverse]
            for _ in range(search.squares - before.squares):
                maps = [squared(tick) for tick in maps]
            P, basis, inverse = maps
            centre = replace(centre, P=P, basis=basis, inverse=inverse, graph=search.graph)
            centre = recentred(centre.rounded(), search.at(self.x, width), 8)
        except np.linalg.LinAlgError:  # singular to rounding
            return None
        return Forms(search, self.x, centre, width)


def started(ticks_with: TicksWith, numbers: Iterable[float]) -> Forms | None:
    """Return forms that are proved at one of some numbers; None if none are found.

    The search begins with ticks that are all alike; the interval of lengths then opens, on finer
    graphs where it stalls for all numbers.
    """
    first = Search(ticks_with(1))
    begun: Iterable[Forms | None] = map(first.alike, numbers)
    while True:
        stalled = []
        for forms_begun in begun:
            forms = forms_begun and forms_begun.opened()
            if forms is None:
                continue
            if forms.proved:
                return forms
            stalled.append(forms)
        if not stalled:
            return None
        stalled.sort(key=lambda forms: -forms.width)
        most_open = stalled[:2]
        begun = [
            forms_begun.finer(search)
            for forms_begun in most_open
            for search in forms_begun.search.finer(ticks_with)
        ]


def decided(ticks_with: TicksWith) -> tuple[str, str]:
    """Whether a loop at its own values is stable for ticks of all lengths in any order, and the
    pattern with which it is not.

    ticks_with: along no number.
    """
    ticks = ticks_with(1)
    rate, pattern = growing(ticks, 0.0)
    if rate >= 1 and is_refuted(ticks.family, word_of(ticks, pattern), 0.0):
        return Verdict.REFUTED, in_words(ticks, pattern)
    return (Verdict.UNKNOWN if started(ticks_with, [0.0]) is None else Verdict.PROVED), ""


def bracket(
    ticks_with: TicksWith,
    about: tuple[float, float],
    tolerance: float = 0.02,  # of an end: a distance that needs no finer graph
) -> Bracket | None:
    """What is proved and refuted within an interval; None if no start of a proof is found, and
    nothing is refuted. Without a start both ends are the least number that is refuted.

    ticks_with: along a number. about: an interval of that number.
    """
    ticks = ticks_with(1)
    low, high = about
    refuted = []

    def possible():
        for share in STARTS:
            start = low + share * (high - low)
            rate, pattern = growing(ticks, start)
            if rate < 1:
                yield start
            elif is_refuted(ticks.family, word_of(ticks, pattern), start):
                refuted.append(Refuted(start, pattern, text=in_words(ticks, pattern)))

    forms = started(ticks_with, possible())
    if forms is not None:
        reached, above = _side(ticks_with, forms, high, tolerance)
        # Of the high end, from which on is proved what begins at 0.
        near = 1e-4 * reached if low == 0 else 0.0
        least, below = _side(ticks_with, forms, max(low, near), tolerance)
        return Bracket(least, reached, below, above)
    if not refuted:
        return None
    least = min(refuted, key=lambda refuter: refuter.x)
    return Bracket(least.x, least.x, above=least)


def _side(
    ticks_with: TicksWith, begun: Forms, limit: float, tolerance: float
) -> tuple[float, Refuted]:
    """What is proved from a start towards a limit, and what is refuted beyond it."""

    def proof(start: float, goal: float, _refuted: Refuted) -> tuple[float, Refuted]:
        """A proof with finer graphs as long as goal and proof are far apart."""
        forms = replace(begun, centre=replace(begun.centre, work=0.0)).walked(goal)
        while True:
            distance = abs(goal - forms.x)
            if distance <= tolerance * max(abs(goal), tolerance * abs(goal - start)):
                break
            best = forms
            worth = WORTH * min(distance, max(abs(forms.x), 1e-3 * distance))
            for search in forms.search.finer(ticks_with):
                ahead = forms.finer(search)
                ahead = ahead and ahead.opened()
                if ahead and ahead.proved:
                    best = min(
                        best, ahead.walked(goal), key=lambda step_ahead: abs(goal - step_ahead.x)
                    )
                if abs(best.x - forms.x) > worth:
                    break
            if abs(best.x - forms.x) < worth / 10:
                break
            forms = best
        return forms.x, Refuted()

    ticks = begun.search.ticks
    refuted = nearest_growing(ticks, begun.x, limit)
    reached, refuted = driven(begun.x, limit, SHORT, refuted, proof)
    return reached, replace(refuted, text=in_words(ticks, refuted.word))
