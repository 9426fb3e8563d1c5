"""Intervals of a number for every point of a box of others, while frames vary: refuted at the
worst point that a search finds, and proved box by box."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from wavesweep.engine._sets.sides import Sides
from wavesweep.engine._switched.any_order import nearest_refuted
from wavesweep.engine._switched.average import OnAverage
from wavesweep.engine._switched.boxes import Box, Covering, OwnForms, Rule, cover, units_of
from wavesweep.engine._switched.brackets import Bracket, Refuted, driven
from wavesweep.engine._switched.climb import OPERATIONS_OF_CLIMB, Growth
from wavesweep.engine._switched.frames_over import FramesOver
from wavesweep.engine._switched.left_open import INWARD, left_open
from wavesweep.engine._switched.mean_square import nearest_growing
from wavesweep.engine._switched.norms import first_centre
from wavesweep.engine._switched.patterns import (
    Word,
    begins,
    following,
    growing,
    growth,
    is_refuted,
    nearest,
    places_between,
    written,
)

# distance of proof and refutation that is aimed at, relative to the refuted number
BRACKET_TOLERANCE = 0.01
TOLERANCE_SHARE = 0.8  # of the tolerance, how far from the refuted number the proof ends
FROM_ZERO = 1e-3  # of what is refuted, from which on is proved what begins at 0
POINTS_LOOKED_AT = 3  # points of a climb at which all words are searched
# relative: frames, or growths, that differ by less have the same words that grow first
SAME_FRAMES = 1e-3
OPERATIONS_OF_PROOFS = 7e11  # operations of the proofs: about a minute
SOON_BY_GAIN = 4e10  # the same of a small gain, whose weights take longer
SOON = 4e9  # the same of a proof that is tried first: half a second
UPWARD = 0.6  # part of the work for the way to the upper end
# ratio of the ends of the number between which units of the states are found
UNITS = 64.0
STRETCH = np.log(2)  # of the logarithm of the number: that of those with which a proof begins

Report = Callable[[float, float, float], None]


class Patterns(Protocol):
    """A search for patterns of families that have no words.

    SHORT, PERIODS: in the patterns that are looked for at any point, and at the worst one.
    """

    SHORT: Sequence[int]
    PERIODS: Sequence[int]

    def nearest_pattern(self, family: Any, start: float, limit: float) -> Refuted:
        """The number closest to the start at which a pattern is proved to grow, if one is found."""

    def growing_pattern(
        self, family: Any, x: float, *, periods: Sequence[int]
    ) -> tuple[float, Word]:
        """The fastest growth at x, and its pattern; periods: in it."""


@dataclass(frozen=True, slots=True)
class LoopsOver:
    """Loops over a box of numbers, `(2, numbers)`, along another number.

    family: gives the frames at a point of the box as a family along the number. frames: those over
    a box of sides (see `Sides.places`), the first of which is that number. sides: of that number and of
    those of the box. on_average: if frames are at random; families are then `Chances`, and the word
    of what grows is (0,). gain: what finds forms otherwise, and patterns: what then finds patterns. growth: of
    members, at points of that number and of the box. starts: members that are tried in any case,
    `(points, numbers)`; extremes: gives further ones, at which an expression is least or largest.
    words: those of its symbols that the frames are, see `joined`; () of all others. known: words that
    refute other loops of the same symbols, to which those that are found are added.
    """

    family: Callable[[tuple[float, ...]], Any]
    frames: FramesOver
    box: Box
    sides: Sides
    growth: Growth
    starts: np.ndarray
    extremes: Callable[[], np.ndarray]
    words: Sequence[Word] = ()
    on_average: OnAverage | None = None
    gain: OwnForms | None = None
    patterns: Patterns | None = None
    known: list[Word] = field(default_factory=list)

    @property
    def middle(self) -> tuple[float, ...]:
        """The middle of the box."""
        return tuple(self.box.mean(0).tolist())

    @property
    def follows(self) -> Rule:
        """Which words of frames may follow which, or what they do at random, or what finds forms."""
        return (
            self.on_average or self.gain or following(self.words, self.family(self.middle).follows)
        )

    def covered(
        self,
        frames: FramesOver,
        box: Box,
        work: float,
        up: bool = True,
        words: Sequence[Word] = (),
        *beyond: Any,
    ) -> Covering:
        """What is known of a box of sides, see `cover`; its words, and those that are given, are
        of symbols."""
        given_words = filter(None, (written(word, self.words) for word in words))
        covering = cover(frames, box, self.follows, work, up, list(given_words), *beyond)
        if not self.words:
            return covering
        return replace(covering, word=sum((self.words[index] for index in covering.word), ()))


def bracket_over(
    loops: LoopsOver,
    start: float,
    limits: tuple[float, float],
    work: float,
    begins: float,
    report: Report | None,
) -> Bracket:
    """Return the numbers around a start, within limits, at which all loops of the box decay in
    every order of frames.

    work: operations of the proofs. begins: share of the highest number that is proved, below which it
    does not go, nor below FROM_ZERO of what is refuted. report: is called with the lowest and the
    highest number that are proved so far, and the percentage of the way up or down.
    """
    zero = loops.sides[0].zero
    above, below, lowest = _refuted_at_first(loops, start, limits)
    if above.word:
        # Of the way to the refuted number, at which a proof is begun.
        start = max(start, zero + 0.4 * (above.x - zero))
    units = _units(loops, start)
    rounds = 3  # rounds of the search for refutations, after the proof has met one
    spent = 0.0
    open_ = None

    def tell(highest: float, side: float, share: float) -> None:
        if report:
            end = float(loops.sides[0].number(side))
            report(min(start, end), max(highest, end), 100 * share)

    def upwards(reached: float, goal: float, refuted: Refuted) -> tuple[float, Refuted]:
        nonlocal open_, rounds, spent
        met = Refuted()
        if reached < goal and spent < UPWARD * work:
            words = [below.word, refuted.word]
            part = UPWARD * work - spent
            ends = reached, goal
            covering, end = _proved(loops, units, ends, part, True, words, partial(tell, reached))
            spent += covering.used
            reached = max(reached, end)
            if covering.word and rounds:
                met = _met(loops, covering, start, refuted)
                rounds -= 1
            if not met.word:
                open_ = left_open(covering, loops.sides, _layer(loops, lowest, limits[1]), up=True)
        return reached, met

    def downwards(reached: float, goal: float, _: Refuted) -> tuple[float, Refuted]:
        nonlocal below, open_
        goal = max(goal, lowest)
        if goal < reached < high:
            words = [below.word, above.word]
            part = work - spent
            ends = goal, start
            covering, end = _proved(loops, units, ends, part, False, words, partial(tell, high))
            reached = min(reached, end)
            if covering.open and not below.word:
                below = _worst(loops, start, least)
            whole = _layer(loops, least, limits[1])
            open_ = open_ or left_open(covering, loops.sides, whole, up=False)
        return reached, Refuted()

    share = TOLERANCE_SHARE * BRACKET_TOLERANCE
    high, above = driven(start, limits[1], share, above, upwards)
    least = _from_zero(limits, above, zero)  # of what the proof has met on its way up
    lowest = max(least, zero + begins * (high - zero))
    low, _ = driven(start, lowest, share, below, downwards)
    ends = (np.nan, np.nan) if high == low else (low, high)
    return Bracket(*ends, below, above, open=open_)


def _refuted_at_first(
    loops: LoopsOver, start: float, limits: tuple[float, float]
) -> tuple[Refuted, Refuted, float]:
    """What is refuted above and below a start before a proof, and the lowest number to go to."""
    above = _worst(loops, start, limits[1])
    lowest = _from_zero(limits, above, loops.sides[0].zero)
    below = Refuted()
    if (loops.growth.of(np.insert(loops.starts, 0, lowest, axis=1)) >= 1).any():
        below = _worst(loops, start, lowest)
    return above, below, lowest


def _units(loops: LoopsOver, start: float) -> Any:
    """Units of the states for a proof; None for one from zero, or of a gain."""
    if loops.sides[0].zero or loops.gain:
        return None
    return units_of(loops.frames, _layer(loops, start / UNITS, start), loops.follows)


def _proved(
    loops: LoopsOver,
    units: Any,
    ends: tuple[float, float],
    work: float,
    up: bool,
    words: Sequence[Word],
    tell: Callable[[float, float], None],
) -> tuple[Covering, float]:
    """What is proved from a number to another, from the lower one up or from the upper one down, and
    the number that is reached. tell: see `cover`."""
    first = loops.sides[0]
    layer = _layer(loops, *ends)
    frames = replace(loops.frames, units=units, about=layer.mean(0))
    gain = (1 - TOLERANCE_SHARE) * BRACKET_TOLERANCE
    stretches = 1 if first.zero else _stretches(layer)
    covering = loops.covered(frames, layer, work, up, words, tell, gain, stretches)
    return covering, float(first.number(covering.end - INWARD if up else covering.end + INWARD))


def _from_zero(limits: tuple[float, float], above: Refuted, zero: float) -> float:
    """The lower limit without the least part of what is refuted, for a number that begins at 0."""
    reached = above.x if above.word else limits[1]
    return max(limits[0], zero + FROM_ZERO * (reached - zero))


def _stretches(layer: Box) -> int:
    """The number of equal stretches of the logarithm of the number with which a proof begins."""
    wide = max(float(np.ptp(layer[:, 0])), STRETCH)  # 0 where ends differ by their rounding alone
    return 2 ** int(np.ceil(np.log2(wide / STRETCH)))


def _layer(loops: LoopsOver, low: float, high: float) -> Box:
    """The sides of all loops from a number to another."""
    return loops.sides.places(np.column_stack([[low, high], loops.box]))


def _worst(loops: LoopsOver, start: float, limit: float) -> Refuted:
    """The refuted number closest to the start that a search over the box finds, towards a limit.

    Words are searched at the points at which members grow most up to what is refuted already, until
    that comes no closer.
    """
    best = Refuted()
    tried = np.concatenate([loops.starts, loops.extremes()])
    searched: list[tuple[float, ...]] = []
    for _, x in places_between(start, limit):
        ahead = min(x, limit) if limit > start else max(x, limit)
        if (loops.growth.of(np.insert(tried, 0, ahead, axis=1)) >= 1).any():
            limit = ahead
            break
    for _ in range(6):  # climbs to points at which numbers closer to the start are refuted
        end, starts = (best.x, [*tried, best.point]) if best.word else (limit, tried)
        box = np.column_stack([sorted((start, end)), loops.box])
        begun = np.insert(starts, 0, end, axis=1)
        at_end = loops.growth.of(begun)
        # Where all of a small box grows alike, its corners and a few members beside them do.
        differ = not np.ptp(at_end) <= SAME_FRAMES * at_end.max()
        climbed = loops.growth.climb(box, begun, OPERATIONS_OF_CLIMB if differ else 0.0)
        before = best
        for point in dict.fromkeys(map(tuple, climbed.points[:POINTS_LOOKED_AT, 1:].tolist())):
            by_word = loops.gain and best.word  # a search for patterns of messages takes seconds
            if by_word or any(_alike(loops, point, known_point, end) for known_point in searched):
                best = _moved(loops, point, start, best)
            else:
                best = _refuted_at(loops, point, start, limit, best)
                searched.append(point)
        least_gain = 1e-4 * abs(before.x - start)
        if best is before or (before.word and abs(best.x - before.x) <= least_gain):
            break
    if best.word and not loops.on_average:
        if best.word not in loops.known:
            loops.known.append(best.word)
        return replace(best, x=nearest(loops.family(best.point), best.word, start, best.x))
    return best


def _alike(loops: LoopsOver, point: tuple[float, ...], second: tuple[float, ...], x: float) -> bool:
    """Whether two points have nearly the same frames at a number."""
    if loops.on_average or loops.gain:
        return point == second
    family = loops.family(second)
    frames = loops.family(point).at(x)
    other_numbers = family.at(x)
    if (
        frames.shape != other_numbers.shape or not np.isfinite(other_numbers).all()
    ):  # a number that is 0 takes a state away
        return False
    centre, _ = first_centre(other_numbers, family.follows)  # in whose basis the frames are small
    return bool(np.abs(centre.in_basis(frames - other_numbers)).max() <= SAME_FRAMES)


def _moved(loops: LoopsOver, point: tuple[float, ...], start: float, best: Refuted) -> Refuted:
    """What the best word refutes at a point, if it is closer to the start there."""
    if not best.word:
        return best
    at = _beyond(loops, point, best.word, start, best.x)
    return best if at is None else Refuted(at, best.word, tuple(point))


def _refuted_at(
    loops: LoopsOver, point: tuple[float, ...], start: float, limit: float, best: Refuted
) -> Refuted:
    """What is refuted at a point if it is closer to the start than the best."""
    limit = best.x if best.word else limit
    family = loops.family(point)
    if loops.on_average:
        found = nearest_growing(family, start, limit)
    elif loops.gain:
        patterns: Patterns = loops.patterns  # type: ignore[assignment]  # beside a gain
        found = patterns.nearest_pattern(family, start, limit)
    else:
        known = [*loops.known, best.word] if best.word else loops.known
        found = nearest_refuted(family, start, limit, BRACKET_TOLERANCE, known)
    if found.word and not (best.word and abs(found.x - start) >= abs(best.x - start)):
        return replace(found, point=tuple(point))
    return best


def _beyond(
    loops: LoopsOver, point: tuple[float, ...], word: Word, start: float, end: float
) -> float | None:
    """The refuted number closest to the start of a word that grows at `end` at a point; None if
    it does not."""
    family = loops.family(tuple(point))
    if loops.on_average:
        found = nearest_growing(family, start, end, 1)
        return found.x if found.word else None
    if growth(family.at(end), word) < 1:
        return None
    return begins(family, word, start, end)


def _met(loops: LoopsOver, found: Covering, start: float, above: Refuted) -> Refuted:
    """What is refuted at a place that a proof has met."""
    place: np.ndarray = found.point  # type: ignore[assignment]  # of the word that it has met
    x, *numbers = loops.sides.numbers(place)
    point = tuple(np.clip(numbers, *loops.box))
    at = _beyond(loops, point, found.word, start, x)
    if at is None or (above.word and at >= above.x):
        return above
    return _refuted_at(loops, point, start, at, Refuted(at, found.word, point))


def decide_over(loops: LoopsOver, work: float) -> tuple[tuple[float, ...], Word, bool]:
    """Return a point of the box and a word that grows there, () without, and whether all of the box
    is proved.

    loops: along no number. work: operations of the proof.
    """
    sides = loops.sides.places(loops.box)
    if (loops.growth.of(loops.starts) < 1).all():
        most = SOON_BY_GAIN if loops.gain else min(work, SOON)
        soon = loops.covered(loops.frames, sides, most)
        if not soon.open and not loops.growth.contradicts(loops.box):
            return (), (), True
    begun: tuple[Callable[[], np.ndarray], ...] = (lambda: loops.starts, loops.extremes)
    for starts in begun:  # extremes take longer to find
        point, word = _worst_member(loops, loops.box, starts())
        if word:
            return point, word, False
    if work <= SOON:
        return (), (), False
    found = loops.covered(loops.frames, sides, work)
    if found.word:
        place: np.ndarray = found.point  # type: ignore[assignment]  # of its word
        point = tuple(np.clip(loops.sides.numbers(place), *loops.box).tolist())
        if _is_refuted(loops, loops.family(point), found.word):
            return point, found.word, False
    if found.open:
        low = np.min(found.open, axis=(0, 1))
        high = np.max(found.open, axis=(0, 1))
        part = np.clip(loops.sides.numbers(np.array([low, high])), *loops.box)
        point, word = _worst_member(loops, part, part)
    return point if word else (), word, not found.open


def _worst_member(loops: LoopsOver, box: Box, starts: np.ndarray) -> tuple[tuple[float, ...], Word]:
    """A point of a box and a word that grows there, () without: those that a climb finds first."""
    points = loops.growth.climb(box, starts).points[:POINTS_LOOKED_AT].tolist()
    for point in map(tuple, points):
        family = loops.family(point)
        words: list[Word] = [(0,)]
        if loops.gain:
            first = point == tuple(points[0])  # at others long patterns are not looked for
            patterns: Patterns = loops.patterns  # type: ignore[assignment]  # beside a gain
            periods = patterns.PERIODS if first else patterns.SHORT
            words = [patterns.growing_pattern(family, 0.0, periods=periods)[1]]
        elif not loops.on_average:
            A = family.at(0.0)
            words = growing(A, family.follows, first_centre(A, family.follows)[0].basis)
        for word in words:
            if word and _is_refuted(loops, family, word):
                return point, word
    return (), ()


def _is_refuted(loops: LoopsOver, family: Any, word: Word) -> bool:
    """Whether a word, or the mean square, of a loop without a number grows."""
    if loops.on_average:
        return family.refuted(0.0)
    return is_refuted(family, word, 0.0)
