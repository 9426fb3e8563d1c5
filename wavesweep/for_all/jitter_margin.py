"""A proof for messages of any age by a small gain, without a matrix for each thing that may happen.

A receiver that holds one of the last messages `m_0` to `m_D`, the newest first, holds
`(m_0 + m_D)/2 + w` with `w = (sum of some d - sum of the others)/2`, where d are the D differences of
neighbours: `w^2 <= D/4 (sum of d^2)`, and no smaller multiple does for all constant d. Summed over a
period, all w^2 are at most `g` times all d^2 with `g = sum over ticks of D^2/4`. So the loop decays if
forms X at each tick of its period and a weight c of each channel are such that, but for the messages
in time,

    x'X x + sum c w^2 - x+'X+ x+ - sum c g d^2   is positive definite in x and w:

then `x'X x` and weighted squares of the last d are a norm in which all shrink (C.-Y. Kao, B. Lincoln,
Simple stability criteria for systems with time-varying delays, Automatica 40, 2004, where the middle
delay has the gain `D/sqrt 2` in place of `D/2`). `norm_check` proves the forms; no frequency is looked
at. Where the messages that are kept would be most of the states, it is `m_0 + w` with a w twice as
large, and only m_0 is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np

from wavesweep.engine.doubles import EPS
from wavesweep.engine.frames import Bounded
from wavesweep.engine.norms import START, Element, TickMaps
from wavesweep.engine.sets import Polynomials, Side
from wavesweep.engine.switched import (
    Centre,
    FramesOver,
    Graph,
    LoopFrames,
    Norms,
    shrink_along,
    units_of_places,
)
from wavesweep.for_all.channel_families import NOTHING, SENT, NotByWordsError
from wavesweep.for_all.open_channels import OpenLoop, taken_from
from wavesweep.for_all.peak_gain import PeakGain

LEAST_STEP = 0.005  # of a number, a stretch that ends a proof
# Messages that are kept up to which all are states: 82 take minutes, where two take 10 ms (two
# channels of `late = 40` in every tick).
MOST_KEPT = 60
DOUBLINGS = 30  # of the number of periods, after which nothing of a state is left
RANK = 1e-9  # of the largest change that a number makes in a tick, one that counts
# What the balance keeps of a state squared, in units in which it loses 1e-3 a tick, and of what it
# gives to d: less where little is left, more where rounding of many states costs more. The last is
# for a state that is gone in a tick, whose own unit is far below what it gives to d.
SHARES = ((1e-3, 0.0), (1e-4, 0.0), (1e-6, 0.0), (1e-6, 1e-6))
ENOUGH = 0.7  # gain squared up to which weights that were found for other numbers do
NEAR = {
    "xatol": 0.1,
    "fatol": 1e-3,
}  # of the logarithms of weights: the gain is flat about the best
# Angles (rad per period) at which weights are compared, which decide nothing.
ANGLES = np.unique(np.concatenate([START, np.geomspace(1e-4, np.pi, 20)]))


@dataclass(frozen=True, slots=True, eq=False)
class SmallGain:
    """A loop whose channels show `(m_0 + m_D)/2 + w`, or `m_0 + w`; in its ticks w are states that
    are free, and become the differences d.

    loop: see `OpenLoop`, with the messages that are kept. kinds: of its ticks. whole: its ticks. slots: of each channel the state that
    is w and d. gains: `g` of each channel. peaks: the same loop by peaks, None if what drifts is sent.
    known: logarithms of the weights that were found last, by their count.
    """

    loop: OpenLoop
    kinds: Sequence[tuple]
    whole: LoopFrames
    slots: np.ndarray
    gains: np.ndarray
    peaks: PeakGain | None
    known: dict[int, np.ndarray] = field(default_factory=dict)

    @staticmethod
    def of(loop: OpenLoop) -> SmallGain:
        """The same of a loop with channels; the middle delay is taken if few messages are kept for it.

        The energy gain g of d over w is `sum D^2` over a channel's ticks of a period, D the most by
        which what is shown is older than the newest message, times 1/4 about the middle.
        """
        newest = replace(loop, choices=[[choice[:1] for choice in row] for row in loop.choices])
        middle = sum(loop.counts) <= MOST_KEPT
        of_messages = loop if middle else newest
        about = (0.5, 0.5) if middle else (1.0, 0.0)
        kinds, whole, slots = _with_free(loop, of_messages, about, ((SENT, 1.0), (0, -1.0)))
        gains = []
        for slot in slots:
            channel = loop.channels[slot]
            oldest = np.zeros(channel.every)
            for now, choices in enumerate(loop.choices):
                since = (now - channel.phase) % channel.every
                oldest[since] = max(oldest[since], choices[slot][-1] or 0)
            gains.append(oldest @ oldest * about[0] ** 2)
        peaks = None
        with suppress(NotByWordsError):
            _, of_peaks, free = _with_free(loop, newest, (0.0, 0.0), ((SENT, 1.0),))
            peaks = PeakGain(of_peaks, free)
        states = np.array([*slots.values()], int)
        return SmallGain(of_messages, kinds, whole, states, np.array(gains), peaks)

    def over(self, sides: Sequence[Side]) -> FramesOver:
        """The ticks over the cells of a box of sides; the loop is that of some of its numbers."""
        return self.loop.over(self.kinds, self.whole.symbols, sides, self.whole.kept)

    def found(self, A: Polynomials) -> tuple[Centre, np.ndarray] | None:
        """Forms for the ticks in a cell, and their slopes, which are 0; None if none are found."""
        identity = np.eye(A.terms.shape[-1])
        middle, *slopes = A.terms[: 1 + A.numbers]
        for norms, units in self._forms(middle, slopes):
            of_nodes = np.concatenate([units, np.roll(units, -1, 0)])
            P = of_nodes.mT @ norms.P @ of_nodes
            centre = Centre((P + P.mT) / 2, norms.graph, identity, identity)
            if centre.shrinks(middle):
                return centre, np.zeros((A.numbers, *norms.P.shape))
        return None

    def reached(self, x: float, goal: float) -> float:
        """The number up to which all from x towards the goal are proved; NaN for x NaN."""
        for proved in self._proofs:
            step = goal - x
            again = False
            while abs(step) > LEAST_STEP * abs(x) and x != goal:
                ahead = goal if abs(goal - x) <= abs(step) else x + step
                is_proved = proved(*sorted((x, ahead)))
                if is_proved:
                    x = ahead
                if again or not is_proved:
                    step *= 2 if is_proved else 0.5
                again = is_proved
        return x

    def proved(self, low: float, high: float) -> bool:
        """Whether the loop decays for all numbers from low to high, which may be the same."""
        return any(proved(low, high) for proved in self._proofs)

    @property
    def _proofs(self) -> list[Callable[[float, float], bool]]:
        """By peaks, which take no search, and by squares."""
        return [*([self.peaks.proved] if self.peaks else []), self._by_squares]

    def _by_squares(self, low: float, high: float) -> bool:
        points = self.whole.hull(low, high)
        if points is None:
            return False
        half = (self.whole.at(high) - self.whole.at(low)) / 2
        norms_found = self._forms(self.whole.at((low + high) / 2), [half])
        follows = self.whole.follows
        return any(
            shrink_along([norms], *_in_units(points, to), follows) for norms, to in norms_found
        )

    def _forms(
        self, M: np.ndarray, halves: Sequence[np.ndarray]
    ) -> Iterator[tuple[Norms, np.ndarray]]:
        """Yield norms in which ticks M may shrink, `(ticks, n, n)`, and all that differ from them by up
        to the halves of changes; with the units of the states, `z = to x` before each tick, that the
        norms are in."""
        slots = self.slots
        n = M.shape[-1]
        ticks = np.arange(len(M))
        rest = np.delete(np.arange(n), slots)
        to = units_of_places(_parts(M, rest, slots)[0], ticks)
        if to is None:
            return
        units = np.broadcast_to(np.eye(n), M.shape).copy()
        units[:, *np.ix_(rest, rest)] = to
        later = np.roll(units, -1, 0)
        back = np.linalg.inv(units)
        columns, rows, owner = _channels_of((later @ half @ back for half in halves), slots.size)
        channel = [*range(slots.size), *owner]
        both = np.zeros((ticks.size, n + len(channel) - slots.size, n + len(channel) - slots.size))
        both[:, :n] = np.concatenate([later @ M @ back, *columns], -1)
        both[:, n:, :n] = np.concatenate(rows, 1)
        gains = np.append(self.gains, np.ones(len(channel) - slots.size))
        A, B, C, D = _parts(both, rest, [*slots, *range(n, both.shape[-1])])
        weight = _weights(A, B, C, D, gains, np.array(channel), self.known)
        if weight is None:
            return
        taken = np.sqrt(weight)
        outputs = (taken * np.sqrt(gains))[:, None]
        graph = Graph(ticks, ticks, ticks.size + ticks)
        for shares in SHARES:
            X = _stored(A, B / taken, outputs * C, outputs * D / taken, *shares)
            P = np.zeros((2, *M.shape))
            P[:, :, *np.ix_(rest, rest)] = X
            P[1] = np.roll(P[1], -1, 0)
            P[0][:, slots, slots] = weight[: slots.size]
            P[1][:, slots, slots] = (weight * gains)[: slots.size]
            yield Norms(np.concatenate((P + P.mT) / 2), graph), units


def _in_units(points, to) -> tuple[np.ndarray, np.ndarray]:
    """Ticks less the identity, with bounds on their errors, in units `z = to x` of the states before
    each: in those of the spec a form may have eigenvalues that no double tells from 0."""
    E, dE = points
    identity = np.eye(E.shape[-1])
    back = Bounded.exact(np.linalg.inv(to))
    later = back.inverse().each(lambda units: np.roll(units, -1, 0))
    ticks = later @ (Bounded(E, dE) + Bounded.exact(identity)) @ back
    return ticks.value - identity, ticks.error + EPS * np.abs(ticks.value)


def _channels_of(
    changes: Iterable[np.ndarray], first: int
) -> tuple[list[np.ndarray], list[np.ndarray], list[int]]:
    """What numbers change, as channels beside those of the slots: `S = (U s^1/2) (s^1/2 V')` by its
    singular values, of which the input w is at most d. changes: of each number, `(ticks, n, n)`.

    Return the columns that the inputs enter by, the rows that the outputs read, and the number of each
    channel, counted from `first`.
    """
    columns = []
    rows = []
    owner = []
    for number, change in enumerate(changes, first):
        U, size, V = np.linalg.svd(change)
        some = np.flatnonzero((size > RANK * size.max()).any(0))
        root = np.sqrt(size[:, None, some])
        columns.append(U[..., some] * root)
        rows.append(root.mT * V[:, some])
        owner += [number] * some.size
    return columns, rows, owner


def _parts(M, rest, free):
    """The blocks of matrices whose rows and columns are some states, and those that are free."""
    return [M[:, *np.ix_(rows, columns)] for rows in (rest, free) for columns in (rest, free)]


def _weights(A, B, C, D, gains, channel, weights_known) -> np.ndarray | None:
    """The weights of the inputs, one for each channel, with which the largest gain from w to d, of
    those at some angles, is below 1, and least if `weights_known` has none; None if there are none."""
    from scipy.linalg import matrix_balance
    from scipy.optimize import minimize

    ticks = np.arange(len(A))
    identity = np.eye(A.shape[-1])
    lifted = TickMaps.of([*zip(A - identity, B, C, D, strict=True)], ticks, ()).lifted(
        measured=False
    )
    H = lifted.response(np.zeros(ANGLES.size, int), ANGLES)
    some = np.abs(H).any((0, 2))
    inputs = np.tile(channel, len(A))
    H = np.tile(np.sqrt(gains), len(A))[some, None] * H[:, some]

    def gain(logarithms):
        scale = np.exp(logarithms[inputs])
        scaled = scale[some, None] * H / scale
        return np.linalg.eigvalsh(scaled @ scaled.conj().mT).max()

    # Steps are a share of where it starts; only differences count.
    begun = np.full(1 + channel.max(), 8.0)
    best = weights_known.get(begun.size, begun)
    if gain(best) > ENOUGH:
        of_channel = 1.0 * (inputs == np.arange(begun.size)[:, None])
        between = np.sqrt((of_channel[:, some] @ np.square(np.abs(H)) @ of_channel.T).max(0))
        _, (sizes, _) = matrix_balance(between, permute=False, separate=True)
        begins = begun - np.log(sizes)
        best = minimize(gain, begins, method="Nelder-Mead", options=NEAR).x
        weights_known[begun.size] = best
    return np.exp(2 * (best - begun)[channel]) if gain(best) < 1 else None


def _stored(A, B, C, D, share, of_given) -> np.ndarray:
    """Forms X before each tick with `x'X x + w'w - x+'X+ x+ - d'd` a share of all states or more,
    and one of what each state alone gives to d, if there are any."""
    output_form = C.mT @ C
    storage = np.eye(A.shape[-1]) * (share + of_given * output_form)
    of_inputs = np.eye(D.shape[-1]) - D.mT @ D
    elements = [*map(Element.of, A, B, -output_form - storage, -C.mT @ D, of_inputs)]
    ahead = reduce(Element.then, elements)
    for _ in range(DOUBLINGS):
        ahead = ahead.then(ahead)
    X = []
    for element in reversed(elements):
        ahead = element.then(ahead)
        X.append(-ahead.Q)
    return np.array(X[::-1])


def _with_free(
    loop: OpenLoop, loop_of_messages: OpenLoop, about: tuple[float, float], sent: tuple
) -> tuple[list[tuple], LoopFrames, dict[int, int]]:
    """The kinds of the ticks of a loop, and these ticks, in which a channel shows w and shares `about`
    of the newest and of the oldest message, and w becomes what is given; with the state that is w
    by the number of the channel, if not all that it shows is in time.

    loop_of_messages: the loop with the messages that are kept."""
    kinds = []
    for tick, alike in enumerate(loop.alike):
        taken = []
        for channel, count, choice in zip(
            loop.channels, loop_of_messages.counts, loop.choices[tick], strict=True
        ):
            sends = channel.sends(tick)
            shows, registers = taken_from(sends, count, 0)
            if choice[-1]:
                ends = shows, registers[min(choice[-1], count - 1)]
                shows = (*zip(ends, about, strict=True), (count, 1.0))
            taken.append((shows, (*registers, sent if sends else NOTHING)))
        kinds.append((alike, tuple(taken)))
    ticks = len(kinds)
    rows = [[kind] for kind in kinds]
    whole = loop_of_messages.frames(rows, tuple(range(ticks)), np.zeros((ticks, ticks), bool), 1)
    names = [whole.ticks.states[state] for state in whole.kept]
    slots = {}
    for tick, (channel, count) in enumerate(
        zip(loop.channels, loop_of_messages.counts, strict=True)
    ):
        name = f"{channel.name}.message {count + 1}"
        if name in names:
            slots[tick] = names.index(name)
    return kinds, whole, slots
