"""Whether all products of matrices in any allowed order decay, and the interval of a number for
which they do."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.for_all.graph import Family
from wavesweep.for_all.norm_check import Norms, shrink_along
from wavesweep.for_all.norms import (
    OPERATIONS_OF_SEARCH,
    Centre,
    advanced,
    find_norms,
    finer,
    first_centre,
)
from wavesweep.for_all.patterns import (
    Word,
    crossing,
    growing,
    growing_of,
    growth,
    is_refuted,
    nearest,
    refuted_beyond,
    short_words,
    shortest_through,
)
from wavesweep.for_all.remembered import Remembered

PROVED, REFUTED, UNKNOWN = "proved", "refuted", "unknown"
# distance of a first proof from the refuted number, relative to the tolerance
FIRST_PROOF_AT = 0.93
# an end counts as at least this part of its distance from the start, where relative sizes are
# formed
NEAR_START = 0.01
NEARBY = 0.1  # of the way to the limits, numbers at which is seen what frames forget
NUMBERS_SCANNED = 48  # numbers between the start and the limit at which short words are tried
LONG_WORDS_EVERY = 12  # long words are searched at one of so many of these
WORDS_TRIED = 8  # words whose crossings are computed
BACK = (
    0.3,
    0.1,
    0.03,
)  # of a refuted number, how far back words are searched that may decay again next to it
# of the search for words that refute a number closer to the start, from each of these
WORD_ROUNDS = 8
MORE = 3  # times as many words are searched where no proof is found
SPENT = 0.9  # part of the work after which no more norms are searched
# into which the work that is left is divided: one for norms that do not exist ends soon
WORD_SEARCHES = 4
# the next number for which norms are searched leaves this part of the way to the refuted one
STRIDE = 0.35
FINER, FINEST, FINE = (
    3.0,
    3e-4,
    1e9,
)  # factor and last value of finer tolerances that follow if cheap, and the work for them
FRUITLESS = 3  # finer graphs without a longer stretch, after which rounding leaves no room
NORMS_A_SIDE = 300  # norms for one side of the start
# The shortest stretch of a proof that goes on from the start, of one that goes back to what is
# proved, and of several together without a finer graph; relative to the rest of the way or to the
# number itself.
LEAST_CLIMB, LEAST_BACK, LEAST_AGAIN = 0.02, 2e-4, 0.02
SHORTEST, SHORTEST_LEFT = (
    1e-7,
    1e-3,
)  # relative to the whole way: a stretch, and the least rest to which it is compared


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """Whether matrices decay in every order that is allowed: "proved", "refuted" or "unknown".

    norms: if proved, those in which all matrices shrink. word: if refuted, the pattern of matrices
    that grows when repeated, in the order in which they act.
    """

    verdict: str
    norms: Norms | None = None
    word: Word = ()


@dataclass(frozen=True, slots=True, eq=False)
class ProvedStretch:
    """An interval of numbers for which the matrices shrink in norms that lie between those of
    its ends, see `shrink_along`."""

    low: float
    high: float
    norms: tuple[Norms, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Bracket:
    """The numbers around a start for which a family decays in every order.

    low, high: every number from low to high, both included, is proved; NaN if nothing is, and then
    nothing else is known. fails_below, fails_from: the nearest refuted numbers below low and above
    high, NaN if there is none. words: the patterns that refute them, or (). settled: whether each
    end is within the tolerance of the refuted number, or of the limit that was asked for, the low
    one also if it is within the square of the tolerance, relative to the high one, since at 0 many
    loops do not decay. stretches: the proof, from low to high without a gap.
    """

    low: float
    high: float
    fails_below: float
    fails_from: float
    words: tuple[Word, Word]
    settled: bool
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
    if factor == 1 and (norms := _proved(family, (x,), (centre,))):
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
) -> Bracket:
    """Return the numbers around a start, within limits, for which a family decays in every order
    that is allowed.

    tolerance: the distance between proof and refutation that is aimed at, relative to the refuted
    number, or to NEAR_START of its distance from the start if that is larger. work: operations for
    each end after which the search for norms ends.

    The proof holds for every number from `low` to `high`, not only for those that were computed,
    see `shrink_along`. A refuted number says nothing about numbers beyond it.
    """
    family = Remembered.of(family, (start, *(start + NEARBY * (limit - start) for limit in limits)))
    A = family.at(start)
    first, factor = (
        (None, 0.0)
        if growing_of(A, short_words(family.follows))
        else find_norms(A, family.follows, work=work)
    )
    if factor < 1:
        return Bracket(np.nan, np.nan, np.nan, np.nan, ((), ()), False, ())
    above = _side(family, start, limits[1], tolerance, first, work)
    below = _side(
        family, start, limits[0], tolerance, first, work, tolerance**2 * abs(above.end - start)
    )
    return Bracket(
        float(below.end),
        float(above.end),
        float(below.fails),
        float(above.fails),
        (below.word, above.word),
        bool(below.settled and above.settled),
        tuple(sorted((*below.stretches, *above.stretches), key=lambda stretch: stretch.low)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    end: float
    fails: float
    word: Word
    settled: bool
    stretches: tuple[ProvedStretch, ...]
    centre: Centre


def _side(family, start, limit, tolerance, first, work, near=0.0):
    """What is proved and refuted from the start towards a limit, which counts as reached from the
    distance `near` on.

    first: forms for the start. They need few nodes, and the proof goes as far as it can with them.
    Then norms are searched for a number further on, and the proof goes back from there to what is
    already proved; and so on. Each search begins with the least graph: one that was refined for
    other numbers takes up to three times the nodes.
    """
    fails, word = nearest_refuted(family, start, limit, tolerance)
    goal = _inside(fails, start, FIRST_PROOF_AT * tolerance) if word else limit
    stretches, reached, climbed = _covered(
        family, replace(first, work=0.0), start, goal, LEAST_CLIMB, work
    )
    # ceiling: a number for which no norms were found.
    spent, centre, ceiling, before = climbed.work, None, None, start
    while reached != goal and (word or abs(limit - reached) > near) and spent < SPENT * work:
        if ceiling is not None and abs(ceiling - reached) <= tolerance / 2 * _scale(reached, start):
            if word or abs(reached - before) <= tolerance * _scale(reached, start):
                break
            ceiling, before = None, reached  # once more, from nearer to the limit
        aim = fails - STRIDE * (fails - reached) if word else goal
        aim = aim if ceiling is None else (reached + ceiling) / 2
        aim = aim if abs(aim - start) < abs(goal - start) else goal
        nearer = _grown(family, start, aim, centre or first, word)
        if nearer and abs(nearer[0] - start) > abs(reached - start):
            (fails, word), ceiling = nearer, None
            goal = _farther(_inside(fails, start, FIRST_PROOF_AT * tolerance), reached, start)
            continue
        centre, factor = find_norms(
            family.at(aim), family.follows, work=(work - spent) / WORD_SEARCHES
        )
        further, used = _back(family, centre, factor, aim, reached, work - spent)
        spent += used
        if further:
            stretches, reached = (*stretches, *further), aim
            continue
        tried = (aim, (aim + fails) / 2) if word else (aim,)
        nearer = next(
            filter(None, (_grown(family, start, x, centre, word, MORE) for x in tried)), None
        )
        if nearer and abs(nearer[0] - start) > abs(reached - start):
            (fails, word), ceiling = nearer, None
            goal = _farther(_inside(fails, start, FIRST_PROOF_AT * tolerance), reached, start)
        elif aim == limit:
            goal = _farther(_inside(limit, start, FIRST_PROOF_AT * tolerance), reached, start)
        else:
            ceiling = aim
    side = _Side(reached, fails, word, False, stretches, centre or first)
    if word and abs(fails - reached) <= tolerance * _scale(fails, start):
        side = _refined(family, side, start, tolerance)
    if word:
        side = replace(side, fails=nearest(family, side.word, start, side.fails))
    end = side.fails if word else limit
    return replace(
        side,
        settled=abs(end - side.end) <= max(tolerance * _scale(end, start), 0.0 if word else near),
    )


def _refined(family, side, start, tolerance):
    """The side with proof and refutation closer together, as far as this costs little."""
    gap, spent = tolerance, 0.0
    while gap > FINEST and spent < FINE:
        gap /= FINER
        aim = _inside(side.fails, start, gap)
        fails, word = _grown(family, start, aim, side.centre, side.word) or (side.fails, side.word)
        side, aim = replace(side, fails=fails, word=word), _inside(fails, start, gap)
        if abs(aim - start) <= abs(side.end - start):
            continue
        centre, factor = find_norms(family.at(aim), family.follows, side.centre, FINE - spent)
        further, used = _back(family, centre, factor, aim, side.end, FINE - spent)
        spent += used
        if not further:
            break
        side = replace(side, end=aim, centre=centre, stretches=(*side.stretches, *further))
    return side


def _back(family, centre, factor, aim, reached, work):
    """The stretches from a number back to what is proved, () if a gap remains, and the work.

    centre, factor: the result of the search for norms at that number. Where a stretch cannot be
    made longer, norms are searched again, on a finer graph if that has not helped before.
    """
    stretches, at, used, fruitless = (), aim, centre.work, 0
    if factor == 1 and not _proved(
        family, (aim,), (centre,)
    ):  # rounding leaves no room, and a finer graph gives none
        return (), used
    while factor == 1 and used < work and fruitless < FRUITLESS:
        further, far, last = _covered(
            family, replace(centre, work=0.0), at, reached, LEAST_BACK, work - used
        )
        stretches, used = (*stretches, *further), used + last.work
        if far == reached:
            return stretches, used
        fruitless = 0 if further else fruitless + 1
        stalled, at = abs(far - at) <= LEAST_AGAIN * abs(far - reached), far
        try:
            centre = finer(last, family.at(at), family.follows) if stalled else last
        except np.linalg.LinAlgError:
            break
        if centre is None:
            break
        centre, factor = find_norms(family.at(at), family.follows, centre, (work - used) / 2)
        used += centre.work
    return (), used


def _farther(one, other, start):
    return one if abs(one - start) > abs(other - start) else other


def _scale(end, start):
    return max(abs(end), NEAR_START * abs(end - start))


def _inside(end, start, share):
    """The number closer to the start by a share of the end's size, but by at most half of the
    way."""
    return end + np.sign(start - end) * min(share * _scale(end, start), abs(end - start) / 2)


def nearest_refuted(
    family: Family, start: float, limit: float, tolerance: float
) -> tuple[float, Word]:
    """Return the refuted number closest to the start that a search finds, and its word; NaN and
    () if there is none."""
    fails, word, before = np.nan, (), start
    short = [*dict.fromkeys((*short_words(family.follows), *shortest_through(family.follows)))]
    for i, x in enumerate(start + (limit - start) * np.geomspace(1e-4, 1.0, NUMBERS_SCANNED)):
        A = family.at(x)
        grows = growing_of(A, short)
        if not grows and i % LONG_WORDS_EVERY == LONG_WORDS_EVERY - 1:
            grows = growing(A, family.follows, first_centre(A, family.follows)[0].basis)
        if grows:
            fails, word = _first(family, grows, before, x, limit)
            break
        before = x
    for share in (*BACK, tolerance / 4) if word else ():
        for _ in range(WORD_ROUNDS):
            x = _inside(fails, start, share)
            nearer = _grown(family, start, x, first_centre(family.at(x), family.follows)[0], word)
            if not nearer:
                break
            fails, word = nearer
    return nearest(family, word, start, fails) if word else fails, word


def _grown(family, start, x, centre, word=(), more=1):
    """The refuted number closest to the start of words that grow at x, and its word; None if
    none is found."""
    words = growing(
        family.at(x), family.follows, centre.basis, [word] if word else [], more, norms=centre.norms
    )
    found = _first(family, words, start, x, x)
    return found if found[1] else None


def _first(family, words, stable, unstable, limit):
    """The refuted number closest to `stable` of words that grow at `unstable`, and its word; NaN
    and () if none is proved."""
    best = np.nan, ()
    for word in words[:WORDS_TRIED]:
        if best[1] and growth(family.at(best[0]), word) < 1:
            continue
        end = best[0] if best[1] else unstable
        at = refuted_beyond(family, word, crossing(family, word, stable, end), limit)
        if at is not None:
            best = at, word
        elif not best[1] and is_refuted(family, word, unstable):
            best = float(unstable), word
    return best


def _proved(family, ends, centres):
    """Norms of all states by the forms of the centres at one number or at two, low and high, if
    they are proved to be norms for it or for all numbers between them; or None."""
    points = family.hull(ends[0], ends[-1])
    if points is None:
        return None
    norms = tuple(
        family.norms(centre, points[0][[at]]) for centre, at in zip(centres, (0, -1), strict=False)
    )
    return norms if None not in norms and shrink_along(norms, *points, family.follows) else None


def _covered(family, centre, start, goal, least, work):
    """Stretches without a gap from the start towards the goal, the number that they reach, and the
    last forms.

    The centres of all forms are followed from number to number, and a stretch goes from one to the
    next. least: the shortest stretch, relative to the rest of the way. work: operations after which
    this ends.
    """
    stretches, end = [], start
    while end != goal and len(stretches) < NORMS_A_SIDE and centre.work < work:
        share = least * min(abs(goal - end), max(abs(end), SHORTEST_LEFT * abs(goal - start)))
        shortest, target = max(share, SHORTEST * abs(goal - start)), goal
        norms, ahead = None, centre
        while norms is None and ahead.work < work:
            try:
                ahead, x = advanced(replace(centre, work=ahead.work), family.at, end, target)
                ahead = ahead.rounded()
            except np.linalg.LinAlgError:
                break
            if abs(x - end) < min(shortest, abs(goal - end)) or x == end:
                break
            ends, centres = ((end, x), (centre, ahead)) if end < x else ((x, end), (ahead, centre))
            norms, target = _proved(family, ends, centres), (x + end) / 2
        centre = replace(centre, work=ahead.work)
        if norms is None:
            break
        stretches.append(ProvedStretch(*ends, norms))
        end, centre = x, ahead
    return tuple(stretches), end, centre
