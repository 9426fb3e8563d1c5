"""A number between proof and refutation: how far a proof goes from a start each way, and what is
refuted beyond it.

A side is driven so: what is refuted nearest to the start is found first, for the proof of it ends
there. The proof then goes towards a goal just short of that, or towards the limit. A proof that
meets something nearer which is refuted ends, and goes on towards the goal short of that. What proves and what grows at a
number are given: norms in any order of frames, forms at ticks of any length, a small gain
of messages, forms that decay on average, or boxes of further numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wavesweep.engine._switched.graph import Family
from wavesweep.engine._switched.patterns import Word, begins, growth, places_between
from wavesweep.engine._switched.stretches import ProvedStretch

# a number counts as at least this part of its distance from the start, where relative sizes are
# formed
NEAR_START = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Refuted:
    """A number at which a family is refuted; x NaN and word () if none was found.

    word: the pattern that grows there, (0,) of second moments. point: of a box of other numbers, at
    which it does. text: the pattern as one reads it, where it is told.
    """

    x: float = np.nan
    word: Word = ()
    point: tuple[float, ...] = ()
    text: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class LeftOpen:
    """What holds a proof up where its budget ends.

    paths: of the numbers of its sides, in their order. ends: of the box around it `(2, sides)`, as
    numbers. share: of all values of the numbers but the first that it has.
    """

    paths: tuple[str, ...]
    ends: np.ndarray
    share: float


@dataclass(frozen=True, slots=True, eq=False)
class Bracket:
    """The numbers around a start for which a family, or all of a box of families, decays.

    low, high: every number from low to high, both included, is proved; NaN if nothing is. below,
    above: the nearest refuted numbers beyond these. stretches: the proof, from low to high without
    a gap, where it has some. open: what was left open next to `high`, or to `low`; None if nothing
    was.
    """

    low: float
    high: float
    below: Refuted = Refuted()
    above: Refuted = Refuted()
    stretches: tuple[ProvedStretch, ...] = ()
    open: LeftOpen | None = None


Proof = Callable[[float, float, Refuted], tuple[float, Refuted]]
"""A proof that goes on from a number towards a goal, short of what is refuted: the number that it
reaches, and what it met nearer that is refuted, if it did."""


def driven(
    start: float, limit: float, share: float, refuted: Refuted, proof: Proof
) -> tuple[float, Refuted]:
    """Return the number that a proof reaches from a start towards a limit, and what is refuted
    beyond it.

    share: of a refuted number, how far short of it the goal is; refuted: what is known before.
    """
    reached = start
    while True:
        goal = short_of(refuted.x, start, share) if refuted.word else limit
        goal = max(goal, reached, key=lambda x: abs(x - start))
        reached, met = proof(reached, goal, refuted)
        if not met.word:
            return reached, refuted
        refuted = met


Growing = Callable[[float, Word, bool], Sequence[Word]]
"""The patterns that grow at a number, those that are like a known one, if it is not (), before
others; whether many others are looked for."""


def nearest_of(
    family: Family,
    start: float,
    limit: float,
    steps: int,
    growing: Growing,
    back: Sequence[float],
) -> Refuted:
    """Return the refuted number closest to a start that a search towards a limit finds, if it finds
    one.

    It goes by numbers that follow from neither, so that a limit farther away finds the same, so many
    from one of `places_between` to the next, where many patterns are looked for; and then back from
    the first one that is refuted, by shares of its size, as long as patterns are refuted there.
    """
    tried = [start]
    for before, x, many in _on_the_way(start, limit, steps):
        tried.append(before)
        refuted = first_refuted(family, growing(x, (), many), tried, x)
        if refuted.word:
            break
    else:
        return Refuted()
    if abs(refuted.x - start) > abs(limit - start):
        return Refuted()
    for share in back:
        for _ in range(8):
            x = short_of(refuted.x, start, share)
            if x == start:
                break
            inside = [number for number in tried if abs(number - start) < abs(x - start)]
            nearer = first_refuted(family, growing(x, refuted.word, False), inside, x)
            if not nearer.word:
                break
            refuted = nearer
    return refuted


def _on_the_way(start: float, limit: float, steps: int) -> Iterator[tuple[float, float, bool]]:
    """Yield numbers with the one before each, and whether it is one of `places_between`."""
    for place, ahead in places_between(start, limit):
        for before, x in pairwise(np.linspace(place, ahead, 1 + steps).tolist()):
            if (x - start) * (limit - start) > 0:
                yield before, x, x == ahead


def first_refuted(
    family: Family, words: Sequence[Word], inside: Sequence[float], unstable: float
) -> Refuted:
    """Return the refuted number closest to the start of words that grow at `unstable`, if one is
    proved.

    inside: numbers on the way there, the start first, at which words may decay.
    """
    best = Refuted(unstable)
    for word in words[:8]:  # words whose crossings are computed
        if best.word and growth(family.at(best.x), word) < 1:
            continue
        decays = (number for number in inside[:0:-1] if growth(family.at(number), word) < 1)
        number = begins(family, word, next(decays, inside[0]), best.x)
        if number is not None:
            best = Refuted(number, word)
    return best if best.word else Refuted()


def size_of(x: float, start: float) -> float:
    """Return the size of a number, to which distances from it are compared."""
    return max(abs(x), NEAR_START * abs(x - start))


def short_of(x: float, start: float, share: float) -> float:
    """Return the number closer to a start by a share of a number's size, but by at most half of the
    way."""
    back = min(share * size_of(x, start), abs(x - start) / 2)
    return float(x + np.sign(start - x) * back)
