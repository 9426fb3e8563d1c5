"""Patterns of short and long ticks that make a loop unstable if they are repeated for ever.

The loop is linear, and a tick nearly linear in its length. So the growth of a pattern changes with
each of its ticks as `slopes_of` has it. All ticks of a pattern are set to the lengths that this wants, again and again, until none changes.
It begins with walks: of each slow mode of the ticks' mean, with the left eigenvector l of that, a
walk takes in each tick the length with which `|l' x|` becomes largest, and soon repeats itself.
What it repeats is a pattern, however long a turn of the mode is (parametric resonance).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wavesweep.engine.switched import (
    Refuted,
    largest_modes,
    nearest_of,
    slopes_of,
)
from wavesweep.late_ticks.tick_curves import LateTicks
from wavesweep.program.number_words import in_all_digits
from wavesweep.program.tables.refuters import Refuter

MOST_TICKS = 1200  # of a walk
MODES = 4  # the slowest, of which there are walks
# of these that change every tick that they would; later ones half as many each
CLIMBS_OF_ALL_TICKS = 4
BACK = (0.02, 0.003)  # of a refuted number, how far back from it better patterns are looked for
SAME_EIGENVALUE = 1e-13  # of an eigenvalue: a change that is none

Pattern = tuple[int, ...]
"""Of each tick which of the lengths it has, from the first tick of a frame on."""


def growing(ticks: LateTicks, x: float, patterns: Sequence[Pattern] = ()) -> tuple[float, Pattern]:
    """Return the fastest growth per frame at x of the patterns that a climb finds, up to the shortest
    that grows for ever, and its pattern.

    patterns: patterns to begin with beside all short, all long, and those of walks.
    """
    A = ticks.at_lengths(x)
    tried = [(each,) * ticks.places for each in range(len(ticks.lengths))]
    tried += [*patterns, *_repeated_by_walks(A)]
    by_length: dict[int, set[Pattern]] = {}
    for pattern in tried:
        by_length.setdefault(len(pattern), set()).add(pattern)
    best: tuple[float, Pattern] = (0.0, ())
    for length in sorted(by_length):
        rate, pattern = _climbed(A, np.array(sorted(by_length[length])))
        if rate > best[0] * (1 + SAME_EIGENVALUE):
            best = rate, pattern
        if best[0] >= 1:  # the shortest is what is read most easily
            break
    return best


def nearest_growing(ticks: LateTicks, start: float, limit: float) -> Refuted:
    """Return the number closest to the start at which a pattern is proved to grow, of those that
    a search finds, and that pattern, if there is one."""

    def grown(x, like, _many):
        rate, pattern = growing(ticks, x, [ticks.pattern_of(like)] if like else [])
        return [word_of(ticks, pattern)] if rate >= 1 else []

    refuted = nearest_of(ticks.family, start, limit, 1, grown, BACK)
    return replace(refuted, word=ticks.pattern_of(refuted.word))


def word_of(ticks: LateTicks, pattern: Pattern) -> Pattern:
    """Return the symbols of `LateTicks.family` that a pattern consists of."""
    places = np.arange(len(pattern)) % ticks.places
    return tuple(ticks.symbol(places, np.array(pattern)).tolist())


def in_words(ticks: LateTicks, pattern: Pattern) -> str:
    """Return a pattern as a text: the length of each tick from the slow sample on, in ms, with
    runs of equal ones."""
    if not pattern:
        return ""
    shortest = _shortest(pattern, ticks.places)
    # A product has noise beyond 15 digits.
    lengths = [in_all_digits(float(f"{1e3 * ticks.lengths[length]:.15g}")) for length in shortest]
    return str(Refuter(ticks=lengths))


def _shortest(pattern, places):
    """A pattern without its repetitions; a whole number of frames."""
    for length in range(places, len(pattern), places):
        times, remainder = divmod(len(pattern), length)
        if not remainder and pattern == pattern[:length] * times:
            return pattern[:length]
    return pattern


def _repeated_by_walks(A):
    """The patterns that walks of the slow modes of the ticks' mean repeat, from the middle of a walk
    on, with those first after which its state is most nearly the same again."""
    from scipy.linalg import eig

    places, _lengths, n, _ = A.shape
    frame = np.eye(n)
    for tick in A.mean(1):
        frame = tick @ frame
    if not np.isfinite(frame).all():
        return
    z, left_vectors, right = eig(frame, left=True)
    # Smaller eigenvalues are of states that are soon gone.
    slow = [k for k in np.argsort(-np.abs(z)) if z[k].imag >= 0 and np.abs(z[k]) > 1e-3][:MODES]
    x = np.concatenate([right[:, slow].real.T, right[:, slow].imag.T])
    reads = np.tile(left_vectors[:, slow].conj().T, (2, 1))
    moves = x.any(1)
    if not moves.any():
        return
    # Four turns of the slowest, or 40 frames, if these are not too many ticks.
    turns = 2 * np.pi / np.maximum(np.abs(np.angle(z[slow])), 1e-3)
    frames = int(min(max(4 * turns.max(), 40), max(MOST_TICKS // places, 2)))
    half = frames // 2
    for pattern, states in zip(*_walked(A, reads[moves], x[moves], frames), strict=True):
        alike = np.abs(states[half + 1 :] @ states[half])
        for more in np.argsort(-alike, kind="stable")[:2]:
            yield tuple(pattern[half * places : (half + 1 + more) * places].tolist())


def _walked(A, reads, x, frames):
    """The lengths that walks from states x choose, `(walks, ticks)`, and their states at the
    beginnings of frames, of norm 1, `(walks, frames + 1, n)`. reads: l of each walk."""
    walks = np.arange(len(x))
    seen = [reads]
    for tick in A.mean(1)[:0:-1]:
        seen.append(seen[-1] @ tick)
    lengths = []
    states = [x / np.linalg.norm(x, axis=-1, keepdims=True)]
    for _ in range(frames):
        x = states[-1]
        for tick, state in zip(A, reversed(seen), strict=True):
            after = tick @ x.T  # (lengths, n, walks)
            chosen = np.abs((after * state.T).sum(1)).argmax(0)
            x = after[chosen, :, walks]
            lengths.append(chosen)
        states.append(x / np.linalg.norm(x, axis=-1, keepdims=True))
    return np.array(lengths).T, np.array(states).swapaxes(0, 1)


def _climbed(A, patterns):
    """The fastest growth per frame that is met on the way up from some patterns, and its pattern.

    A: `(places, lengths, n, n)`.
    """
    places = len(A)
    length = patterns.shape[1]
    at_place = A[np.arange(length) % places]
    best: tuple[float, Pattern] = (0.0, ())
    for step in range(30):
        chosen = at_place[np.arange(length)[:, None], patterns.T]
        products = chosen[0]
        for tick in chosen[1:]:
            products = tick @ products
        finite = np.isfinite(products).all((-1, -2))
        if not finite.all():
            return np.inf, tuple(patterns[int(finite.argmin())].tolist())
        modes = largest_modes(products)
        rates = np.abs(modes[0]) ** (places / length)
        fastest = int(rates.argmax())
        if rates[fastest] > best[0] * (1 + SAME_EIGENVALUE):
            best = float(rates[fastest]), tuple(patterns[fastest].tolist())
        gains = np.nan_to_num(np.stack(slopes_of(at_place, chosen, modes), axis=1))
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
        patterns = np.array(sorted(set(map(tuple, changed[moved].tolist()))))
    return best
