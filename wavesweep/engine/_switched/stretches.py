"""Proofs along a number, stretch by stretch: the centres of all forms are followed from number to
number, and a stretch that is proved goes from one to the next."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from wavesweep.engine._switched.norm_check import Norms
from wavesweep.engine._switched.norms import Centre, advanced

# relative to the whole way: a stretch, and the least rest to which it is compared
SHORTEST, SHORTEST_LEFT = 1e-7, 1e-3


class Search(Protocol):
    """A family as a search for norms has it."""

    def at(self, x: float) -> np.ndarray:
        """The matrices at x in plain doubles, in the states of the search, `(symbols, n, n)`."""

    def proved(self, *ends: tuple[float, Centre]) -> tuple[Norms, ...] | None:
        """Norms by forms at one number, or at two and those between, in which all matrices of that
        number, or of all between, are proved to shrink; None if they are not."""


@dataclass(frozen=True, slots=True, eq=False)
class ProvedStretch:
    """An interval of numbers for which the matrices shrink in norms that lie between those of
    its ends, see `shrink_along`."""

    low: float
    high: float
    norms: tuple[Norms, ...]


def _proved_ahead(
    search: Search, centre: Centre, end: float, goal: float, shortest: float
) -> tuple[tuple[Norms, ...] | None, float, Centre]:
    """Return norms that prove the stretch from an end to a number x, that number and the forms there:
    the goal is tried first, then half of the way that forms went; None if it is shorter than allowed."""
    ahead = centre
    target = x = goal
    while True:
        try:
            ahead, x = advanced(centre, search.at, end, target)
            ahead = ahead.rounded()
        except np.linalg.LinAlgError:  # singular to rounding
            return None, x, ahead
        if abs(x - end) < shortest or x == end:
            return None, x, ahead
        norms = search.proved((end, centre), (x, ahead))
        if norms:
            return norms, x, ahead
        target = (x + end) / 2


def covered(
    search: Search,
    centre: Centre,
    start: float,
    goal: float,
    least: float,
    work: float,
    most_stretches: int = 300,
    report: Callable[[float, float], None] = lambda *_: None,
) -> tuple[tuple[ProvedStretch, ...], float, Centre]:
    """Return stretches without a gap from the start towards the goal, the number that they reach,
    and the last forms.

    centre: forms at the start. least: the shortest stretch, relative to the number or to the rest of
    the way. work: operations of what leads on, after which this ends; most_stretches: stretches. report: is called with each
    number that is reached, and the percentage of the way.
    """
    stretches: list[ProvedStretch] = []
    end = start
    whole = abs(goal - start)
    while end != goal and len(stretches) < most_stretches and centre.work < work:
        rest = abs(goal - end)
        share = least * min(rest, max(abs(end), SHORTEST_LEFT * whole))
        shortest = min(rest, max(share, SHORTEST * whole))
        norms, x, ahead = _proved_ahead(search, centre, end, goal, shortest)
        if not norms:
            return tuple(stretches), end, replace(centre, work=ahead.work)
        stretches.append(ProvedStretch(min(end, x), max(end, x), norms))
        end = x
        centre = ahead
        report(end, 100 * (end - start) / (goal - start))
    return tuple(stretches), end, centre
