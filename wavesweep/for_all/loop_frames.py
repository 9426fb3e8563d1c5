"""Matrices of the frames of a loop along a number, with bounds on their errors, and their hull
over an interval."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from wavesweep.engine.frames import (
    ENTRY_ROUNDING,
    MarginalModes,
    OpenTicks,
    Ticks,
    both,
    pattern_of,
    product_with_errors,
)
from wavesweep.engine.sets import Polynomials
from wavesweep.for_all.folded import counted_from_rest, shift_of

# least size of 1 - d x, relative to its terms, for which the loop through the number is solved
SOLVABLE = 1e-6
SOME = 0.7  # a value at which no entry of a frame vanishes by chance
# relative error of a matrix due to the rounding of the number in the middle of an interval
MIDDLE = 64 * ENTRY_ROUNDING


@dataclass(frozen=True, slots=True)
class Symbol:
    """A kind of frame.

    ticks: its length. delay: of the result, in ticks, FRAME or LOST; None in a drawn loop. lost:
    the number of results lost in a row, including this one; 0 as well where any number may be.
    step: the period of slow blocks that run after the sample, which is the length of the frame
    before; None if nothing depends on it. through: whether the next result is in place at once,
    with the sample that ends this frame. gone: channels whose message of the frame is lost; that of
    a sample is in the frame that it ends.
    """

    ticks: int
    delay: int | str | None = None
    lost: int = 0
    step: int | None = None
    through: bool = False
    gone: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True, eq=False)
class LoopFrames:
    """The frames of a loop as a `Family` along a number.

    ticks: one of each kind, open at the number, in states relative to those that drift. rows: the
    kinds of each symbol's ticks after its sample; samples: the kind of the sample that ends it.
    patterns: entries of each symbol that may be nonzero. kept: the states that remain: without
    drift, and without those that every frame forgets or sets to zero. symbols: the kind of frame of
    each matrix. at_once: the frames in a simpler form if the number acts in no more than one of
    their ticks, and no drift depends on numbers. drift: one that does, or None; its rest is then
    found at each value of the number.
    """

    ticks: Ticks
    rows: tuple[tuple[int, ...], ...]
    samples: tuple[int, ...]
    patterns: tuple[np.ndarray, ...]
    kept: np.ndarray
    symbols: tuple[Symbol, ...]
    follows: np.ndarray
    at_once: _AtOnce | None
    drift: MarginalModes | None = None

    @staticmethod
    def of(ticks, kept, rows, samples, symbols, follows, drift=None) -> LoopFrames:
        """Return the frames that consist of these ticks. kept: the states without drift. drift:
        if it depends on numbers."""
        changes = [tick_map.E for tick_map in _closed(ticks, SOME).maps]
        rows = tuple(map(tuple, rows))
        samples = tuple(samples)
        whole_rows = [(*row, sample) for row, sample in zip(rows, samples, strict=True)]
        patterns = [pattern_of(np.array(row), changes) for row in whole_rows]
        kept = np.array(kept)
        if not drift:
            kept = alive(np.logical_or.reduce(patterns), kept)
        acting = []
        for row in whole_rows:
            acting.append([i for i, kind in enumerate(row) if ticks.maps[kind].inputs])
        at_once = None
        if not drift and all(len(kinds) <= 1 for kinds in acting):
            places = [(*kinds, -1)[0] for kinds in acting]
            at_once = _AtOnce.of(ticks, whole_rows, places, kept)
        return LoopFrames(
            ticks, rows, samples, tuple(patterns), kept, symbols, follows, at_once, drift
        )

    def at(self, x: float) -> np.ndarray:
        """See `Family`."""
        if self.at_once is not None:
            return self.at_once.at(x)
        maps = []
        for tick_map in self.ticks.maps:
            E = tick_map.E
            if tick_map.inputs:
                f = x / (1 - x * tick_map.D[0, 0])
                E = E + f * (tick_map.B @ tick_map.C)
            maps.append(np.eye(len(E)) + E)
        frames = [_joined(self._ticks(i), maps, _after) for i in range(len(self.rows))]
        if self.drift:
            identity = np.eye(len(maps[0]))
            changes = np.array(maps) - identity
            V, dV = shift_of(changes, 0 * changes, self.drift)
            E = np.array(frames) - identity
            counted, _ = counted_from_rest(E, np.zeros_like(E), V, dV, self.drift)
            return np.eye(self.kept.size) + counted
        return np.array([frame[np.ix_(self.kept, self.kept)] for frame in frames])

    def enclosed(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """See `Family`. Accuracy: to first order in a rounding."""
        maps = _closed(self.ticks, x).maps
        changes = [tick_map.E for tick_map in maps]
        errors = [ENTRY_ROUNDING * tick_map.terms[0] for tick_map in maps]
        n = len(changes[0])
        E, dE = np.empty((2, len(self.rows), n, n))
        products = {}
        if self.at_once is None:
            products = {row: _in_a_row(row, changes, errors) for row in {*self.rows}}
        for i, (row, sample) in enumerate(zip(self.rows, self.samples, strict=True)):
            if self.at_once is not None:
                frame, error = self.at_once.enclosed(i, changes, errors)
            else:
                frame, error = both(products[row], (changes[sample], errors[sample]))
            E[i] = np.where(self.patterns[i], frame, -np.eye(n))
            dE[i] = np.where(self.patterns[i], error, 0.0)
        if self.drift:
            V, dV = shift_of(np.array(changes), np.array(errors), self.drift)
            return counted_from_rest(E, dE, V, dV, self.drift)
        at = np.ix_(self.kept, self.kept)
        return E[:, *at], dE[:, *at]

    def _ticks(self, symbol):
        """The kinds of a frame's ticks, including the sample at its end, each with the length of
        its run."""
        return [
            (kind, len(list(run)))
            for kind, run in groupby([*self.rows[symbol], self.samples[symbol]])
        ]

    def hull(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray] | None:
        """See `Family`.

        If the number acts in one tick, a frame is `A + f(x) b c'` with `f(x) = x/(1 - d x)`. This
        is monotone between its poles, so all frames lie on the segment between those at both ends,
        at the same place if they have the same d. Otherwise ticks are enclosed by Taylor models of
        second order (see `Polynomials`), and a frame is `C + s L + s^2 Q` within R for s from -1 to
        1. The parabola through the values at -1, 0 and 1 is within 2.25 R of it, and is the Bezier
        curve of its three control points. None if a drift depends on the number.
        """
        if self.drift:
            return None
        direct = np.array([tick_map.D[0, 0] for tick_map in self.ticks.maps if tick_map.inputs])
        through = np.array([low, high])[:, None] * direct
        closing = 1 - through
        is_solvable = np.abs(closing) > SOLVABLE * (1 + np.abs(through))
        has_one_sign = closing[0] * closing[1] > 0
        if not (is_solvable.all() and has_one_sign.all()):
            return None
        A, dA = self.enclosed(low)
        if low == high:
            return A[None], dA[None]
        B, dB = self.enclosed(high)
        if self.at_once is not None and (direct == direct[:1]).all():
            return np.stack([A, B]), np.stack([dA, dB])
        middle = (low + high) / 2
        half = (high - low) / 2
        C, dC = self.enclosed(middle)
        maps = [_enclosure(tick_map, middle, half) for tick_map in self.ticks.maps]
        at = np.ix_(self.kept, self.kept)
        rest = [_joined(self._ticks(i), maps, _after).rest[at] for i in range(len(self.rows))]
        spread = 2.3 * np.array(rest)
        control = 2 * C - (A + B) / 2
        rounding = MIDDLE * (np.abs(A) + np.abs(B) + np.abs(C))
        of_control = 2 * dC + (dA + dB) / 2 + rounding
        return np.stack([A, control, B]), np.stack([dA + spread, of_control + spread, dB + spread])


def alive(acts: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Return those of the states that neither every frame forgets nor every frame sets to zero.
    acts: entries that may be nonzero."""
    while True:
        inside = acts[np.ix_(kept, kept)]
        live = inside.any(0) & inside.any(1)
        if live.all():
            return kept
        kept = kept[live]


@dataclass(frozen=True, slots=True, eq=False)
class _AtOnce:
    """Frames in which the number acts in one tick, `A + f(x) b c'` with `f(x) = x/(1 - d x)`.

    kind: of that tick; before, after: the products of the ticks before and after it, minus the
    identity, with bounds on their errors, for each symbol; None after the last tick.
    """

    A: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    kind: tuple[int, ...]
    before: tuple
    after: tuple

    @staticmethod
    def of(ticks, rows, acting, kept):
        """acting: the index of the tick in which the number acts in each row."""
        changes = [tick_map.E for tick_map in ticks.maps]
        errors = [ENTRY_ROUNDING * tick_map.terms[0] for tick_map in ticks.maps]
        n = len(ticks.states)
        identity = np.eye(n)
        products = {}

        def product_of(row):
            if row not in products:
                products[row] = _in_a_row(row, changes, errors)
            return products[row]

        kinds = []
        before = []
        after = []
        terms = []
        for row, i in zip(rows, acting, strict=True):
            later = row[i + 1 :] if i >= 0 else ()
            kinds.append(row[i])
            before.append(product_of(row[:i]))
            after.append(product_of(later) if later else None)
            tick = ticks.maps[row[i]]
            B = np.zeros((n, 1))
            C = np.zeros((1, n))
            d = 0.0
            if tick.inputs:
                B = tick.B
                C = tick.C
                d = tick.D[0, 0]
            first = identity + before[-1][0]
            last = identity + product_of(later)[0]
            A = last @ (identity + tick.E) @ first
            b = last @ B
            c = C @ first
            terms.append((A[np.ix_(kept, kept)], b[kept], c[:, kept], d))
        A, b, c, d = (np.array(column) for column in zip(*terms, strict=True))
        return _AtOnce(A, b, c, d, tuple(kinds), tuple(before), tuple(after))

    def at(self, x):
        return self.A + (x / (1 - x * self.d))[:, None, None] * (self.b @ self.c)

    def enclosed(self, symbol, changes, errors):
        """The frame minus the identity and bounds on its errors, of ticks at a value of the
        number."""
        kind = self.kind[symbol]
        first = both(self.before[symbol], (changes[kind], errors[kind]))
        if self.after[symbol] is None:
            return first
        return both(first, self.after[symbol])


def _closed(ticks, x):
    """The ticks at a value of the number."""
    if x == 0:
        return ticks
    return OpenTicks(ticks, None).closed(np.zeros((), int), np.asarray(float(x)), terms=True)


def _in_a_row(row, changes, errors):
    """The product of the ticks of a row, minus the identity, with bounds on the errors of its
    entries."""
    n = changes[0].shape[-1]
    if not row:
        return np.zeros((n, n)), np.zeros((n, n))
    return product_with_errors(
        np.array(row), changes, [bound / ENTRY_ROUNDING for bound in errors], per_loop=True
    )


def _enclosure(tick, middle, half):
    """A tick for all values of the number from `middle - half` to `middle + half`."""
    nothing = np.zeros_like(tick.E)
    power = np.eye(len(tick.E)) + tick.E
    if not tick.inputs:
        return Polynomials(np.array([power, nothing, nothing]), nothing, 1, 2)
    d = tick.D[0, 0]
    through = tick.B @ tick.C
    # f(p) = p/(1 - d p): its n-th derivative is n! d^(n-1)/(1 - d p)^(n+1).
    closing = 1 - d * middle
    least = abs(closing) - abs(d) * half
    centre = middle / closing
    slope = half / closing**2
    curve = d * half**2 / closing**3
    rest = d**2 * half**3 / least**4
    terms = np.array([power + centre * through, slope * through, curve * through])
    return Polynomials(terms, rest * np.abs(through), 1, 2)


def _after(first, later):
    return later @ first


def _joined(runs, maps, joined):
    """The product of runs of ticks, `(kind, ticks)`; the powers of a run by repeated squaring."""
    product = None
    for kind, ticks in runs:
        power = maps[kind]
        left = ticks
        while left:
            if left % 2:
                product = power if product is None else joined(product, power)
            left //= 2
            power = joined(power, power) if left else power
    return product
