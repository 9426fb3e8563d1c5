"""How loops rank before any is proved: by the least number at which some short word grows.

It is a search in plain doubles, which proves nothing. What it finds is an upper bound on what can be
proved, so the best of several designs is known as soon as no other has a larger bound: words that
were found for one are tried with all others, and changed matrix by matrix where they grow first. For
the leading design alone others are searched.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.engine._switched.graph import Family
from wavesweep.engine._switched.patterns import (
    Word,
    growing,
    growing_of,
    growth,
    improved,
    rates_of,
    short_words,
)
from wavesweep.engine.doubles import NEXT_TO_ZERO

CLOSE = 1e-3  # of a number where a word begins to grow, up to which it is found
MIDDLE_EVERY = 3  # steps, of which one halves what is left
LEAST_STEP = 0.05  # of what is left
SEARCHES = 6  # for words that grow below all that are known
BELOW = 0.015  # share of the number where those begin to grow, by which a search is below it


@dataclass(slots=True, eq=False)
class _Ranked:
    """A family, and the least number at which a word is known to grow.

    end: that number, or the limit. known: words that refute families of these symbols. searched:
    whether no further ones are found below.
    """

    family: Family
    end: float
    known: list[Word]
    searched: bool = False

    def follow(self, words: Sequence[Word]) -> list[Word]:
        """Lower the end to where the first of some words grows, and that word changed matrix by
        matrix; return what it becomes."""
        followed: list[Word] = []
        end, word = first_growing(self.family, words, self.end)
        for _ in range(SEARCHES):
            if not word:
                break
            self.end = end
            x = (1 - BELOW) * end
            A = self.family.at(x)
            if not np.isfinite(A).all():
                break
            word = improved(A, self.family.follows, word)
            if growth(A, word) < 1:
                break
            followed.append(word)
            end, word = first_growing(self.family, [word], x)
        return followed

    def search(self) -> list[Word]:
        """Look for words that grow just below the end until there are none; return them."""
        self.searched = True
        words: list[Word] = []
        for _ in range(SEARCHES):
            x = (1 - BELOW) * self.end
            more = searched_words(self.family, x)
            if not more:
                break
            self.end = x
            words += [*more, *self.follow(more)]
        return words


def searched_words(family: Family, x: float) -> list[Word]:
    """Return the short word that a search finds to grow fastest at x, if one grows."""
    A = family.at(x)
    if not np.isfinite(A).all():
        return []
    basis = np.eye(A.shape[-1])
    # Pairs rank numbers, before the best are improved.
    words = growing(A, family.follows, basis, longest=2, changed=1)
    return words[:1]


def seems_refuted(family: Family, x: float, tried: list[Word]) -> bool:
    """Return whether some short word grows at x.

    tried: words that grew in other families, which are tried first; one that is found by searching
    is added.
    """
    A = family.at(x)
    if not np.isfinite(A).all() or growing_of(A, tried):
        return True
    words = searched_words(family, x)
    tried += words
    return bool(words)


def _waiting(rows: list[list[_Ranked]], ends: np.ndarray, designs: np.ndarray | None) -> np.ndarray:
    """Whether words of a row are still to be searched: of designs, only if it may be the best one."""
    waiting = np.array([not all(ranked.searched for ranked in row) for row in rows])
    if designs is not None:
        worst = np.full(designs.max() + 1, np.inf)
        np.minimum.at(worst, designs, ends)
        waiting &= worst[designs] == worst.max()
    return waiting


def least_refuted(
    families: Sequence[Sequence[Family]],
    limits: np.ndarray,
    designs: np.ndarray | None,
    known: Mapping[bytes, list[Word]],
) -> np.ndarray:
    """Return about the least number of each row at which some short word grows, or else its limit.

    families: of each row. limits: `(rows,)`. designs: of which design each row is, if the best
    design alone matters, as its least row tells; then the other rows have upper bounds. known: words
    of the families with the same rule of what may follow what, to which those that are found are
    added.
    """
    rows = []
    for members, limit in zip(families, limits.tolist(), strict=True):
        rows.append([_Ranked(member, limit, known[member.follows.tobytes()]) for member in members])
    every = [ranked for row in rows for ranked in row]
    shortest: dict[bytes, list[Word]] = {}
    for ranked in every:
        follows = ranked.family.follows
        rule = follows.tobytes()
        if rule not in shortest:
            shortest[rule] = short_words(follows)[:60]  # known from the beginning
        ranked.known += ranked.follow([*dict.fromkeys([*shortest[rule], *ranked.known])])
    while True:
        ends = limits.copy()
        for index, row in enumerate(rows):
            ends[index] = min([limits[index], *(ranked.end for ranked in row)])
        waiting = _waiting(rows, ends, designs)
        if not waiting.any():
            return ends
        for ranked in rows[int(np.argmax(waiting))]:
            if ranked.searched:
                continue
            new = [word for word in ranked.search() if word not in ranked.known]
            ranked.known += new
            for other in every if new else ():
                if other is not ranked and other.known is ranked.known:
                    other.follow(new)


def _first_of_grid(
    family: Family, words: Sequence[Word], limit: float
) -> tuple[float, float, list[Word]]:
    """The first of 24 numbers, from a hundredth of the limit on, at which words grow, with the number
    before it and those words, none without one."""
    tried = np.geomspace(1e-2 * limit, limit, 24)
    rates = rates_of(np.array([family.at(x) for x in tried]), words, 1.0)
    growing_at = np.flatnonzero((rates >= 1).any(1))
    if not growing_at.size:
        return limit, limit, []
    first = int(growing_at[0])
    low = float(tried[first - 1]) if first else 0.0
    growing_words = [words[i] for i in np.flatnonzero(rates[first] >= 1).tolist()]
    return low, float(tried[first]), growing_words


def first_growing(family: Family, words: Sequence[Word], limit: float) -> tuple[float, Word]:
    """Return about the least number up to the limit from which on one of some words grows, and that
    word; the limit and () without one.

    They are tried at some numbers first. Between two of these, secants of the logarithm of each
    word's growth tell where it begins.
    """
    if not limit > 0:
        return limit, ()
    low, high, words = _first_of_grid(family, words, limit)
    if not words:
        return limit, ()
    below = _logarithms(family, words, low)
    above = _logarithms(family, words, high)
    grew = False
    for step in range(20):  # steps to where a word begins to grow
        if high - low <= CLOSE * high:
            break
        wide = high - low
        x = low + wide / 2
        if step % MIDDLE_EVERY < MIDDLE_EVERY - 1:
            begins = low - wide * (below / np.maximum(above - below, NEXT_TO_ZERO)).max()  # secant
            # A little beyond the estimate, or short of it: the bracket closes from both sides.
            beside = -CLOSE / 3 * high if grew else CLOSE / 3 * high
            x = np.clip(begins + beside, low + LEAST_STEP * wide, high - LEAST_STEP * wide).item()
        there = _logarithms(family, words, x)
        grow = np.flatnonzero(there >= 0)
        grew = bool(grow.size)
        if grew:
            words = [words[i] for i in grow]
            below = below[grow]
            above = there[grow]
            high = x
        else:
            below = there
            low = x
    return high, words[int(np.argmax(above))]


def _logarithms(family: Family, words: Sequence[Word], x: float) -> np.ndarray:
    """The logarithms of the growth per matrix of words at x, within those of doubles."""
    (rates,) = rates_of(family.at(x)[None], words)
    return np.log(np.clip(rates, NEXT_TO_ZERO, 1 / NEXT_TO_ZERO))
