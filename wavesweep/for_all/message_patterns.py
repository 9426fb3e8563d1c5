"""Patterns of late and lost messages that make a loop unstable if they are repeated for ever.

The growth of a pattern changes with what is held at each place as the eigenvalue does: with the
product `Q A P` of a pattern, its largest eigenvalue z and the vectors x and y of that,

    dz = y' Q dA P x.

What gains most by this at each place is taken, made a pattern that messages can have, if the pattern
then grows more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from wavesweep.engine.switched import Word, crossing, is_refuted, product_of, refuted_beyond
from wavesweep.for_all.channel_families import LOST
from wavesweep.for_all.message_rings import RingFrames

SHORT = (1, 2)  # periods of the patterns that are tried before norms are searched
PERIODS = (1, 2, 3, 5, 8, 13)  # in a pattern
MOST_PLACES = 400  # of a pattern
BEFORE = -(10**9)  # the number of a message from before all others
# Of the largest gain at a place: what a change of a path costs, in turn until the pattern grows.
COSTS = (0.0, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9)


def growing_pattern(
    family: RingFrames,
    x: float,
    known: Sequence[Word] = (),
    periods: Sequence[int] = PERIODS,
) -> tuple[float, Word]:
    """Return the fastest growth per period at x of the patterns that a climb finds, and its
    pattern.

    known: patterns to begin with, before others. periods: in these. The search ends with the first
    one that grows.
    """
    places = len(family.slots)
    A = family.at(x)
    best: tuple[float, Word] = (0.0, ())
    for start in filter(None, (*known, *_starts(family, periods))):
        word = start
        rate = _rate(A, word)
        for _ in range(10):  # changes on the way up
            if not 0 < rate < np.inf:  # of a product that is 0 nothing is the largest eigenvalue
                break
            gains = _gains(A, family, word)
            for cost in COSTS:
                ahead = realised(family, _changed(family, word, gains, cost))
                farther = _rate(A, ahead)
                if farther > rate * (1 + 1e-9):
                    break
            else:
                break
            word, rate = ahead, farther
        best = max(best, (rate ** (places / len(word)), word))
        if rate >= 1:
            break
    return best


def nearest_pattern(family: RingFrames, start: float, limit: float) -> tuple[float, Word]:
    """Return the number closest to the start at which a pattern is proved to grow, of those that
    a search finds, and that pattern; NaN and () if there is none."""
    at = limit
    best: tuple[float, Word] = (np.nan, ())
    # Of the way to a refuted number, how far before it others are looked for.
    for back in (0.0, 0.2, 0.1, 0.03):
        for _ in range(8):
            x = at + back * (start - at)
            rate, word = growing_pattern(family, x, (best[1],) if best[1] else ())
            if rate < 1:
                break
            begins = crossing(family, word, start, x)
            refuted = refuted_beyond(family, word, begins, x)
            if refuted is None and is_refuted(family, word, x):
                refuted = x
            if refuted is None:
                break
            at, best = float(refuted), (float(refuted), word)
            if not back:
                break
        if not best[1]:  # nothing grows at the limit
            break
    return best


def realised(family: RingFrames, word: Word) -> Word:
    """Return the pattern in which nothing that is held is older than before; () if the family has
    none of its matrices."""
    at = {(held.tick, held.back): index for index, held in enumerate(family.symbols)}
    numbers = _numbers(family, word)
    period = family.loop.drawn.ticks
    places = len(family.slots)
    found = []
    for step, symbol in enumerate(word):
        held = family.symbols[symbol]
        now = held.tick + period * (step // places)
        back = []
        for channel, newest, own in zip(family.loop.channels, numbers, held.back, strict=True):
            back.append(None if own is None else channel.sent(now) - int(newest[now]))
        found.append(at.get((held.tick, tuple(back))))
    return () if None in found else tuple(found)


def messages_of(family: RingFrames, word: Word) -> dict[str, list[int | None]]:
    """Return what happens to the messages of each channel in a pattern, in the order in which they
    are sent from the begin of a period on: ticks by which each is late, LOST of one that is lost."""
    found = {}
    for channel, newest, earlier in zip(
        family.loop.channels, _numbers(family, word), family.loop.earlier, strict=True
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
        found[channel.name] = [late[(each + earlier) % count] for each in range(count)]
    return found


def _numbers(family, word):
    """The number of the newest message of each channel in each tick of a pattern, counted from the
    first that is sent in it."""
    period = family.loop.drawn.ticks
    places = len(family.slots)
    ticks = period * len(word) // places
    found = []
    for at, channel in enumerate(family.loop.channels):
        wanted = [BEFORE] * ticks
        for step, symbol in enumerate(word):
            held = family.symbols[symbol]
            now = held.tick + period * (step // places)
            if held.back[at] is not None:
                wanted[now] = channel.sent(now) - held.back[at]
        count = ticks // channel.every
        newest: list[int] = []
        # Until it repeats, which it does, as what is held is never older than a turn before.
        last = None
        while last is None or newest[-1] - count != last:
            last = newest[-1] - count if newest else BEFORE
            number = last
            newest = []
            for now in range(ticks):
                sent = channel.sent(now)
                since = now - channel.phase - sent * channel.every
                least = max(wanted[now], sent - channel.oldest(since))
                # One that is held for the first time is late by no more than it may be.
                fresh = max(least, sent - (channel.late - since) // channel.every)
                if number < least and fresh <= sent:
                    number = fresh
                newest.append(number)
                wanted[now] = max(wanted[now], number)
        found.append(np.array(newest))
    return found


def _starts(family: RingFrames, numbers: Sequence[int]) -> Iterator[Word]:
    """Patterns that a climb begins with: what is held is the newest, the oldest, some message, or
    the one and the other in waves."""
    places = len(family.slots)
    oldest = np.array([[each or 0 for each in held.back] for held in family.symbols])
    source = np.random.default_rng(0)
    members = [np.flatnonzero(family.place == at) for at in range(places)]
    for periods in numbers:
        length = periods * places
        if length > MOST_PLACES and periods > 1:
            break
        shape = (length, oldest.shape[1])
        ways = [np.zeros(shape), np.ones(shape), source.random(shape)]
        steps = np.arange(length)[:, None] / length
        for waves in range(1, periods + 1):
            # Square waves, in which each channel has its phase.
            phase = source.random(shape[1])
            ways.append(1.0 * (np.cos(2 * np.pi * (waves * steps + phase)) > 0))
        for way in ways:
            word = []
            for step in range(length):
                own = members[step % places]
                wanted = way[step] * oldest[own].max(0)
                word.append(int(own[np.abs(oldest[own] - wanted).sum(1).argmin()]))
            yield realised(family, tuple(word))


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


def _gains(A, family, word):
    """What each step of a pattern does to its largest eigenvalue with each matrix of its place,
    relative to that."""
    before = [np.eye(A.shape[-1])]
    for symbol in word:
        before.append(A[symbol] @ before[-1])
    z, vectors = np.linalg.eig(before[-1])
    at = int(_sizes(z).argmax())
    x = vectors[:, at]
    try:
        y = np.linalg.inv(vectors)[at]
    except np.linalg.LinAlgError:
        y = np.linalg.pinv(vectors)[at]
    gains = [np.zeros(0)] * len(word)
    for step in range(len(word) - 1, -1, -1):
        own = family.place == family.place[word[step]]
        gains[step] = np.real((A[own] @ (before[step] @ x)) @ y / z[at])
        y = y @ A[word[step]]
    return gains


def _changed(family, word, gains, cost):
    """The pattern with what gains most at each place; cost: of a change, as a share of the largest
    gain."""
    most = max(np.ptp(own) for own in gains)
    found = []
    for symbol, gain in zip(word, gains, strict=True):
        own = np.flatnonzero(family.place == family.place[symbol])
        found.append(int(own[(gain - cost * most * (own != symbol)).argmax()]))
    return tuple(found)
