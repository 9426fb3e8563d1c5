"""Whether all products of matrices in any allowed order decay, and the interval of a number for
which they do."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

import numpy as np

from wavesweep.engine._switched.brackets import (
    Bracket,
    Refuted,
    driven,
    first_refuted,
    nearest_of,
    short_of,
    size_of,
)
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
    growing,
    growing_of,
    is_refuted,
    nearest,
    short_words,
    shortest_through,
)
from wavesweep.engine._switched.remembered import Remembered
from wavesweep.engine._switched.stretches import ProvedStretch, covered

SHORT = 0.93  # of the tolerance, how far from the refuted number a first proof ends
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


class Verdict(StrEnum):
    """What is known of all members of a set."""

    PROVED = "proved"
    REFUTED = "refuted"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """Whether matrices decay in every order that is allowed.

    norms: if proved, those in which all matrices shrink. word: if refuted, the pattern of matrices
    that grows when repeated, in the order in which they act. by: if proved otherwise, in words how.
    """

    verdict: Verdict
    norms: Norms | None = None
    word: Word = ()
    by: str = ""


def decide(family: Family, x: float = 0.0, work: float = OPERATIONS_OF_SEARCH) -> Decision:
    """Decide whether the matrices of a family at x decay in every order that is allowed.

    work: operations after which the search for norms ends. Accuracy: "proved" and "refuted" hold
    for all matrices within the errors of `Family.enclosed`, with all rounding. Norms and words
    themselves are searched in plain doubles.
    """
    remembered = Remembered.of(family, [x])
    A = remembered.at(x)
    centre, _ = first_centre(A, remembered.follows)
    for word in growing(A, remembered.follows, centre.basis):
        if is_refuted(remembered, word, x):
            return Decision(Verdict.REFUTED, word=word)
    centre, factor = find_norms(A, remembered.follows, work=work)
    norms = remembered.proved((x, centre)) if factor == 1 else None
    if norms:
        return Decision(Verdict.PROVED, norms[0])
    for word in growing(A, remembered.follows, centre.basis, (), MORE, norms=centre.norms):
        if is_refuted(remembered, word, x):
            return Decision(Verdict.REFUTED, word=word)
    return Decision(Verdict.UNKNOWN)


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

    tolerance: the distance between proof and refutation that is aimed at, see `size_of`. work:
    operations for each end after which the search for norms ends. report: is called with the lowest
    and the highest number that are proved so far, and the percentage of the way up or down at which
    the proof is.

    The proof holds for every number from `low` to `high`, not only for those that were computed,
    see `shrink_along`. A refuted number says nothing about numbers beyond it.
    """
    # Of the way to the limits, where it is seen what frames forget.
    nearby = [start + 0.1 * (limit - start) for limit in limits]
    remembered = Remembered.of(family, (start, *nearby))
    A = remembered.at(start)
    if growing_of(A, short_words(remembered.follows)):
        return Bracket(np.nan, np.nan)
    first, factor = find_norms(A, remembered.follows, work=work)
    if factor < 1:
        return Bracket(np.nan, np.nan)
    up = _Way(remembered, start, limits[1], tolerance, work, first, partial(report, start))
    high, above = up.side()
    near = tolerance**2 * abs(high - start)

    def told(reached: float, share: float) -> None:
        report(reached, high, share)

    down = _Way(remembered, start, limits[0], tolerance, work, first, told, near)
    low, below = down.side()
    stretches = sorted((*down.stretches, *up.stretches), key=lambda stretch: stretch.low)
    return Bracket(float(low), float(high), below, above, tuple(stretches))


@dataclass(slots=True, eq=False)
class _Way:
    """The way of a family from a start to a limit, which counts as reached from the distance
    `near` on.

    tolerance, work: see `bracket`. report: is called with the number that is reached, and the
    percentage of the way to the goal. centre: the last forms, at first those for the start.
    stretches: what is proved; spent: operations for it.
    """

    family: Remembered
    start: float
    limit: float
    tolerance: float
    work: float
    centre: Centre
    report: Callable[[float, float], None]
    near: float = 0.0
    stretches: tuple[ProvedStretch, ...] = ()
    spent: float = 0.0

    def side(self) -> tuple[float, Refuted]:
        """The number that is proved, and what is refuted beyond it, as near to each other as costs
        little."""
        family = self.family
        refuted = nearest_refuted(family, self.start, self.limit, self.tolerance)
        share = SHORT * self.tolerance
        reached, refuted = driven(self.start, self.limit, share, refuted, self.proof)
        if not refuted.word:
            return reached, refuted
        if abs(refuted.x - reached) <= self.tolerance * size_of(refuted.x, self.start):
            reached, refuted = self.refined(reached, refuted)
        else:
            # Words that grow next to the refuted number, as a decision at a single number looks for
            # them: on walks in norms that are found there.
            x = short_of(refuted.x, self.start, FINEST)
            self.centre, factor = find_norms(family.at(x), family.follows, work=FINE)
            nearer = self.grown(x, refuted.word, MORE) if factor < 1 else Refuted()
            refuted = nearer if nearer.word else refuted
        x = nearest(family, refuted.word, self.start, refuted.x)
        return reached, replace(refuted, x=float(x))

    def proof(self, reached: float, goal: float, refuted: Refuted) -> tuple[float, Refuted]:
        """See `Proof`.

        Forms for the start need few nodes, and the proof goes as far as it can with them. Then norms
        are searched for a number further on, and the proof goes back from there to what is already
        proved; and so on. Each search begins with the least graph: one that was refined for other
        numbers takes up to three times the nodes.

        A number for which neither norms nor a word are found is a ceiling: the next search is
        half-way to it, until half of the tolerance is left. If nothing is refuted, the ceiling is
        then dropped, once for each tolerance that the proof has gone on. If it is the limit for
        which none are found, the goal is a little short of that from then on.
        """
        family = self.family
        word = refuted.word
        if not self.spent:
            begun = replace(self.centre, work=0.0)
            self.stretches, reached, climbed = covered(
                family, begun, reached, goal, LEAST_CLIMB, self.work
            )
            self.spent = climbed.work
            self.tell(reached, goal)
        ceiling = None  # a number for which no norms were found
        before = self.start  # where the proof was when a ceiling was given up
        # After 90 % of the work no more norms are searched.
        while reached != goal and self.spent < 0.9 * self.work:
            if not word and abs(self.limit - reached) <= self.near:
                break
            resolved = self.tolerance * size_of(reached, self.start)
            if ceiling is not None and abs(ceiling - reached) <= resolved / 2:
                if word or abs(reached - before) <= resolved:
                    break
                ceiling, before = None, reached  # once more, from nearer to the limit
            aim = self.aim(reached, goal, refuted.x, ceiling)
            nearer = self.grown(aim, word)
            if not nearer.word:
                # A quarter: a search for norms that do not exist ends soon.
                work_of_search = (self.work - self.spent) / 4
                self.centre, factor = find_norms(
                    family.at(aim), family.follows, work=work_of_search
                )
                further, used = _back(
                    family, self.centre, factor, aim, reached, self.work - self.spent
                )
                self.spent += used
                if further:
                    self.stretches += further
                    reached = aim
                    self.tell(reached, goal)
                    continue
                nearer = self.grown(aim, word, MORE)
                if word and not nearer.word:  # or between that number and what is refuted
                    nearer = self.grown((aim + refuted.x) / 2, word, MORE)
            if nearer.word:
                return reached, nearer
            if aim == self.limit:
                short = short_of(aim, self.start, SHORT * self.tolerance)
                goal = max(short, reached, key=lambda x: abs(x - self.start))
            else:
                ceiling = aim
        return reached, Refuted()

    def refined(self, reached: float, refuted: Refuted) -> tuple[float, Refuted]:
        """Proof and refutation closer together, as far as this costs little."""
        family = self.family
        gap = self.tolerance
        spent = 0.0
        while gap > FINEST and spent < FINE:
            gap /= FINER
            nearer = self.grown(short_of(refuted.x, self.start, gap), refuted.word)
            refuted = nearer if nearer.word else refuted
            aim = short_of(refuted.x, self.start, gap)
            if abs(aim - self.start) <= abs(reached - self.start):
                continue
            centre, factor = find_norms(family.at(aim), family.follows, self.centre, FINE - spent)
            further, used = _back(family, centre, factor, aim, reached, FINE - spent)
            spent += used
            if not further:
                break
            reached = aim
            self.centre = centre
            self.stretches += further
        return reached, refuted

    def tell(self, reached: float, goal: float) -> None:
        """Report what is reached on the way to a goal."""
        if goal != self.start:
            self.report(reached, 100 * (reached - self.start) / (goal - self.start))

    def grown(self, x: float, word: Word, more: int = 1) -> Refuted:
        """The refuted number closest to the start of words that grow at x, if one is found."""
        follows = self.family.follows
        first = [word] if word else []
        norms = self.centre.norms
        words = growing(self.family.at(x), follows, self.centre.basis, first, more, norms=norms)
        return first_refuted(self.family, words, [self.start], x)

    def aim(self, reached: float, goal: float, fails: float, ceiling: float | None) -> float:
        """The next number for which norms are searched: short of the refuted one by STRIDE of
        what is left, or half of the way to one without norms, but not beyond the goal."""
        if ceiling is not None:
            aim = (reached + ceiling) / 2
        elif np.isnan(fails):
            return goal
        else:
            aim = fails - STRIDE * (fails - reached)
        return min(aim, goal, key=lambda x: abs(x - self.start))


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
    stretches: tuple[ProvedStretch, ...] = ()
    end = aim
    fruitless = 0
    # Finer graphs without a longer stretch, after which rounding leaves no room.
    while factor == 1 and used < work and fruitless < 3:
        begun = replace(centre, work=0.0)
        further, far, last = covered(family, begun, end, reached, LEAST_BACK, work - used)
        stretches += further
        used += last.work
        if far == reached:
            return stretches, used
        fruitless = 0 if further else fruitless + 1
        stalled = abs(far - end) <= LEAST_AGAIN * abs(far - reached)
        end = far
        try:
            next_centre = finer(last, family.at(end), family.follows) if stalled else last
        except np.linalg.LinAlgError:
            break
        if next_centre is None:
            break
        centre, factor = find_norms(family.at(end), family.follows, next_centre, (work - used) / 2)
        used += centre.work
    return (), used


def nearest_refuted(
    family: Family, start: float, limit: float, tolerance: float, words: Sequence[Word] = ()
) -> Refuted:
    """Return the refuted number closest to the start that a search finds, if it finds one.

    words: words that refute other families of the same symbols. Where one of them grows, others are
    looked for from there.
    """
    follows = family.follows
    short = list(dict.fromkeys((*words, *short_words(follows), *shortest_through(follows))))

    def grown(x: float, like: Word, many: bool) -> list[Word]:
        A = family.at(x)
        grows = [] if like else growing_of(A, short)
        # Words of more matrices are searched at powers of 2, and at the last number.
        is_last = abs(x - start) > abs(limit - start) or x == limit
        if like or (not grows and many and (math.frexp(x)[0] in (0.5, -0.5) or is_last)):
            centre, _ = first_centre(A, follows)
            first = [like] if like else []
            grows = growing(A, follows, centre.basis, first, norms=centre.norms if like else None)
        return grows

    # Of a refuted number, how far back words are searched that may decay again next to it.
    back = (0.3, 0.1, 0.03, tolerance / 4)
    refuted = nearest_of(family, start, limit, STEPS, grown, back)
    if not refuted.word:
        return refuted
    return Refuted(nearest(family, refuted.word, start, refuted.x), refuted.word)
