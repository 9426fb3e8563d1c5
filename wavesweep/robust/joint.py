"""Whether matrices that are applied in any order let everything decay, and the numbers for which they do."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from wavesweep.robust.checking import Norms, shrink
from wavesweep.robust.family import Family
from wavesweep.robust.norms import WORK, Centre, advanced, finer, first_centre, found
from wavesweep.robust.words import KEPT, LONGEST, Word, crossing, growing, growth, is_refuted, refuted_beyond

PROVED, REFUTED, UNKNOWN = "proved", "refuted", "unknown"
WITHIN = 0.93  # of the tolerance, how near to a number that is refuted a proof is tried first
NEAR_START = 0.01  # of the distance from the start to an end, which stands for the end's own size if that is smaller
SCANNED = 48  # numbers at which short words are looked at, between the start and the limit
EVERY = 12  # of these, at which long ones are looked for
TRIED = 8  # words whose crossings are computed
ROUNDS = 8  # of looking for words nearer to the start
MORE = 3  # times as many words, where no proof is found
SPENT = 0.9  # of the work, after which no more norms are looked for
STRIDE = 0.35  # of what is left to the number that is refuted, how near to it norms are looked for next
FINER, FINEST, FINE = 3.0, 3e-4, 1e9  # steps of the tolerance that follow if they cost little, the last one, and their work
STEPS = 300  # norms for one side of the start
# Of what is left, or of the number itself: the shortest stretch of a proof that goes on from the start, and that goes back to
# what is proved, and what several have to cover together without a finer graph.
LEAST_CLIMB, LEAST_BACK, LEAST_AGAIN = 0.02, 2e-4, 0.02
SHORTEST, SHORTEST_LEFT = 1e-7, 1e-3  # of the whole way: a stretch, and what it has to be a part of
PAYS = 0.2  # of a stretch, the step by which it has to grow


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """Whether matrices decay in every order that is allowed: "proved", "refuted" or "unknown".

    norms: those in which all shrink, if it is proved. word: the pattern of matrices that grows if it is repeated, the first
    one first, if it is refuted.
    """

    verdict: str
    norms: Norms | None = None
    word: Word = ()


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """Numbers from low to high for all of which the matrices shrink in the same norms."""

    low: float
    high: float
    norms: Norms


@dataclass(frozen=True, slots=True, eq=False)
class Bracket:
    """The numbers around a start for which a family decays in every order.

    low, high: proved for each number from low to high, both included; NaN if nothing is proved. fails_below, fails_from: the
    nearest numbers beyond both that are refuted, NaN if none is. words: the patterns that refute them, () if there is none.
    settled: whether each end is within the tolerance of the number that is refuted, or is the limit that was asked for.
    stretches: the proof, from low to high without a gap. centre: forms near the ends, (low, high), from which a search for a
    similar family may begin.
    """

    low: float
    high: float
    fails_below: float
    fails_from: float
    words: tuple[Word, Word]
    settled: bool
    stretches: tuple[Stretch, ...]
    centre: tuple[Centre | None, Centre | None] = field(repr=False)


def decide(family: Family, x: float = 0.0, words: Iterable[Word] = (), work: float = WORK) -> Decision:
    """Decide whether the matrices of a family at x decay in every order that is allowed.

    words: patterns that are tried first. work: operations after which no more norms are looked for.
    Proved and refuted are statements about all matrices within the errors of `Family.enclosed`, with all rounding; norms and
    words themselves are found in plain doubles.
    """
    for word in words:
        if is_refuted(family, word, x):
            return Decision(REFUTED, word=word)
    A = family.at(x)
    centre, _ = first_centre(A, family.follows)
    for word in growing(A, family.follows, centre.basis):
        if is_refuted(family, word, x):
            return Decision(REFUTED, word=word)
    centre, factor = found(A, family.follows, work=work)
    if factor == 1 and _proves(family, centre, x, x):
        return Decision(PROVED, _norms(centre))
    for word in growing(A, family.follows, centre.basis, (), MORE * KEPT, MORE * LONGEST):
        if is_refuted(family, word, x):
            return Decision(REFUTED, word=word)
    return Decision(UNKNOWN)


def bracket(
    family: Family,
    start: float,
    limits: tuple[float, float],
    tolerance: float = 0.01,
    known: Bracket | None = None,
    work: float = WORK,
) -> Bracket:
    """Return the numbers around a start, within limits, for which a family decays in every order that is allowed.

    tolerance: how near the end of what is proved is to come to a number that is refuted, relative to that, or to NEAR_START of
    its distance from the start if that is more. known: the bracket of a similar family, whose patterns and forms are tried
    first. work: operations for each end after which no more norms are looked for.

    What is proved holds for every number from `low` to `high`, not only for those that were looked at: each stretch has norms
    in which the matrices shrink in whose hull those of all its numbers are (see `Family.hull`), and norms are convex. A number
    that is refuted says nothing of those beyond it.
    """
    first, factor = found(family.at(start), family.follows, work=work)
    first = first if factor == 1 else None
    parts = []
    for side, limit in enumerate(limits):
        words = [known.words[side]] if known and known.words[side] else []
        parts.append(_side(family, start, limit, tolerance, words, first, known and known.centre[side], work))
    below, above = parts
    if first is None or np.isnan(below.end) or np.isnan(above.end):
        below, above = (replace(each, end=np.nan, settled=False, stretches=()) for each in parts)
    return Bracket(
        *(float(each.end) for each in (below, above)),
        *(float(each.fails) for each in (below, above)),
        (below.word, above.word),
        bool(below.settled and above.settled),
        tuple(sorted((*below.stretches, *above.stretches), key=lambda each: each.low)),
        (below.centre, above.centre),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    end: float
    fails: float
    word: Word
    settled: bool
    stretches: tuple[Stretch, ...]
    centre: Centre | None


def _side(family, start, limit, tolerance, words, first, centre, work):
    """What is proved and refuted from the start towards a limit.

    first: forms for the start. With them, which need few nodes, the proof goes as far as it can. Then norms are found for a
    number further on, on a finer graph, which go back from there to what is proved; and so on.
    """
    fails, word = _nearest(family, start, limit, tolerance, words)
    if first is None:
        return _Side(np.nan, fails, word, False, (), None)
    goal = _inside(fails, start, WITHIN * tolerance) if word else limit
    stretches, reached, climbed = _covered(family, replace(first, work=0.0), start, goal, LEAST_CLIMB, work)
    # The ceiling is a number for which no norms were found.
    spent, ceiling, before = climbed.work, None, start
    while reached != goal and spent < SPENT * work:
        if ceiling is not None and abs(ceiling - reached) <= tolerance / 2 * _scale(reached, start):
            if abs(reached - before) <= tolerance * _scale(reached, start):
                break
            ceiling, before = None, reached  # a graph that has become finer may do more
        aim = fails - STRIDE * (fails - reached) if word else goal
        aim = aim if ceiling is None else (reached + ceiling) / 2
        aim = aim if abs(aim - start) < abs(goal - start) else goal
        centre, factor = found(family.at(aim), family.follows, centre, (work - spent) / 3)
        further, used = _back(family, centre, factor, aim, reached, work - spent)
        spent += used
        if further:
            stretches, reached = (*stretches, *further), aim
            continue
        nearer = _grown(family, start, aim, centre, word, MORE)
        if nearer and abs(nearer[0] - start) > abs(reached - start):
            (fails, word), ceiling = nearer, None
            goal = _farther(_inside(fails, start, WITHIN * tolerance), reached, start)
        elif aim == limit:
            goal = _farther(_inside(limit, start, WITHIN * tolerance), reached, start)
        else:
            ceiling = aim
    side = _Side(reached, fails, word, False, stretches, centre or first)
    if word and abs(fails - reached) <= tolerance * _scale(fails, start):
        side = _refined(family, side, start, tolerance)
    end = side.fails if word else limit
    return replace(side, settled=abs(end - side.end) <= tolerance * _scale(end, start))


def _refined(family, side, start, tolerance):
    """The side with its end nearer to what is refuted, and that nearer to the start, as far as this costs little."""
    gap, spent = tolerance, 0.0
    while gap > FINEST and spent < FINE:
        gap /= FINER
        aim = _inside(side.fails, start, gap)
        fails, word = _grown(family, start, aim, side.centre, side.word) or (side.fails, side.word)
        side, aim = replace(side, fails=fails, word=word), _inside(fails, start, gap)
        if abs(aim - start) <= abs(side.end - start):
            continue
        centre, factor = found(family.at(aim), family.follows, side.centre, FINE - spent)
        further, used = _back(family, centre, factor, aim, side.end, FINE - spent)
        spent += used
        if not further:
            break
        side = replace(side, end=aim, centre=centre, stretches=(*side.stretches, *further))
    return side


def _back(family, centre, factor, aim, reached, work):
    """The stretches from a number to what is proved, () if there is a gap, and the work; factor: what was found for the number.

    Where a stretch cannot be made longer, forms are looked for again, on a finer graph if that has not helped before.
    """
    stretches, at, used = (), aim, centre.work
    while factor == 1 and used < work:
        further, far, last = _covered(family, replace(centre, work=0.0), at, reached, LEAST_BACK, work - used)
        stretches, used = (*stretches, *further), used + last.work
        if far == reached:
            return stretches, used
        stalled, at = abs(far - at) <= LEAST_AGAIN * abs(far - reached), far
        try:
            centre = finer(last, family.at(at), family.follows) if stalled else last
        except np.linalg.LinAlgError:
            break
        if centre is None:
            break
        centre, factor = found(family.at(at), family.follows, centre, (work - used) / 2)
        used += centre.work
    return (), used


def _farther(one, other, start):
    return one if abs(one - start) > abs(other - start) else other


def _scale(end, start):
    return max(abs(end), NEAR_START * abs(end - start))


def _inside(end, start, share):
    """The number that is a share of an end's size nearer to the start, but no more than half of the way."""
    return end + np.sign(start - end) * min(share * _scale(end, start), abs(end - start) / 2)


def _nearest(family, start, limit, tolerance, words):
    """The number nearest to the start that is found to be refuted, and its word; NaN and () if there is none."""
    fails, word = np.nan, ()
    alone = [(i,) for i in np.flatnonzero(family.follows.diagonal()).tolist()]
    before = start
    for i, x in enumerate(start + (limit - start) * np.geomspace(1e-4, 1.0, SCANNED)):
        A = family.at(x)
        radius = np.abs(np.linalg.eigvals(A)).max(-1)
        grows = [each for each in words if growth(A, each) >= 1] + [each for each in alone if radius[each] >= 1]
        if not grows and i % EVERY == EVERY - 1:
            grows = growing(A, family.follows, first_centre(A, family.follows)[0].basis)
        if grows:
            fails, word = _first(family, grows, before, x, limit)
            break
        before = x
    for _ in range(ROUNDS if word else 0):
        x = _inside(fails, start, tolerance / 4)
        nearer = _grown(family, start, x, first_centre(family.at(x), family.follows)[0], word)
        if not nearer:
            break
        fails, word = nearer
    return fails, word


def _grown(family, start, x, centre, word=(), more=1):
    """The nearest refuted number of the words that grow at x, None if none is found. word: one that nearly does."""
    words = growing(family.at(x), family.follows, centre.basis, [word] if word else [], more * KEPT, more * LONGEST)
    nearest = _first(family, words, start, x, x)
    return nearest if nearest[1] else None


def _first(family, words, stable, unstable, limit):
    """The nearest refuted number of words that grow at `unstable`, with its word; NaN and () if it cannot be proved."""
    best = np.nan, ()
    for word in words[:TRIED]:
        if best[1] and growth(family.at(best[0]), word) < 1:
            continue
        end = best[0] if best[1] else unstable
        at = refuted_beyond(family, word, crossing(family, word, stable, end), limit)
        if at is not None:
            best = at, word
        elif not best[1] and is_refuted(family, word, unstable):
            best = float(unstable), word
    return best


def _norms(centre):
    return Norms(centre.forms, centre.graph)


def _proves(family, centre, one, other):
    """Whether the forms of a centre are proved for all numbers between two."""
    points = family.hull(min(one, other), max(one, other))
    return points is not None and all(shrink(_norms(centre), *point, family.follows) for point in zip(*points, strict=True))


def _covered(family, centre, start, goal, least, work):
    """Stretches without a gap from the start towards the goal, how far they go, and the last forms.

    Each is made longer as long as there are forms in which the matrices at both of its ends shrink, and that pays. least: of
    what is left, the length of a stretch, below which this ends. work: of the forms, after which it ends too.
    """
    stretches, end, graph, most = [], start, centre.graph, abs(goal - start)
    ends = graph.doubled(len(family.follows))
    while end != goal and len(stretches) < STEPS and centre.work < work:
        fixed, x, step = family.at(end), end, np.inf
        target = goal if abs(goal - end) <= most else end + most * np.sign(goal - end)
        both = replace(centre, graph=ends)
        while x != target and abs(step) > PAYS * abs(x - end) and both.work < work:
            before = x
            try:
                both, x = advanced(both, lambda x, fixed=fixed: np.concatenate([family.at(x), fixed]), x, target)
                both = both.rounded()
            except np.linalg.LinAlgError:
                break
            step = x - before
        centre, most = replace(both, graph=graph), 4 * most
        share = least * min(abs(goal - end), max(abs(end), SHORTEST_LEFT * abs(goal - start)))
        shortest = max(min(share, abs(target - end)), SHORTEST * abs(goal - start))
        while abs(x - end) >= shortest and x != end and not _proves(family, centre, end, x):
            x = (x + end) / 2
            most = 2 * abs(x - end)
        if abs(x - end) < shortest or x == end:
            break
        stretches.append(_stretch(end, x, centre))
        end = x
    return tuple(stretches), end, centre


def _stretch(one, other, centre):
    return Stretch(min(one, other), max(one, other), _norms(centre))
