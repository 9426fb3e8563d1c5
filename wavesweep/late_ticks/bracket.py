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
# Steps with which a search for norms ends: shorter ones than both, the second of the way that is
# left.
SLOW, STALLED = 2e-3, 0.03
LEAST_FORM = 1e-3  # what Lyapunov functions lose in a tick, in units in which ticks are about 1

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

    def at(self, x: float) -> np.ndarray:
        """The matrices at the ends of cells."""
        return self.ticks.family.at(x)[self.ends]

    def found(self, x: float) -> Any:
        """Norms in which all ticks shrink at x, in doubles; None if none are found.

        The search begins with ticks that are all alike, the mean A of those at a place, and with
        their Lyapunov functions `P_i = e + A' P_j A`; the interval of lengths then opens, `A + w
        (A_k - A)`.
        """
        switched = offered("switched")
        A = self.at(x)
        places = self.ticks.places
        n = A.shape[-1]
        alike = A.reshape(places, -1, n, n).mean(1)
        units, inverse = switched.rough_basis(A)
        forms = _periodic(inverse @ alike @ units)
        if forms is None:
            return None
        same = np.repeat(alike, len(A) // places, axis=0)
        histories = self.graph.nodes // places
        P = np.repeat(forms, histories, axis=0)

        def opened(width):
            return same + width * (A - same)

        try:
            start = switched.Centre(P, self.graph, units, inverse).rounded()
            centre = switched.recentred(start, same, 8)
            width = 0.0
            while width < 1 and centre.work < OPERATIONS_OF_BRACKET:
                before = width
                centre, width = switched.advanced(centre, opened, width, 1.0)
                centre = centre.rounded()
                if width - before < min(SLOW, STALLED * (1 - width)):
                    return None
        except np.linalg.LinAlgError:  # singular to rounding
            return None
        return centre if width == 1 else None

    def refined(self, before: Search, centre: Any, x: float) -> Any:
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
        return offered("switched").recentred(lifted, self.at(x), 8)

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

    def walked(self, centre: Any, x: float, goal: float, work: float) -> tuple[Any, float]:
        """The last norms of a proof without a gap from x towards a goal, and the number that it
        reaches."""
        switched = offered("switched")
        for _ in range(80):  # steps of a proof with one graph
            if x == goal or centre.work > work:
                break
            target = goal
            step = None
            while step is None:
                try:
                    ahead, at = switched.advanced(centre, self.at, x, target)
                    ahead = ahead.rounded()
                except np.linalg.LinAlgError:  # singular to rounding
                    break
                least = LEAST_STEP * min(abs(goal - x), max(abs(x), LEAST_STEP * abs(goal - x)))
                if at == x or abs(at - x) < least:
                    break
                if self.proved((x, centre), (at, ahead)):
                    step = ahead, at
                target = (x + at) / 2
            if step is None:
                break
            centre, x = step
        return centre, x


def _periodic(ticks: np.ndarray) -> np.ndarray | None:
    """Forms that each of some ticks in a row lowers, `P_i = e + A_i' P_{i+1} A_i`; None if the
    loop is not stable."""
    from scipy.linalg import solve_discrete_lyapunov

    n = ticks.shape[-1]
    frame = np.eye(n)
    lost = np.zeros((n, n))
    for tick in ticks:
        lost = lost + LEAST_FORM * frame.T @ frame
        frame = tick @ frame
    if not np.isfinite(frame).all() or np.abs(np.linalg.eigvals(frame)).max() >= 1:
        return None
    P = solve_discrete_lyapunov(frame.T, lost)
    forms = []
    for tick in ticks[::-1]:
        P = LEAST_FORM * np.eye(n) + tick.T @ P @ tick
        forms.append((P + P.T) / 2)
    return np.array(forms[::-1])


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
    for cells, remembered in GRAPHS:
        search = Search(ticks_with(cells), remembered)
        centre = search.found(0.0)
        if centre is not None and search.proved((0.0, centre)):
            return PROVED, ""
    return UNKNOWN, ""


def bracket(
    ticks_with: TicksWith,
    about: tuple[float, float],
    tolerance: float = 0.02,  # of an end: a distance that needs no finer graph
) -> Bracket | None:
    """What is proved and refuted within an interval; None if no start of a proof is found.

    ticks_with: along a number. about: an interval of that number.
    """
    search = Search(ticks_with(1), 0)
    low, high = about
    for share in (0.3, 0.05, 0.6, 0.01):  # of an interval, where a proof begins
        start = low + share * (high - low)
        centre = search.found(start)
        if centre is not None and search.proved((start, centre)):
            above = _side(ticks_with, search, centre, start, high, tolerance)
            # Of the high end, from which on is proved what begins at 0.
            near = 1e-4 * above.reached if low == 0 else 0.0
            below = _side(ticks_with, search, centre, start, max(low, near), tolerance)
            return Bracket(below, above)
    return None


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
        if search.remembered != remembered or search.ticks.cells < cells:
            finer = Search(ticks_with(cells), remembered)
            centre = finer.refined(search, centre, reached)
            search = finer
        centre, reached = search.walked(centre, reached, goal, OPERATIONS_OF_BRACKET)
        near = abs(goal - reached) <= tolerance * max(abs(goal), tolerance * abs(goal - start))
        if near or centre.work > OPERATIONS_OF_BRACKET:
            break
    return End(reached, fails, pattern, in_words(ticks, pattern))
