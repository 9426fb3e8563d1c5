"""Patterns of short and long ticks that make a loop unstable if they are repeated for ever.

The loop is linear, and a tick nearly linear in its length. So the growth of a pattern changes with
each of its ticks as the eigenvalue does: with the product `Q A P` of a pattern, its largest
eigenvalue z and the vectors x and y of that,

    dz = y' Q dA P x.

All ticks of a pattern are set to the lengths that this wants, again and again, until none changes.
Patterns are as long as a few frames, or as half a turn of a slow mode: what changes twice in a turn
feeds an oscillation most (parametric resonance).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.late_ticks.tick_curves import LateTicks
from wavesweep.program.tables.refuters import repeated

FRAMES = (1, 2, 3)  # in a pattern
MOST_TICKS = 400  # in a pattern of several frames
# of these that change every tick that they would; later ones half as many each
CLIMBS_OF_ALL_TICKS = 4
SAME_EIGENVALUE = 1e-13  # of an eigenvalue: a change that is none

Pattern = tuple[int, ...]
"""Of each tick which of the lengths it has, from the first tick of a frame on."""


def growing(ticks: LateTicks, x: float, known: Sequence[Pattern] = ()) -> tuple[float, Pattern]:
    """Return the fastest growth per frame at x of the patterns that a climb finds, and its pattern.

    known: patterns to begin with beside all short, all long, and waves of short and long ticks.
    """
    A = ticks.by_place(ticks.at_ends.at(x))
    best: tuple[float, Pattern] = (0.0, ())
    for frames in sorted({*FRAMES, *_half_turns(A)}):
        length = frames * ticks.places
        if length > MOST_TICKS and frames > 1:
            break
        waves = 3 * frames if frames in FRAMES else 1
        starts = [_waves(waves, length, len(ticks.lengths))]
        starts += [np.array([pattern]) for pattern in known if len(pattern) == length]
        rate, pattern = _climbed(A, np.concatenate(starts))
        if rate > best[0] * (1 + SAME_EIGENVALUE):
            best = rate, pattern
    return best


def nearest_growing(ticks: LateTicks, start: float, limit: float) -> tuple[float, Pattern]:
    """Return the number closest to the start at which a pattern is proved to grow, of those that
    a search finds, and that pattern; NaN and () if there is none."""
    stable = start
    unstable, pattern = np.nan, ()
    # 16 numbers between a start and a limit, the first after a thousandth of the way.
    for x in start + (limit - start) * np.geomspace(1e-3, 1.0, 16):
        rate, found = growing(ticks, x)
        if rate >= 1:
            unstable, pattern = float(x), found
            break
        stable = float(x)
    if not pattern:
        return np.nan, ()
    for _ in range(9):
        middle = (stable + unstable) / 2
        rate, found = growing(ticks, middle, [pattern])
        if rate >= 1:
            unstable, pattern = middle, found
        else:
            stable = middle
    return grows_from(ticks, pattern, stable, unstable, limit)


def grows_from(
    ticks: LateTicks, pattern: Pattern, stable: float, unstable: float, limit: float
) -> tuple[float, Pattern]:
    """Return the number next to where a pattern begins to grow at which that is proved, and the
    pattern; NaN and () if none is."""
    switched = offered("switched")
    word = word_of(ticks, pattern)
    for _ in range(40):  # bisections with one pattern
        middle = (stable + unstable) / 2
        if _growth(ticks, middle, word) >= 1:
            unstable = middle
        else:
            stable = middle
    at = switched.refuted_beyond(ticks.at_ends, word, unstable, limit)
    if at is None and switched.is_refuted(ticks.at_ends, word, unstable):
        at = unstable
    if at is None:
        return (np.nan, ())
    return (float(at), pattern)


def word_of(ticks: LateTicks, pattern: Pattern) -> Pattern:
    """Return the matrices of `at_ends` that a pattern consists of."""
    places = np.arange(len(pattern)) % ticks.places
    return tuple((places * len(ticks.lengths) + pattern).tolist())


def in_words(ticks: LateTicks, pattern: Pattern) -> str:
    """Return a pattern as a text: the length of each tick from the slow sample on, in ms, with
    runs of equal ones."""
    if not pattern:
        return ""
    shortest = _shortest(pattern, ticks.places)
    lengths = [f"{1e3 * ticks.lengths[length]:.6g}" for length in shortest]
    return f"ticks of {repeated(lengths)} ms"


def _shortest(pattern, places):
    """A pattern without its repetitions; a whole number of frames."""
    for length in range(places, len(pattern), places):
        times, left = divmod(len(pattern), length)
        if not left and pattern == pattern[:length] * times:
            return pattern[:length]
    return pattern


def _half_turns(A):
    """The frames of half a turn of the two slowest modes that oscillate, of ticks that are all
    alike."""
    frame = np.eye(A.shape[-1])
    for tick in A.mean(1):
        frame = tick @ frame
    z = np.linalg.eigvals(frame)
    turning = z[z.imag > 0]
    slowest = turning[np.argsort(-np.abs(turning))[:2]]
    return [max(1, round(np.pi / angle)) for angle in np.angle(slowest).tolist()]


def _growth(ticks, x, word):
    """The spectral radius of a pattern."""
    A = ticks.at_ends.at(x)
    product = A[word[0]]
    for symbol in word[1:]:
        product = A[symbol] @ product
    if not np.isfinite(product).all():
        return np.inf
    return float(np.abs(np.linalg.eigvals(product)).max())


def _waves(most, length, lengths):
    """Patterns that a climb begins with, `(patterns, length)`; most: waves in a pattern."""
    last = lengths - 1
    patterns = [np.full(length, each) for each in range(lengths)]
    ticks = np.arange(length)
    patterns.append(last * (ticks % 2))
    for waves in range(1, most + 1):
        for phase in (0.0, 0.25, 0.5, 0.75):
            high = np.cos(2 * np.pi * (waves * ticks / length + phase)) > 0
            patterns.append(np.where(high, last, 0))
    return np.array(patterns)


def _climbed(A, patterns):
    """The fastest growth per frame that is met on the way up from some patterns, and its pattern.

    A: `(places, lengths, n, n)`.
    """
    places, _lengths, n, _ = A.shape
    _count, length = patterns.shape
    at_place = A[np.arange(length) % places]
    best: tuple[float, Pattern] = (0.0, ())
    for step in range(30):
        chosen = at_place[np.arange(length)[:, None], patterns.T]
        before = np.empty((length + 1, len(patterns), n, n))
        before[0] = np.eye(n)
        for k in range(length):
            before[k + 1] = chosen[k] @ before[k]
        if not np.isfinite(before[-1]).all():
            grown = int(np.flatnonzero(~np.isfinite(before[-1]).all((-1, -2)))[0])
            return np.inf, tuple(patterns[grown].tolist())
        z, vectors = np.linalg.eig(before[-1])
        largest = np.abs(z).argmax(-1)
        rates = np.abs(z).max(-1) ** (places / length)
        fastest = int(rates.argmax())
        if rates[fastest] > best[0] * (1 + SAME_EIGENVALUE):
            best = float(rates[fastest]), tuple(patterns[fastest].tolist())
        gains = _gains(at_place, chosen, before, vectors, z, largest)
        wanted = gains.argmax(-1)
        now = np.take_along_axis(gains, patterns[..., None], 2)[..., 0]
        better = gains.max(-1) - now
        least = np.full((len(patterns), 1), SAME_EIGENVALUE)
        if step >= CLIMBS_OF_ALL_TICKS:
            share = 1 - 0.5 ** (step - CLIMBS_OF_ALL_TICKS + 1)
            least = np.maximum(least, np.quantile(better, share, axis=1)[:, None])
        changed = np.where(better >= least, wanted, patterns)
        moved = (changed != patterns).any(1)
        if not moved.any():
            break
        patterns = np.unique(changed[moved], axis=0)
    return best


def _gains(at_place, chosen, before, vectors, z, largest):
    """What each tick of each pattern does to its largest eigenvalue with each length, relative
    to that, `(patterns, ticks, lengths)`."""
    length = len(at_place)
    own = np.arange(len(z))
    x = vectors[own, :, largest]
    at = z[own, largest]
    with np.errstate(all="ignore"):
        try:
            inverse = np.linalg.inv(vectors)
        except np.linalg.LinAlgError:
            inverse = np.linalg.pinv(vectors)
        states = before[:-1] @ x[..., None]
        left = np.empty((length, *x.shape), complex)
        left[-1] = inverse[own, largest]
        for k in range(length - 1, 0, -1):
            left[k - 1] = (left[k][:, None] @ chosen[k])[:, 0]
        moved = at_place @ states[..., 0].mT[:, None]
        gains = np.real((left.mT[:, None] * moved).sum(2) / at).transpose(2, 0, 1)
    return np.nan_to_num(gains)
