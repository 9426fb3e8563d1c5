"""Matrices of the frames of a loop along a number, with bounds on their errors, and their hull
over an interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavesweep.engine._loops.block import Block
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine._monodromy.open_ticks import OpenTicks
from wavesweep.engine._monodromy.periodic import Ticks, products_of_rows
from wavesweep.engine._monodromy.product import pattern_of
from wavesweep.engine._monodromy.rounding import both
from wavesweep.engine._sets.taylor_models import Polynomials
from wavesweep.engine._switched.folded import counted_from_rest, shift_of
from wavesweep.engine.doubles import ENTRY_ROUNDING

# least size of 1 - d x, relative to its terms, for which the loop through the number is solved
SOLVABLE = 1e-6
SOME = 0.7  # a value at which no entry of a frame vanishes by chance
# relative error of a matrix due to the rounding of the number in the middle of an interval
MIDDLE = 64 * ENTRY_ROUNDING


class WrittenFrames(NamedTuple):
    """Frames as ticks one after the other, by the numbers of their kinds.

    rows: of each symbol the ticks before its sample; samples: the one that ends it. symbols: the
    kinds of frames. follows: which (columns) may follow which (rows).
    """

    rows: Sequence[tuple[int, ...]]
    samples: Sequence[int]
    symbols: tuple[Symbol, ...]
    follows: np.ndarray


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
    their ticks, and no drift depends on numbers. drift: the marginal modes if they depend on numbers,
    whose rest is then found at each value of the number, else None.
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
    def of(
        ticks: Ticks,
        states: np.ndarray | Sequence[int],
        written: WrittenFrames,
        drift: MarginalModes | None = None,
    ) -> LoopFrames:
        """Return the frames that consist of these ticks. states: the states without drift. drift:
        if it depends on numbers."""
        rows, samples, symbols, follows = written
        changes = [tick_map.E for tick_map in _closed(ticks, np.array(SOME)).maps]
        rows = tuple(map(tuple, rows))
        samples = tuple(samples)
        whole_rows = [(*row, sample) for row, sample in zip(rows, samples, strict=True)]
        patterns = [pattern_of(np.array(row), changes) for row in whole_rows]
        states = np.array(states)
        if not drift:
            states = alive(np.logical_or.reduce(patterns), states)
        acting = []  # the indices of the ticks of each row in which the number acts
        for row in whole_rows:
            acting.append([i for i, kind in enumerate(row) if ticks.maps[kind].inputs])
        at_once = None
        if not drift and all(len(indices) <= 1 for indices in acting):
            acting_tick = [indices[0] if indices else -1 for indices in acting]
            at_once = _AtOnce.of(ticks, whole_rows, acting_tick, states)
        return LoopFrames(
            ticks, rows, samples, tuple(patterns), states, symbols, follows, at_once, drift
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
            maps.append(E)
        changes = np.array(maps)
        identity = np.eye(changes.shape[-1])
        (frames,) = products_of_rows(self._whole_rows, (identity + changes,), _after)
        if self.drift:
            V, dV = shift_of(changes, 0 * changes, self.drift)
            E = frames - identity
            counted, _ = counted_from_rest(E, np.zeros_like(E), V, dV, self.drift)
            return np.eye(self.kept.size) + counted
        return frames[:, self.kept[:, None], self.kept]

    def enclosed(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """See `Family`. Accuracy: to first order in a rounding."""
        (E,), (dE,) = self._enclosed(x)
        return E, dE

    def _enclosed(self, *numbers: float) -> tuple[np.ndarray, np.ndarray]:
        """`enclosed` at some numbers, `(numbers, symbols, n, n)`."""
        maps = _closed(self.ticks, np.array(numbers)).maps
        n = len(self.ticks.states)
        shape = (len(numbers), n, n)
        changes = np.array([np.broadcast_to(tick_map.E, shape) for tick_map in maps])
        sizes = np.array([np.broadcast_to(tick_map.terms[0], shape) for tick_map in maps])
        errors = ENTRY_ROUNDING * sizes
        if self.at_once is not None:
            E, dE = self.at_once.enclosed(changes, errors)
        else:
            E, dE = products_of_rows(self._whole_rows, (changes, errors), both)
        patterns = np.array(self.patterns)[:, None]
        E = np.where(patterns, E, -np.eye(n)).swapaxes(0, 1)
        dE = np.where(patterns, dE, 0.0).swapaxes(0, 1)
        if self.drift:
            counted = []
            for number in range(len(numbers)):
                V, dV = shift_of(changes[:, number], errors[:, number], self.drift)
                counted.append(counted_from_rest(E[number], dE[number], V, dV, self.drift))
            E, dE = (np.array(parts) for parts in zip(*counted, strict=True))
            return E, dE
        column = self.kept[:, None]
        return E[..., column, self.kept], dE[..., column, self.kept]

    @property
    def _whole_rows(self) -> list[tuple[int, ...]]:
        """The kinds of each symbol's ticks, including the sample that ends its frame."""
        return [(*row, sample) for row, sample in zip(self.rows, self.samples, strict=True)]

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
        at_once = self.at_once is not None and (direct == direct[:1]).all()
        if low == high or at_once:
            return self._enclosed(*dict.fromkeys((low, high)))
        middle = (low + high) / 2
        half = (high - low) / 2
        (A, C, B), (dA, dC, dB) = self._enclosed(low, middle, high)
        enclosures = [_enclosure(tick_map, middle, half) for tick_map in self.ticks.maps]
        maps = (
            np.array([enclosure.terms for enclosure in enclosures]),
            np.array([enclosure.rest for enclosure in enclosures]),
        )
        _, rest = products_of_rows(self._whole_rows, maps, _after_over)
        rest = rest[:, self.kept[:, None], self.kept]
        spread = 2.3 * rest
        control = 2 * C - (A + B) / 2
        rounding = MIDDLE * (np.abs(A) + np.abs(B) + np.abs(C))
        of_control = 2 * dC + (dA + dB) / 2 + rounding
        return np.stack([A, control, B]), np.stack([dA + spread, of_control + spread, dB + spread])


def alive(acts: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Return those of the states that neither every frame forgets nor every frame sets to zero.
    acts: entries that may be nonzero."""
    while True:
        inside = acts[np.ix_(states, states)]
        live = inside.any(0) & inside.any(1)
        if live.all():
            return states
        states = states[live]


@dataclass(frozen=True, slots=True, eq=False)
class _AtOnce:
    """Frames in which the number acts in one tick, `A + f(x) b c'` with `f(x) = x/(1 - d x)`.

    kinds: of that tick in each symbol. before, after: the products of the ticks before and after it,
    minus the identity, with bounds on their errors, `(symbols, 1, n, n)` each. followed: which
    symbols have ticks after it.
    """

    A: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    kinds: tuple[int, ...]
    before: tuple[np.ndarray, np.ndarray]
    after: tuple[np.ndarray, np.ndarray]
    followed: np.ndarray

    @staticmethod
    def of(
        ticks: Ticks, rows: list[tuple[int, ...]], acting: list[int], states: np.ndarray
    ) -> _AtOnce:
        """acting: the index of the tick in which the number acts in each row; -1, the last one, if
        it acts in none."""
        n = len(ticks.states)
        nothing = np.zeros((1, n, n))
        changes = np.concatenate([[tick_map.E for tick_map in ticks.maps], nothing])
        sizes = np.concatenate([[tick_map.terms[0] for tick_map in ticks.maps], nothing])
        identity = np.eye(n)
        still = (len(ticks.maps),)  # a row in which nothing happens
        kinds = [row[i] for row, i in zip(rows, acting, strict=True)]
        earlier = [row[:i] or still for row, i in zip(rows, acting, strict=True)]
        later = [row[i + 1 :] if i >= 0 else () for row, i in zip(rows, acting, strict=True)]
        stretches = earlier + [row or still for row in later]
        E, dE = products_of_rows(stretches, (changes, ENTRY_ROUNDING * sizes), both)
        count = len(rows)
        terms = []
        for first, last, kind in zip(
            identity + E[:count], identity + E[count:], kinds, strict=True
        ):
            tick = ticks.maps[kind]
            B = np.zeros((n, 1))
            C = np.zeros((1, n))
            d: np.ndarray | float = 0.0
            if tick.inputs:
                B = tick.B
                C = tick.C
                d = tick.D[0, 0]
            A = last @ (identity + tick.E) @ first
            b = last @ B
            c = C @ first
            terms.append((A[np.ix_(states, states)], b[states], c[:, states], d))
        A, b, c, d = (np.array(column) for column in zip(*terms, strict=True))
        before = E[:count, None], dE[:count, None]
        followed = np.array([bool(row) for row in later])
        after = E[count:, None][followed], dE[count:, None][followed]
        return _AtOnce(A, b, c, d, tuple(kinds), before, after, followed)

    def at(self, x: float) -> np.ndarray:
        return self.A + (x / (1 - x * self.d))[:, None, None] * (self.b @ self.c)

    def enclosed(self, changes: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The frames minus the identity and bounds on their errors, of ticks at some values of the
        number, `(symbols, numbers, n, n)`."""
        kinds = list(self.kinds)
        E, dE = both(self.before, (changes[kinds], errors[kinds]))
        some = self.followed
        E[some], dE[some] = both((E[some], dE[some]), self.after)
        return E, dE


def _closed(ticks: Ticks, numbers: np.ndarray) -> Ticks:
    """The ticks at values of the number."""
    return OpenTicks(ticks, None).closed(np.zeros((), int), numbers, terms=True)


def _enclosure(tick: Block, middle: float, half: float) -> Polynomials:
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


def _after(first: tuple[np.ndarray], later: tuple[np.ndarray]) -> tuple[np.ndarray]:
    return (later[0] @ first[0],)


def _after_over(
    first: tuple[np.ndarray, np.ndarray], later: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The same of ticks over an interval, as terms `(ticks, 3, n, n)` and what these leave out."""
    before, after = (
        Polynomials(np.swapaxes(terms, 0, 1), rest, 1, 2) for terms, rest in (first, later)
    )
    product = after @ before
    return np.swapaxes(product.terms, 0, 1), product.rest
