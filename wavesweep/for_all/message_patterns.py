"""Patterns of late and lost messages that make a loop unstable if they are repeated for ever.

The growth of a pattern changes with what is held at each place as `slopes_of` has it. What gains
most by this at each place is taken, made a pattern that messages can have, if the pattern then grows
more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.engine.switched import (
    Refuted,
    Word,
    largest_modes,
    nearest_of,
    product_of,
    slopes_of,
)
from wavesweep.for_all.channel_families import LOST
from wavesweep.for_all.message_rings import RingFrames

PERIODS = (1, 2, 3, 4, 5, 6, 7, 8, 13)  # in a pattern
SHORT = PERIODS[:2]  # periods of the patterns that are tried before norms are searched
SOON = PERIODS[:4]  # those of the patterns that are tried at each number
STEPS = 4  # from a number at which all periods are tried to the next one
MOST_PLACES = 400  # of a pattern
CHANGES = 10  # on the way up of a climb
# Of the largest gain at a place: what a change of a path costs, in turn until the pattern grows.
COSTS = (0.0, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9)
# Of a refuted number, how far back from it others are looked for.
BACK = (0.04, 0.02, 0.008, 0.0025, 8e-4, 2.5e-4)


def growing_pattern(
    family: RingFrames,
    x: float,
    words: Sequence[Word] = (),
    periods: Sequence[int] = PERIODS,
) -> tuple[float, Word]:
    """Return the fastest growth per period at x of the patterns that a climb finds, and its
    pattern.

    words: patterns to begin with, before others. periods: in these. The search ends with the first
    one that grows.
    """
    ring = _Ring.of(family)
    best: tuple[float, Word] = (0.0, ())
    for pattern in _climbs(family.at(x), ring, (*words, *_starts(ring, periods))):
        best = max(best, pattern)
        if best[0] >= 1:
            break
    return best


def _climbs(A, ring, starts) -> Iterator[tuple[float, Word]]:
    """Yield where a climb from each of some patterns ends: the growth per period, and a pattern.

    A climb that comes to a pattern of one before goes where that went.
    """
    rates: dict[Word, float] = {}
    successors: dict[Word, Word] = {}  # of each pattern the next one of a climb, itself at its end
    for start in filter(None, starts):
        word = start
        for _ in range(CHANGES):
            if word not in successors:
                successors[word] = _farther(A, ring, word, rates)
            if successors[word] == word:
                break
            word = successors[word]
        yield _rate_of(A, word, rates) ** (ring.places / len(word)), word


def _rate_of(A, word, rates):
    """`_rate` of a pattern, remembered in `rates`."""
    if word not in rates:
        rates[word] = _rate(A, word)
    return rates[word]


def _farther(A, ring, word, rates):
    """The pattern of the next step of a climb; the same one at its end."""
    rate = _rate_of(A, word, rates)
    if not 0 < rate < np.inf:  # of a product that is 0 nothing is the largest eigenvalue
        return word
    gains = _gains(A, ring, word)
    tried: set[Word] = set()
    for changed_word in ring.changed(word, gains):
        if changed_word in tried:
            continue
        tried.add(changed_word)
        ahead = ring.realised(changed_word)
        if _rate_of(A, ahead, rates) > rate * (1 + 1e-9):
            return ahead
    return word


def nearest_pattern(family: RingFrames, start: float, limit: float) -> Refuted:
    """Return the number closest to the start at which a pattern is proved to grow, of those that
    a search finds, and that pattern, if there is one.

    At each number the climbs begin with the patterns of the number before, the best of each length,
    and at some with all others.
    """
    ring = _Ring.of(family)
    tracked: dict[int, tuple[float, Word]] = {}

    def grown(x, like, many):
        nonlocal tracked
        words = [like, *(word for _, word in tracked.values())]
        best: dict[int, tuple[float, Word]] = {}
        starts = (*words, *_starts(ring, PERIODS if many else SOON))
        for rate, word in _climbs(family.at(x), ring, starts):
            if rate >= 1:
                return [word]
            best[len(word)] = max(best.get(len(word), (0.0, ())), (rate, word))
        tracked = tracked if like else best
        return []

    return nearest_of(family, start, limit, STEPS, grown, BACK)


def realised(family: RingFrames, word: Word) -> Word:
    """Return the pattern in which nothing that is held is older than before; () if the family has
    none of its matrices."""
    return _Ring.of(family).realised(word)


@dataclass(frozen=True, slots=True, eq=False)
class _Ring:
    """What may be held at the places of a ring.

    backs `(symbols, channels)`: with each matrix, in messages, 0 where nothing reads a channel; read
    `(places, channels)`: whether something does. first `(places + 1,)`: of the matrices of each
    place, which are next to each other. at `(places, ...)`: the matrix of each choice, -1 without.
    ticks `(places,)`: of the period.
    """

    family: RingFrames
    backs: np.ndarray
    read: np.ndarray
    first: np.ndarray
    at: np.ndarray
    ticks: np.ndarray

    @staticmethod
    def of(family: RingFrames) -> _Ring:
        """That of a family."""
        backs_of_symbols = [
            [-1 if back is None else back for back in symbol.back] for symbol in family.symbols
        ]
        backs = np.array(backs_of_symbols)
        first = np.searchsorted(family.place, np.arange(family.place.max() + 2))
        index_of = np.full((first.size - 1, *backs.max(0) + 1), -1)
        read = backs[first[:-1]] >= 0
        backs = np.maximum(backs, 0)
        index_of[(family.place, *backs.T)] = np.arange(len(backs))
        ticks = np.array([family.symbols[index].tick for index in first[:-1]])
        return _Ring(family, backs, read, first, index_of, ticks)

    @property
    def places(self) -> int:
        """How many there are."""
        return self.first.size - 1

    def realised(self, word: Word) -> Word:
        """See `realised`."""
        if not word:
            return ()
        step = np.arange(len(word))
        place = step % self.places
        now = self.ticks[place] + self.family.loop.drawn.ticks * (step // self.places)
        choices = [place]
        for number, channel in enumerate(self.family.loop.channels):
            newest = np.array(self.numbers(word, number))[now]
            back = (now - channel.phase) // channel.every - newest
            back = np.where(self.read[place, number], back, 0)
            if (back >= self.at.shape[1 + number]).any():
                return ()
            choices.append(back)
        symbols = self.at[tuple(choices)]
        return () if (symbols < 0).any() else tuple(symbols.tolist())

    def numbers(self, word: Word, number: int) -> list[int]:
        """The number of the newest message of a channel in each tick of a pattern, counted from the
        first that is sent in it."""
        channel = self.family.loop.channels[number]
        period = self.family.loop.drawn.ticks
        ticks = np.arange(period * len(word) // self.places)
        sent = (ticks - channel.phase) // channel.every
        since = ticks - channel.phase - sent * channel.every
        oldest = np.maximum(0, -((since - channel.late) // channel.every)) + channel.lost
        least = sent - oldest
        step = np.arange(len(word))
        now = self.ticks[step % self.places] + period * (step // self.places)
        read = self.read[step % self.places, number]
        wanted = sent[now] - self.backs[list(word), number]
        least[now[read]] = np.maximum(least[now[read]], wanted[read])
        # One that is held for the first time is late by no more than it may be.
        earliest = (sent - (channel.late - since) // channel.every).tolist()
        newest_sent = sent.tolist()
        lowest = least.tolist()
        count = ticks.size // channel.every
        newest = lowest
        before = None
        # Until it repeats, which it does, as what is held is never older than a turn before.
        while before != newest[-1] - count:
            before = shown = newest[-1] - count
            newest = []
            for tick in range(ticks.size):
                if shown < lowest[tick]:
                    fresh = max(lowest[tick], earliest[tick])
                    shown = fresh if fresh <= newest_sent[tick] else shown
                    lowest[tick] = max(lowest[tick], shown)
                else:
                    lowest[tick] = shown
                newest.append(shown)
        return newest

    def changed(self, word: Word, gains: Sequence[np.ndarray]) -> Iterator[Word]:
        """Yield the pattern with what gains most at each place, for each of COSTS of a change, as shares
        of the largest gain."""
        own = np.array(word)
        first = self.first[np.arange(len(word)) % self.places]
        better = np.array([gain.argmax() for gain in gains])
        most = np.array([gain[place] for gain, place in zip(gains, better, strict=True)])
        least = np.array([gain.min() for gain in gains])
        now = np.array([gain[place] for gain, place in zip(gains, own - first, strict=True)])
        largest = (most - least).max()
        for cost in COSTS:
            yield tuple(np.where(most - cost * largest > now, first + better, own).tolist())


def messages_of(family: RingFrames, word: Word) -> dict[str, list[int | None]]:
    """Return what happens to the messages of each channel in a pattern, in the order in which they
    are sent from the begin of a period on: ticks by which each is late, LOST of one that is lost."""
    messages = {}
    ring = _Ring.of(family)
    newest_of = [
        np.array(ring.numbers(word, channel_number))
        for channel_number in range(len(family.loop.channels))
    ]
    for channel, newest, earlier in zip(
        family.loop.channels, newest_of, family.loop.earlier, strict=True
    ):
        ticks = len(newest)
        count = ticks // channel.every
        # Of a pattern, while a message may be under way or held.
        turns = 3 + (channel.late + channel.every * channel.lost) // ticks
        ahead = np.concatenate([newest + count * turn for turn in range(turns)])
        late = []
        for number in range(count):
            sent = channel.phase + channel.every * number
            # The first tick that has this message or a newer one.
            first = int(np.searchsorted(ahead, number))
            if ahead[first] == number or first <= sent + channel.late:
                late.append(first - sent if ahead[first] == number else channel.late)
            else:
                late.append(LOST)
        messages[channel.name] = [late[(message + earlier) % count] for message in range(count)]
    return messages


def _starts(ring: _Ring, numbers: Sequence[int]) -> Iterator[Word]:
    """Patterns that a climb begins with: what is held is the newest, the oldest, some message, or
    the one and the other in waves."""
    source = np.random.default_rng(0)
    members = np.split(ring.backs, ring.first[1:-1])
    for periods in numbers:
        length = periods * ring.places
        if length > MOST_PLACES and periods > 1:
            break
        shape = (length, ring.backs.shape[1])
        ways = [np.zeros(shape), np.ones(shape), source.random(shape)]
        steps = np.arange(length)[:, None] / length
        for waves in range(1, periods + 1):
            # Square waves, in which each channel has its phase.
            phase = source.random(shape[1])
            ways.append(1.0 * (np.cos(2 * np.pi * (waves * steps + phase)) > 0))
        for way in ways:
            word = np.zeros(length, int)
            for place, backs_of_place in enumerate(members):
                wanted = way[place :: ring.places, None] * backs_of_place.max(0)
                nearest = np.abs(backs_of_place - wanted).sum(-1).argmin(1)
                word[place :: ring.places] = ring.first[place] + nearest
            yield ring.realised(tuple(word.tolist()))


def _sizes(z):
    """The sizes of eigenvalues, 0 for the slowest mode that creeps back: it hides what a pattern does
    to others, and is next to 1 with each."""
    size = np.abs(z)
    creeps = np.where((z.imag == 0) & (z.real < 1), z.real, -1.0)
    size[creeps.argmax()] *= creeps.max() < 0
    return size


def _rate(A, word):
    """The size that a climb raises, of the product of a pattern; 0 without one."""
    product = product_of(A, word) if word else np.zeros((1, 1))
    return float(_sizes(np.linalg.eigvals(product)).max()) if np.isfinite(product).all() else np.inf


def _gains(A, ring, word):
    """What each step of a pattern does to its largest eigenvalue with each matrix of its place,
    relative to that."""
    places = np.arange(len(word)) % ring.places
    choices = [A[ring.first[place] : ring.first[place + 1]] for place in places]
    modes = largest_modes(product_of(A, word)[None], lambda z: _sizes(z[0])[None])
    return [gains_of_step[0] for gains_of_step in slopes_of(choices, A[list(word), None], modes)]
