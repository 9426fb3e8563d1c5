"""Loops over a frame: what each tick shows of the state at the frame's start, and what its force
leaves, with errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.bounded import Bounded, sum_rounding
from wavesweep.engine._monodromy.periodic import Ticks, in_a_row, then
from wavesweep.engine._monodromy.unit_circle import solve
from wavesweep.engine._response.bordered import Bordered
from wavesweep.engine._response.circle import Circle, circle_of
from wavesweep.engine._response.modal import Modal
from wavesweep.engine._response.port import Port, reached
from wavesweep.engine._state_space import StateSpace
from wavesweep.engine.doubles import ENTRY_ROUNDING

TURN_ROUNDINGS = 16  # of the angle, the sine and the product by which a turn doubles a ladder
LEAF = 64  # ticks up to which the outputs for forces of the same stretch are kept as a matrix


@dataclass(frozen=True, eq=False)
class Stretch:
    """Some ticks in a row.

    E `(..., n, n)`: the change of the state. observability `(..., p, ticks, n)`: the outputs in
    each tick for the state before the first. controllability `(..., n, ticks)`: what the force of
    each tick adds to the state after the last. For forces of the same stretch: forced `(..., p,
    ticks)` has the sums of outputs over equal numbers of ticks since a force, and impulse `(...,
    ticks, ticks)` the last output in each tick. A stretch of more than LEAF ticks has two halves,
    `first` and `second`, in place of these. state_index, rows: which of their states and outputs it
    has, if not all.
    """

    E: Bounded
    observability: Bounded
    controllability: Bounded
    forced: Bounded | None
    impulse: Bounded | None
    first: Stretch | None = None
    second: Stretch | None = None
    state_index: np.ndarray | slice | None = None
    rows: slice = field(default_factory=lambda: slice(None))

    @staticmethod
    def of(port: Port) -> Stretch:
        """Return the port's frame; repeated stretches are joined once."""
        ticks = []
        for tick, terms in zip(port.maps, port.sizes, strict=True):
            pairs = []
            for matrix, size in zip(tick, terms, strict=True):
                pairs.append(Bounded(*np.broadcast_arrays(matrix, ENTRY_ROUNDING * size)))
            E, B, C, D = pairs
            observability = C.part(..., None, slice(None))
            ticks.append(Stretch(E, observability, B, D, D.part(..., [-1], slice(None))))
        return in_a_row(port.kind.tolist(), ticks, _joined)

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return self.controllability.value.shape[-1]

    def showing(self, rows: slice) -> Stretch:
        """Return the frame with some outputs, and the states that these need to know of it."""
        change = self.E.value
        n = change.shape[-1]
        observability = self.observability.part(..., rows, slice(None), slice(None))
        reads = (change + np.eye(n) != 0).any(tuple(range(change.ndim - 2)))
        shown = (observability[0] != 0).any(tuple(range(observability[0].ndim - 1)))
        index = reached(shown, reads)
        return replace(
            self,
            E=self.E.part(..., index[:, None], index),
            observability=observability.part(..., index),
            controllability=self.controllability.part(..., index, slice(None)),
            forced=self.forced and self.forced.part(..., rows, slice(None)),
            state_index=index,
            rows=rows,
        )

    @cached_property
    def sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """Sums over the ticks of the sizes of `observability`, `(..., p, n)`, and of
        `controllability`, `(..., n, 1)`."""
        return np.abs(self.observability.value).sum(-2), np.abs(self.controllability.value).sum(
            -1, keepdims=True
        )

    @cached_property
    def forced_size(self) -> np.ndarray:
        """Sum of the sizes of the terms of the outputs for forces of the same stretch, `(...,
        p)`."""
        if self.forced:
            return np.abs(self.forced.value).sum(-1)
        first, second = self.halves
        across = (second.sizes[0] @ first.sizes[1])[..., 0]
        return (first.forced_size + second.forced_size + across)[..., self.rows]

    def impulse_map(self, index: int = 0) -> np.ndarray:
        """Return the map from all forces to the last output in each tick, for the state 0;
        index: 1 for its errors."""
        if self.impulse:
            return self.impulse[index]
        first, second = self.halves
        return _triangular(first.impulse_map(index), self.across[index], second.impulse_map(index))

    @property
    def across(self) -> Bounded:
        """The map from forces of the first half to the last output in the second."""
        first, second = self.halves
        last = second.observability.part(..., -1, slice(None), slice(None))
        return last @ first.controllability

    @property
    def halves(self) -> tuple[Stretch, Stretch]:
        """`first` and `second`, of a stretch that has them."""
        return self.first, self.second  # type: ignore[return-value]  # asked of joined ones alone

    @property
    def own_maps(self) -> tuple[Bounded, Bounded]:
        """`forced` and `impulse`, of a stretch of no more than LEAF ticks."""
        return self.forced, self.impulse  # type: ignore[return-value]  # asked of short ones alone


def _joined(first: Stretch, second: Stretch) -> Stretch:
    """Return one stretch after the other."""
    identity = Bounded.exact(np.eye(first.E.value.shape[-1]))
    before = identity + first.E
    E = first.E.then(second.E)._replace(value=then(first.E.value, second.E.value))
    outputs = second.observability
    inputs = first.controllability
    carried = outputs @ before.part(..., None, slice(None), slice(None))
    observability = Bounded.joined((first.observability, carried), -2)
    controllability = Bounded.joined(((identity + second.E) @ inputs, second.controllability), -1)
    if first.ticks + second.ticks > LEAF:
        return Stretch(E, observability, controllability, None, None, first, second)
    later = outputs @ inputs.part(..., None, slice(None), slice(None))
    forced_first, impulse_first = first.own_maps
    forced_second, impulse_second = second.own_maps
    of_first = _padded(forced_first, second.ticks)
    forced = of_first + _padded(forced_second, first.ticks) + _sums_by_lag(later)
    across = later.part(..., -1, slice(None), slice(None))
    impulse = Bounded(*map(_triangular, impulse_first, across, impulse_second))
    return Stretch(E, observability, controllability, forced, impulse)


def _triangular(first: np.ndarray, across: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the map of two stretches one after the other, `[[first, 0], [across, second]]`, with
    `across` from the forces of the first to the outputs of the second."""
    batch = np.broadcast_shapes(*(block.shape[:-2] for block in (first, across, second)))
    rows = first.shape[-1]
    joint = np.zeros((*batch, rows + second.shape[-1], rows + second.shape[-1]))
    joint[..., :rows, :rows] = first
    joint[..., rows:, :rows] = across
    joint[..., rows:, rows:] = second
    return joint


def _padded(forced: Bounded, count: int) -> Bounded:
    """The sums of one stretch by lag, and 0 for `count` lags that are longer than it."""
    return forced.each(
        lambda sums: np.concatenate([sums, np.zeros((*sums.shape[:-1], count))], axis=-1)
    )


def _sums_by_lag(later: Bounded) -> Bounded:
    """Return the sums of an impulse response along its diagonals, one for each lag from force to
    output:

        s_l = sum of h_ij over all i, j with first + i - j = l,   l = 0 ... first + second - 1.

    later: h `(..., second, first)`, the output in tick i of the second stretch for a force in tick
    j of the first. These are at least a tick apart, so `s_0 = 0`.
    """
    second, first = later.value.shape[-2:]
    sums_and_errors = []
    for h in (later.value, later.with_rounding(second)):
        sums = np.zeros((*h.shape[:-2], first + second))
        for i in range(second):
            least_lag = i + 1  # of the last force
            sums[..., least_lag : least_lag + first] += h[..., i, ::-1]
        sums_and_errors.append(sums)
    return Bounded(*sums_and_errors)


@dataclass(frozen=True, slots=True)
class Sums:
    """A stretch under the force z^i in tick i: the outputs' sums over its ticks, each times z^-i,
    are `rows X + forced`.

    rows `(..., p, points, n)`; forced `(..., p, points)`; driven `(..., n, points)`: what the force
    adds to the state. Each is followed by a bound on its error, drows `(..., p, n)`, dforced `(...,
    p, points)`, ddriven `(..., n, 1)`.
    """

    rows: np.ndarray
    drows: np.ndarray
    forced: np.ndarray
    dforced: np.ndarray
    driven: np.ndarray
    ddriven: np.ndarray

    @staticmethod
    def of(stretch: Stretch, points: Any, memo: dict[int, Sums] | None = None) -> Sums:
        """Return the sums at these points of the circle (see `Circle`); memo: those of its
        halves, by identity."""
        memo = {} if memo is None else memo
        if id(stretch) not in memo:
            if stretch.forced:
                memo[id(stretch)] = _of_leaf(stretch, stretch.forced, points)
            else:
                memo[id(stretch)] = _of_halves(stretch, points, memo)
        return memo[id(stretch)]


def _of_leaf(stretch: Stretch, sums: Bounded, points: Any) -> Sums:
    """The sums of a stretch whose outputs are kept as matrices: with O_i of the observability, G_i
    of the controllability and F_l the forced outputs over the lag l,

        rows = sum_i z^-i O_i,   forced = sum_l z^-l F_l,   driven = sum_i z^i G_i.
    """
    z = points.ladder(stretch.ticks)
    terms = stretch.ticks + TURN_ROUNDINGS * stretch.ticks.bit_length()
    # contiguous, as BLAS wants them
    real = z.real.copy()
    imag = z.imag.copy()
    O = stretch.observability.value
    forced = sums.value
    G = stretch.controllability.value
    return Sums(
        rows=real.T @ O - 1j * (imag.T @ O),
        drows=stretch.observability.with_rounding(terms).sum(-2),
        forced=forced @ real - 1j * (forced @ imag),
        dforced=sums.with_rounding(terms).sum(-1, keepdims=True),
        driven=G @ real + 1j * (G @ imag),
        ddriven=stretch.controllability.with_rounding(terms).sum(-1, keepdims=True),
    )


def _of_halves(stretch: Stretch, points: Any, memo: dict[int, Sums]) -> Sums:
    """The sums of a stretch from those of its halves a and b, with a turn by z^m for the m ticks
    of a:

        rows = rows_a + z^-m rows_b (I + E_a),
        forced = forced_a + forced_b + z^-m rows_b driven_a,
        driven = (I + E_b) driven_a + z^m driven_b.
    """
    first, second = stretch.halves
    a = Sums.of(first, points, memo)
    b = Sums.of(second, points, memo)
    n = first.E.value.shape[-1]
    identity = Bounded.exact(np.eye(n))
    terms = n + TURN_ROUNDINGS
    dbefore = (identity + first.E).with_rounding(terms)
    dafter = (identity + second.E).with_rounding(terms)
    before = np.eye(n) + first.E.value
    after = np.eye(n) + second.E.value
    rounding = sum_rounding(terms, of_complex=True)
    size = second.sizes[0]
    largest_input = first.sizes[1]
    turn = points.turn(first.ticks)
    back = turn.conj()
    carried = (b.rows * a.driven.mT[..., None, :, :]).sum(-1)
    rows = a.rows + back[:, None] * (b.rows @ before[..., None, :, :])
    drows = a.drows + b.drows @ np.abs(before) + size @ dbefore
    forced = a.forced + b.forced + back * carried
    of_carried = a.ddriven + rounding * largest_input
    dforced = a.dforced + b.dforced + b.drows @ largest_input + size @ of_carried
    driven = after @ a.driven + turn * b.driven
    ddriven = np.abs(after) @ a.ddriven + b.ddriven + dafter @ largest_input
    states = slice(None) if stretch.state_index is None else stretch.state_index
    outputs = stretch.rows
    of_rows, of_driven = (sum_rounding(TURN_ROUNDINGS) * sizes for sizes in stretch.sizes)
    return Sums(
        rows=rows[..., outputs, :, states],
        drows=drows[..., outputs, states] + of_rows,
        forced=forced[..., outputs, :],
        dforced=dforced[..., outputs, :],
        driven=driven[..., states, :],
        ddriven=ddriven[..., states, :] + of_driven,
    )


@dataclass(frozen=True, eq=False)
class Lifted:
    """Loops over a frame, ready for any frequency.

    with_position: their ticks in a row, with the outputs of the port and the position at the
    beginning of each tick. frame: the same without the position and all that only this depends on.
    lost: which loops overflow in it, and are left at 0.
    """

    port: Port
    with_position: Stretch
    frame: Stretch
    lost: np.ndarray

    @staticmethod
    def of(port: Port) -> Lifted:
        """Return the loops over the port's frame."""
        with np.errstate(all="ignore"):  # a frame that overflows is found here
            frame = Stretch.of(_with_position(port))
            lost = np.broadcast_to(~_all(frame, np.isfinite), port.batch)
            if lost.any():
                frame = Stretch.of(_with_position(_without(port, lost)))
        return Lifted(port, frame, frame.showing(slice(0, port.outputs)), lost)

    @property
    def order(self) -> int:
        """Number of states."""
        return self.frame.E.value.shape[-1]

    @property
    def weight(self) -> int:
        """Numbers that each frequency takes."""
        return self.lost.size * self.port.outputs * (self.order + 2) + min(self.frame.ticks, LEAF)

    @cached_property
    def modal(self) -> Modal:
        """The modes of the frame."""
        return Modal(*self.frame.E)

    @cached_property
    def bordered(self) -> Bordered:
        """The larger system, for what modes do not give."""
        return Bordered(self.port.observable(), Stretch.of, Sums.of)

    @cached_property
    def of_positions(self) -> tuple[Stretch, np.ndarray]:
        """The frame with the position as its only output, and which loops have numbers there
        whose squares overflow."""
        frame = self.with_position.showing(slice(self.port.outputs, None))
        # Entries whose squares are next to overflow.
        huge = ~_all(frame, lambda entries: np.abs(entries) < 1e100) & ~self.lost
        if huge.any():
            frame = Stretch.of(_with_position(_without(self.port, huge | self.lost))).showing(
                slice(self.port.outputs, None)
            )
        return frame, huge | self.lost

    def stable_for_sure(self) -> np.ndarray:
        """Return which loops are stable whatever rounding does, `(...)`, by Gershgorin's discs
        about their eigenvalues."""
        n = self.port.maps[0][0].shape[-1]
        E, dE = (matrix[..., :n, :n] for matrix in self.with_position.E)
        with np.errstate(all="ignore"):
            poles, V = np.linalg.eig(E)
            into = solve(V.astype(complex), np.broadcast_to(np.eye(n), V.shape))
            left = np.abs(into @ E @ V - poles[..., None, :] * np.eye(n)) + np.abs(
                into
            ) @ dE @ np.abs(V)
            sure = (np.abs(1 + poles) + 2 * left.sum(-1) < 1).all(-1)
        return sure & ~self.lost

    def circle(self, frequency_hz: np.ndarray) -> Circle:
        """Return the frequencies (Hz) on the circles of this loop."""
        return circle_of(
            np.asarray(frequency_hz, float).tobytes(), self.port.rate, self.frame.ticks
        )


def _all(frame: Stretch, test: Callable[..., Any]) -> bool:
    """Of which loops all entries of a frame pass a test."""
    passed = [test(matrix).all((-1, -2)) for matrix in (*frame.E, *frame.controllability)]
    passed += [test(outputs).all((-1, -2, -3)) for outputs in frame.observability]
    return np.logical_and.reduce(np.broadcast_arrays(*passed))


def _without(port: Port, lost: np.ndarray) -> Port:
    """Return the port with zeros in place of the loops that are lost."""
    lost = lost[..., None, None]

    def zeroed(tick: StateSpace) -> StateSpace:
        return StateSpace(*(np.where(lost, 0.0, matrix) for matrix in tick))

    return replace(port, maps=tuple(map(zeroed, port.maps)), sizes=tuple(map(zeroed, port.sizes)))


def _with_position(port: Port) -> Port:
    """Return the port with the position at the beginning of each tick as a further output, a
    state more if it drifts."""
    maps = tuple(_tick_with_position(tick, port.position) for tick in port.maps)
    row = None if port.position is None else np.abs(port.position)
    return replace(
        port, maps=maps, sizes=tuple(_tick_with_position(tick, row) for tick in port.sizes)
    )


def _tick_with_position(tick: StateSpace, position: np.ndarray | None) -> StateSpace:
    drifts = position is None
    outputs, n = tick.C.shape[-2:]
    batch = np.broadcast_shapes(*(matrix.shape[:-2] for matrix in tick))
    E = np.zeros((*batch, n + drifts, n + drifts))
    B = np.zeros((*batch, n + drifts, 1))
    C = np.zeros((*batch, outputs + 1, n + drifts))
    D = np.zeros((*batch, outputs + 1, 1))
    E[..., :n, :n] = tick.E
    B[..., :n, :] = tick.B
    C[..., :-1, :n] = tick.C
    D[..., :-1, :] = tick.D
    if drifts:  # the position is the sum of its displacements
        E[..., n, :n] = tick.C[..., 0, :]
        B[..., n, :] = tick.D[..., 0, :]
        C[..., -1, n] = 1.0
    else:
        C[..., -1:, :] = position
    return StateSpace(E, B, C, D)


def over_frame(port: Port, ticks: int, *, positions: bool) -> StateSpace:
    """Return one loop over a frame, from the forces of its ticks (N) to the displacements in them
    (m).

    ticks: in a frame, if the loop's own is a single one. positions: to those at the starts of the
    ticks instead; one that drifts is then among the states.
    """
    row = slice(1)
    if positions:
        port = _with_position(port)
        row = slice(-1, None)

    def of_row(matrices: Any) -> Any:
        return tuple(StateSpace(E, B, C[row], D[row]) for E, B, C, D in matrices)

    kind = np.tile(port.kind, ticks // port.kind.size)
    port = replace(port, kind=kind, maps=of_row(port.maps), sizes=of_row(port.sizes))
    frame = Stretch.of(port).showing(slice(None))
    A = frame.E.value
    B = frame.controllability.value
    C = frame.observability.value[0]
    return StateSpace(A, B, C, frame.impulse_map())


def held_over_frame(
    drawn: MultirateLoop, inputs: Sequence[str], signals: tuple[str, ...]
) -> tuple[np.ndarray, ...]:
    """Return A, B, C and D of one loop from frame to frame, of the states that the signals depend
    on.

    inputs: from outside, each held over the whole frame. signals: as the first tick of a frame
    shows them.
    """
    ticks = Ticks.of(drawn, signals)
    columns = [ticks.maps[0].inputs.index(name) for name in inputs]
    n = len(ticks.states)
    first = ticks.maps[ticks.kind[0]]
    A = np.eye(n)
    B = np.zeros((n, len(columns)))
    for tick in (ticks.maps[kind] for kind in ticks.kind.tolist()):
        A = A + tick.E @ A
        B = B + tick.E @ B + tick.B[:, columns]
    index = reached((first.C != 0).any(0), A != 0)
    return A[np.ix_(index, index)], B[index], first.C[:, index], first.D[:, columns]
