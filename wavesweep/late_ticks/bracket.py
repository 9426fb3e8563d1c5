"""What is proved and what is refuted of a loop whose ticks take any time within an interval.

Nodes of a graph are the places of ticks in a frame, perhaps with the cell of lengths that the last
tick was in; each has a quadratic form. An edge is a control point of a cell, and all control points
of a cell lead from a node to the same node: so the form decreases in every tick of the cell, see
`tick_curves`. `norm_check` of [for_all] proves what is found here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.late_ticks.patterns import (
    Pattern,
    growing,
    in_words,
    nearest_growing,
    word_of,
)
from wavesweep.late_ticks.tick_curves import DEGREE, LateTicks

PROVED, REFUTED, UNKNOWN = "proved", "refuted", "unknown"
# Cells of lengths, and how many ticks back a node remembers them: of the graphs that are tried in
# turn.
GRAPHS = ((1, 0), (2, 1), (4, 1))
# of a number, or of the way that is left: stretches that are shorter are not tried
LEAST_STEP = 1e-3
OPERATIONS_OF_BRACKET = 4e9  # operations of searches for norms, for each side: some seconds
# of the way that is left: a step with which a search for norms ends, if the one before was longer
STALLED = 0.03
BEFORE_STALL = 0.9  # of a width that is reached: where the search on a finer graph begins
STARTS = (0.3, 0.05, 0.6, 0.01, 0.15)  # shares of an interval, at which a proof begins

TicksWith = Callable[[int], LateTicks]
"""The ticks of a loop, with their lengths in at least so many cells."""


@dataclass(frozen=True, slots=True, eq=False)
class End:
    """An end of what is proved, and the nearest value beyond it that is refuted, NaN if none is
    known, with its pattern."""

    reached: float
    fails: float = np.nan
    pattern: Pattern = ()
    text: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Bracket:
    """What is proved of an interval, and what is refuted at its ends."""

    below: End
    above: End


@dataclass(frozen=True, eq=False)
class Search:
    """The search for norms of some ticks, on a graph whose nodes remember the cells of the last
    ticks."""

    ticks: LateTicks
    remembered: int

    @cached_property
    def ends(self) -> np.ndarray:
        """The matrices at the ends of cells, which alone are looked at while norms are searched."""
        points = np.arange(len(self.ticks.family.symbols)) % (DEGREE + 1)
        return np.flatnonzero((points == 0) | (points == DEGREE))

    @cached_property
    def whole(self) -> Any:
        """The graph of all control points."""
        cells = self.ticks.cells
        histories = list(product(range(cells), repeat=self.remembered))
        number = {history: at for at, history in enumerate(histories)}
        source = []
        symbol = []
        target = []
        for each, (place, point) in enumerate(self.ticks.family.symbols):
            next_place = (place + 1) % self.ticks.places
            for history in histories:
                longer = (*history, point // (DEGREE + 1))
                source.append(place * len(histories) + number[history])
                symbol.append(each)
                target.append(next_place * len(histories) + number[longer[1:] if history else ()])
        return offered("switched").Graph(*map(np.array, (source, symbol, target)))

    @cached_property
    def graph(self) -> Any:
        """The graph of the ends of cells, whose matrices are numbered as in `ends`."""
        whole = self.whole
        kept = np.isin(whole.symbol, self.ends)
        symbol = np.searchsorted(self.ends, whole.symbol[kept])
        return offered("switched").Graph(whole.source[kept], symbol, whole.target[kept])

    @cached_property
    def place(self) -> np.ndarray:
        """The place of each node."""
        return np.arange(self.graph.nodes) * self.ticks.places // self.graph.nodes

    def at(self, x: float, width: float = 1.0) -> np.ndarray:
        """The matrices at the ends of cells, `A + width (A_k - A)` with the mean A of those at a
        place."""
        A = self.ticks.by_place(self.ticks.family.at(x)[self.ends])
        alike = A.mean(1, keepdims=True)
        return (alike + width * (A - alike)).reshape(-1, *A.shape[-2:])

    def alike(self, x: float) -> Any:
        """Norms for ticks that are all alike, the mean of those at a place: their Lyapunov
        functions, `P_i = e + A' P_j A`. None if these ticks are not stable."""
        switched = offered("switched")
        A = self.at(x, 0.0)
        units, inverse = switched.rough_basis(A)
        forms = switched.periodic_forms(inverse @ A[:: 2 * self.ticks.cells] @ units)
        if forms is None:
            return None
        start = switched.Centre(forms[self.place], self.graph, units, inverse).rounded()
        return switched.recentred(start, A, 8)

    def opened(self, centre: Any, x: float, width: float) -> tuple[Any, float]:
        """The norms of ticks that are less and less alike, from a width on, and the width at which
        the search ends, 1 if it does not stall."""
        step = 0.0
        while width < 1 and centre.work < OPERATIONS_OF_BRACKET:
            before = step, width
            centre, width = offered("switched").advanced(
                centre, lambda wider: self.at(x, wider), width, 1.0
            )
            centre = centre.rounded()
            step = width - before[1]
            if step < min(before[0] / 2, STALLED * (1 - width)) or not step:
                break
        return centre, width

    def refined(self, before: Search, centre: Any, x: float, width: float = 1.0) -> Any:
        """The norms of a coarser graph on this one, near its own centre."""
        cells = before.ticks.cells
        finer = self.ticks.cells // cells
        P = []
        for place in range(self.ticks.places):
            for history in product(range(self.ticks.cells), repeat=self.remembered):
                node = place
                for cell in history[len(history) - before.remembered :]:
                    node = node * cells + cell // finer
                P.append(centre.P[node])
        lifted = replace(centre, P=np.array(P), graph=self.graph)
        return offered("switched").recentred(lifted, self.at(x, width), 8)

    def proved(self, *ends: tuple[float, Any]) -> bool:
        """Whether norms at one number, or those between the norms at two, are proved to be norms
        for it, or for all numbers between."""
        switched = offered("switched")
        low, high = min(ends, key=_first), max(ends, key=_first)
        points = self.ticks.family.hull(low[0], high[0])
        if points is None:
            return False
        several = (low, high) if low[0] < high[0] else (low,)
        norms = [replace(centre.norms, graph=self.whole) for _, centre in several]
        return switched.shrink_along(norms, *points, self.ticks.family.follows)


def started(ticks_with: TicksWith, x: float) -> tuple[Search, Any] | None:
    """Return norms that are proved at x, with their search; None if none are found.

    The search begins with ticks that are all alike; the interval of lengths then opens, on finer
    graphs where it stalls.
    """
    search = None
    centre, width = None, 0.0
    try:
        for cells, remembered in GRAPHS:
            finer = Search(ticks_with(cells), remembered)
            if search is None:
                centre = finer.alike(x)
            else:
                width = BEFORE_STALL * width
                centre = finer.refined(search, centre, x, width)
            if centre is None:
                return None
            search = finer
            centre, width = search.opened(centre, x, width)
            if width == 1 and search.proved((x, centre)):
                return search, centre
    except np.linalg.LinAlgError:  # singular to rounding
        return None
    return None


def _first(pair):
    return pair[0]


def decided(ticks_with: TicksWith) -> tuple[str, str]:
    """Whether a loop at its own values is stable for ticks of all lengths in any order, and the
    pattern with which it is not.

    ticks_with: along no number.
    """
    ticks = ticks_with(1)
    rate, pattern = growing(ticks, 0.0)
    if rate >= 1 and offered("switched").is_refuted(ticks.at_ends, word_of(ticks, pattern), 0.0):
        return REFUTED, in_words(ticks, pattern)
    return (UNKNOWN if started(ticks_with, 0.0) is None else PROVED), ""


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
    for share in STARTS:
        start = low + share * (high - low)
        rate, pattern = growing(ticks, start)
        if rate >= 1:
            if offered("switched").is_refuted(ticks.at_ends, word_of(ticks, pattern), start):
                refuted.append(End(start, start, pattern, in_words(ticks, pattern)))
            continue
        found = started(ticks_with, start)
        if found is not None:
            search, centre = found
            above = _side(ticks_with, search, centre, start, high, tolerance)
            # Of the high end, from which on is proved what begins at 0.
            near = 1e-4 * above.reached if low == 0 else 0.0
            below = _side(ticks_with, search, centre, start, max(low, near), tolerance)
            return Bracket(below, above)
    if not refuted:
        return None
    least = min(refuted, key=lambda end: end.reached)
    return Bracket(End(least.reached), least)


def _side(ticks_with, search, centre, start, limit, tolerance) -> End:
    """What is proved and refuted from a start towards a limit, with finer graphs as long as they
    are far apart."""
    ticks = search.ticks
    fails, pattern = nearest_growing(ticks, start, limit)
    # How far before the refuted end a proof ends.
    goal = fails + 2e-3 * (start - fails) if pattern else limit
    reached = start
    centre = replace(centre, work=0.0)
    for cells, remembered in GRAPHS:
        if remembered < search.remembered:
            continue
        if remembered > search.remembered or cells > search.ticks.cells:
            finer = Search(ticks_with(cells), remembered)
            centre = finer.refined(search, centre, reached)
            search = finer
        centre, reached = offered("switched").walked(
            search, centre, reached, goal, OPERATIONS_OF_BRACKET, LEAST_STEP
        )
        near = abs(goal - reached) <= tolerance * max(abs(goal), tolerance * abs(goal - start))
        if near or centre.work > OPERATIONS_OF_BRACKET:
            break
    return End(reached, fails, pattern, in_words(ticks, pattern))
