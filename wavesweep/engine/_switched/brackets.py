"""Whether all products of matrices in any allowed order decay, and the interval of a number for
which they do."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from wavesweep.engine._switched.graph import Family
from wavesweep.engine._switched.norm_check import Norms
from wavesweep.engine._switched.norms import (
    OPERATIONS_OF_SEARCH,
    Centre,
    find_norms,
    finer,
    first_centre,
)
from wavesweep.engine._switched.patterns import (
    Word,
    crossing,
    growing,
    growing_of,
    growth,
    is_refuted,
    nearest,
    places_between,
    refuted_beyond,
    short_words,
    shortest_through,
)
from wavesweep.engine._switched.remembered import Remembered
from wavesweep.engine._switched.stretches import ProvedStretch, covered

PROVED, REFUTED, UNKNOWN = "proved", "refuted", "unknown"
# an end counts as at least this part of its distance from the start, where relative sizes are
# formed
NEAR_START = 0.01
STEPS = 2  # from a number at which words are tried, of `places_between`, to the next one
MORE = 3  # times as many words are searched where no proof is found
# the next number for which norms are searched leaves this part of the way to the refuted one
STRIDE = 0.35
# factor and last value of finer tolerances that follow if cheap, and the work for them
FINER, FINEST, FINE = 3.0, 3e-4, 1e9
# The shortest stretch of a proof that goes on from the start, of one that goes back to what is
# proved, and of several together without a finer graph; relative to the rest of the way or to the
# number itself.
LEAST_CLIMB, LEAST_BACK, LEAST_AGAIN = 0.02, 2e-4, 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """Whether matrices decay in every order that is allowed: "proved", "refuted" or "unknown".

    norms: if proved, those in which all matrices shrink. word: if refuted, the pattern of matrices
    that grows when repeated, in the order in which they act. by: if proved otherwise, in words how.
    """

    verdict: str
    norms: Norms | None = None
    word: Word = ()
    by: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Bracket:
    """The numbers around a start for which a family decays in every order.

    low, high: every number from low to high, both included, is proved; NaN if nothing is, and then
    nothing else is known. refuted_below, refuted_above: the nearest refuted numbers below low and
    above high, NaN if there is none. words: the patterns that refute them, or (). stretches: the
    proof, from low to high without a gap.
    """

    low: float
    high: float
    refuted_below: float
    refuted_above: float
    words: tuple[Word, Word]
    stretches: tuple[ProvedStretch, ...]


def decide(family: Family, x: float = 0.0, work: float = OPERATIONS_OF_SEARCH) -> Decision:
    """Decide whether the matrices of a family at x decay in every order that is allowed.

    work: operations after which the search for norms ends. Accuracy: "proved" and "refuted" hold
    for all matrices within the errors of `Family.enclosed`, with all rounding. Norms and words
    themselves are searched in plain doubles.
    """
    family = Remembered.of(family, [x])
    A = family.at(x)
    centre, _ = first_centre(A, family.follows)
    for word in growing(A, family.follows, centre.basis):
        if is_refuted(family, word, x):
            return Decision(REFUTED, word=word)
    centre, factor = find_norms(A, family.follows, work=work)
    norms = family.proved((x, centre)) if factor == 1 else None
    if norms:
        return Decision(PROVED, *norms)
    for word in growing(A, family.follows, centre.basis, (), MORE, norms=centre.norms):
        if is_refuted(family, word, x):
            return Decision(REFUTED, word=word)
    return Decision(UNKNOWN)


def bracket(
    family: Family,
    start: float,
    limits: tuple[float, float],
    tolerance: float = 0.01,
    work: float = OPERATIONS_OF_SEARCH,
    report: Callable[[float, float, float], None] = lambda *_: None,
) -> Bracket:
    """Return the numbers around a start, within limits, for which a family decays in every order
    that is allowed.

    tolerance: the distance between proof and refutation that is aimed at, relative to the refuted
    number, or to NEAR_START of its distance from the start if that is larger. work: operations for
    each end after which the search for norms ends. report: is called with the lowest and the highest
    number that are proved so far, and the percentage of the way up or down at which the proof is.

    The proof holds for every number from `low` to `high`, not only for those that were computed,
    see `shrink_along`. A refuted number says nothing about numbers beyond it.
    """
    # Of the way to the limits, where it is seen what frames forget.
    nearby = [start + 0.1 * (limit - start) for limit in limits]
    family = Remembered.of(family, (start, *nearby))
    unknown = Bracket(np.nan, np.nan, np.nan, np.nan, ((), ()), ())
    A = family.at(start)
    if growing_of(A, short_words(family.follows)):
        return unknown
    first, factor = find_norms(A, family.follows, work=work)
    if factor < 1:
        return unknown

    def up(reached, share):
        report(start, reached, share)

    def down(reached, share):
        report(reached, above.end, share)

    above = _side(_Way(family, start, limits[1], tolerance, report=up), first, work)
    near = tolerance**2 * abs(above.end - start)
    below = _side(_Way(family, start, limits[0], tolerance, near, down), first, work)
    stretches = sorted((*below.stretches, *above.stretches), key=lambda stretch: stretch.low)
    return Bracket(
        float(below.end),
        float(above.end),
        float(below.fails),
        float(above.fails),
        (below.word, above.word),
        tuple(stretches),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """The way of a family from a start to a limit, which counts as reached from the distance
    `near` on. tolerance: see `bracket`. report: is called with the number that is reached, and the
    percentage of the way to the goal."""

    family: Remembered
    start: float
    limit: float
    tolerance: float
    near: float = 0.0
    report: Callable[[float, float], None] = lambda *_: None

    def tell(self, reached: float, goal: float) -> None:
        """Report what is reached on the way to a goal."""
        if goal != self.start:
            self.report(reached, 100 * (reached - self.start) / (goal - self.start))

    def size(self, end: float) -> float:
        """The size of a number, to which distances from it are compared."""
        return max(abs(end), NEAR_START * abs(end - self.start))

    def inside(self, end: float, share: float) -> float:
        """The number closer to the start by a share of the end's size, but by at most half of
        the way."""
        back = min(share * self.size(end), abs(end - self.start) / 2)
        return end + np.sign(self.start - end) * back

    def short_of(self, end: float) -> float:
        """The number short of an end up to which a proof is tried."""
        # Distance of a first proof from the refuted number, relative to the tolerance.
        return self.inside(end, 0.93 * self.tolerance)

    def farther(self, one: float, other: float) -> float:
        """The one of two numbers that is farther from the start."""
        if abs(one - self.start) > abs(other - self.start):
            return one
        return other

    def tries_long_words(self, x: float) -> bool:
        """Whether words of more matrices are searched at a number: a power of 2, or the last."""
        return math.frexp(x)[0] in (0.5, -0.5) or self.farther(x, self.limit) == x

    def grown(
        self, x: float, centre: Centre, word: Word, more: int = 1
    ) -> tuple[float, Word] | None:
        """The refuted number closest to the start of words that grow at x, and its word; None if
        none is found."""
        A = self.family.at(x)
        first = [word] if word else []
        words = growing(A, self.family.follows, centre.basis, first, more, norms=centre.norms)
        found = _first(self.family, words, self.start, x, x)
        return found if found[1] else None

    def aim(self, reached: float, goal: float, fails: float, ceiling: float | None) -> float:
        """The next number for which norms are searched: short of the refuted one by STRIDE of
        what is left, or half of the way to one without norms, but not beyond the goal."""
        if ceiling is not None:
            aim = (reached + ceiling) / 2
        elif np.isnan(fails):
            return goal
        else:
            aim = fails - STRIDE * (fails - reached)
        if abs(aim - self.start) < abs(goal - self.start):
            return aim
        return goal


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """What is proved and refuted on one side: the end of the proof and its stretches, the nearest
    refuted number with its word, and the last forms."""

    end: float
    fails: float
    word: Word
    stretches: tuple[ProvedStretch, ...]
    centre: Centre


def _side(way: _Way, first: Centre, work: float) -> _Side:
    """What is proved and refuted from the start towards the limit.

    first: forms for the start. They need few nodes, and the proof goes as far as it can with them.
    Then norms are searched for a number further on, and the proof goes back from there to what is
    already proved; and so on. Each search begins with the least graph: one that was refined for
    other numbers takes up to three times the nodes.
    """
    family = way.family
    tolerance = way.tolerance
    fails, word = nearest_refuted(family, way.start, way.limit, tolerance)
    goal = way.short_of(fails) if word else way.limit
    begun = replace(first, work=0.0)
    stretches, reached, climbed = covered(family, begun, way.start, goal, LEAST_CLIMB, work)
    way.tell(reached, goal)
    spent = climbed.work
    centre = first
    ceiling = None  # a number for which no norms were found
    before = way.start  # where the proof was when a ceiling was given up
    # After 90 % of the work no more norms are searched.
    while reached != goal and spent < 0.9 * work:
        if not word and abs(way.limit - reached) <= way.near:
            break
        if ceiling is not None and abs(ceiling - reached) <= tolerance / 2 * way.size(reached):
            if word or abs(reached - before) <= tolerance * way.size(reached):
                break
            ceiling, before = None, reached  # once more, from nearer to the limit
        aim = way.aim(reached, goal, fails, ceiling)
        nearer = way.grown(aim, centre, word)
        if nearer is None or way.farther(nearer[0], reached) == reached:
            A = family.at(aim)
            most = (work - spent) / 4  # a quarter: a search for norms that do not exist ends soon
            centre, factor = find_norms(A, family.follows, work=most)
            further, used = _back(family, centre, factor, aim, reached, work - spent)
            spent += used
            if further:
                stretches = (*stretches, *further)
                reached = aim
                way.tell(reached, goal)
                continue
            nearer = way.grown(aim, centre, word, MORE)
            if nearer is None and word:
                nearer = way.grown((aim + fails) / 2, centre, word, MORE)
        if nearer is not None and way.farther(nearer[0], reached) != reached:
            fails, word = nearer
            goal = way.farther(way.short_of(fails), reached)
            ceiling = None
        elif aim == way.limit:
            goal = way.farther(way.short_of(aim), reached)
        else:
            ceiling = aim
    side = _Side(reached, fails, word, stretches, centre)
    if not word:
        return side
    if abs(fails - reached) <= tolerance * way.size(fails):
        side = _refined(way, side)
    else:
        side = _nearer(way, side)
    return replace(side, fails=nearest(family, side.word, way.start, side.fails))


def _nearer(way: _Way, side: _Side) -> _Side:
    """The side with the words that grow next to the refuted number, as a decision at a single
    number looks for them: on walks in norms that are found there."""
    x = way.inside(side.fails, FINEST)
    centre, factor = find_norms(way.family.at(x), way.family.follows, work=FINE)
    nearer = way.grown(x, centre, side.word, MORE) if factor < 1 else None
    if nearer is None or way.farther(nearer[0], side.end) == side.end:
        return side
    return replace(side, fails=nearer[0], word=nearer[1])


def _refined(way: _Way, side: _Side) -> _Side:
    """The side with proof and refutation closer together, as far as this costs little."""
    family = way.family
    gap = way.tolerance
    spent = 0.0
    while gap > FINEST and spent < FINE:
        gap /= FINER
        nearer = way.grown(way.inside(side.fails, gap), side.centre, side.word)
        if nearer:
            side = replace(side, fails=nearer[0], word=nearer[1])
        aim = way.inside(side.fails, gap)
        if way.farther(aim, side.end) == side.end:
            continue
        centre, factor = find_norms(family.at(aim), family.follows, side.centre, FINE - spent)
        further, used = _back(family, centre, factor, aim, side.end, FINE - spent)
        spent += used
        if not further:
            break
        side = replace(side, end=aim, centre=centre, stretches=(*side.stretches, *further))
    return side


def _back(
    family: Remembered, centre: Centre, factor: float, aim: float, reached: float, work: float
) -> tuple[tuple[ProvedStretch, ...], float]:
    """The stretches from a number back to what is proved, () if a gap remains, and the work.

    centre, factor: the result of the search for norms at that number. Where a stretch cannot be
    made longer, norms are searched again, on a finer graph if that has not helped before.
    """
    used = centre.work
    if factor != 1:
        return (), used
    if family.proved((aim, centre)) is None:
        return (), used  # rounding leaves no room, and a finer graph gives none
    stretches = ()
    at = aim
    fruitless = 0
    # Finer graphs without a longer stretch, after which rounding leaves no room.
    while factor == 1 and used < work and fruitless < 3:
        begun = replace(centre, work=0.0)
        further, far, last = covered(family, begun, at, reached, LEAST_BACK, work - used)
        stretches += further
        used += last.work
        if far == reached:
            return stretches, used
        fruitless = 0 if further else fruitless + 1
        stalled = abs(far - at) <= LEAST_AGAIN * abs(far - reached)
        at = far
        try:
            centre = finer(last, family.at(at), family.follows) if stalled else last
        except np.linalg.LinAlgError:
            break
        if centre is None:
            break
        centre, factor = find_norms(family.at(at), family.follows, centre, (work - used) / 2)
        used += centre.work
    return (), used


def nearest_refuted(
    family: Family, start: float, limit: float, tolerance: float, known: Sequence[Word] = ()
) -> tuple[float, Word]:
    """Return the refuted number closest to the start that a search finds, and its word; NaN and
    () if there is none.

    known: words that refute other families of the same symbols. Where one of them grows, others are
    looked for from there.
    """
    way = _Way(family, start, limit, tolerance)
    fails, word = _first_refuted(way, known)
    if not word:
        return fails, word
    # Of a refuted number, how far back words are searched that may decay again next to it.
    for share in (0.3, 0.1, 0.03, tolerance / 4):
        # Rounds of the search for words that refute a number closer to the start.
        for _ in range(8):
            x = way.inside(fails, share)
            centre, _ = first_centre(family.at(x), family.follows)
            nearer = way.grown(x, centre, word)
            if not nearer:
                break
            fails, word = nearer
    return nearest(family, word, start, fails), word


def _first_refuted(way: _Way, known: Sequence[Word]) -> tuple[float, Word]:
    """The refuted number of the first words that grow on the way, the known ones before others, and
    its word; NaN and () if none grows."""
    family = way.family
    follows = family.follows
    short = list(dict.fromkeys((*short_words(follows), *shortest_through(follows))))
    for place, ahead in places_between(way.start, way.limit):
        steps = np.linspace(place, ahead, 1 + STEPS)
        for before, x in pairwise(steps.tolist()):
            if (x - way.start) * (way.limit - way.start) <= 0:
                continue
            A = family.at(x)
            grows = growing_of(A, [*known, *short])
            if not grows and x == ahead and way.tries_long_words(x):
                centre, _ = first_centre(A, follows)
                grows = growing(A, follows, centre.basis)
            found = _first(family, grows, before, x, x)
            if found[1]:
                return found if way.farther(found[0], way.limit) == way.limit else (np.nan, ())
    return np.nan, ()


def _first(
    family: Family, words: Sequence[Word], stable: float, unstable: float, limit: float
) -> tuple[float, Word]:
    """The refuted number closest to `stable` of words that grow at `unstable`, and its word; NaN
    and () if none is proved."""
    best = np.nan, ()
    for word in words[:8]:  # words whose crossings are computed
        if best[1] and growth(family.at(best[0]), word) < 1:
            continue
        end = best[0] if best[1] else unstable
        at = refuted_beyond(family, word, crossing(family, word, stable, end), limit)
        if at is not None:
            best = at, word
        elif not best[1] and is_refuted(family, word, unstable):
            best = float(unstable), word
    return best
