"""Loops over a frame: what each tick shows of the state at the frame's start, and what its force
leaves, with errors."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.bounded import Bounded
from wavesweep.engine._monodromy.periodic import Ticks, in_a_row, then
from wavesweep.engine._monodromy.rounding import both
from wavesweep.engine._monodromy.unit_circle import solve
from wavesweep.engine._response.bordered import Bordered
from wavesweep.engine._response.bounded_sums import long_sum
from wavesweep.engine._response.circle import Circle, circle_of
from wavesweep.engine._response.modal import Modal
from wavesweep.engine._response.port import Port, reached
from wavesweep.engine._state_space import StateSpace
from wavesweep.engine.doubles import ENTRY_ROUNDING, SHORT_SUM_ROUNDING

LEAF = 64  # ticks up to which the outputs for forces of the same stretch are kept as a matrix
NEXT_TO_OVERFLOW = 1e100  # entries whose squares are next to overflow


@dataclass(frozen=True, eq=False)
class Stretch:
    """Some ticks in a row; all arrays come as pairs with bounds on the errors of their entries.

    E `(..., n, n)`: the change of the state. observability `(..., p, ticks, n)`: the outputs in
    each tick for the state before the first. controllability `(..., n, ticks)`: what the force of
    each tick adds to the state after the last. For forces of the same stretch: forced `(..., p,
    ticks)` has the sums of outputs over equal numbers of ticks since a force, and impulse `(...,
    ticks, ticks)` the last output in each tick. A stretch of more than LEAF ticks has two halves,
    `first` and `second`, in place of these. state_index, rows: which of their states and outputs it
    has, if not all.
    """

    E: tuple
    observability: tuple
    controllability: tuple
    forced: tuple | None
    impulse: tuple | None
    first: "Stretch | None" = None
    second: "Stretch | None" = None
    state_index: np.ndarray | slice | None = None
    rows: slice = field(default_factory=lambda: slice(None))

    @staticmethod
    def of(port: Port) -> "Stretch":
        """Return the port's frame; repeated stretches are joined once."""
        ticks = []
        for tick, terms in zip(port.maps, port.sizes, strict=True):
            pairs = []
            for matrix, size in zip(tick, terms, strict=True):
                pairs.append(np.broadcast_arrays(matrix, ENTRY_ROUNDING * size))
            E, B, C, D = pairs
            observability = [rows[..., None, :] for rows in C]
            last = [rows[..., -1:, :] for rows in D]
            ticks.append(Stretch(E, observability, B, D, last))
        return in_a_row(port.kind.tolist(), ticks, _joined)

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return self.controllability[0].shape[-1]

    def showing(self, rows: slice) -> "Stretch":
        """Return the frame with some outputs, and the states that these need to know of it."""
        change = self.E[0]
        n = change.shape[-1]
        observability = [outputs[..., rows, :, :] for outputs in self.observability]
        reads = (change + np.eye(n) != 0).any(tuple(range(change.ndim - 2)))
        shown = (observability[0] != 0).any(tuple(range(observability[0].ndim - 1)))
        index = reached(shown, reads)
        return replace(
            self,
            E=[change[..., index[:, None], index] for change in self.E],
            observability=[outputs[..., index] for outputs in observability],
            controllability=[states[..., index, :] for states in self.controllability],
            forced=self.forced and [outputs[..., rows, :] for outputs in self.forced],
            state_index=index,
            rows=rows,
        )

    @cached_property
    def sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """Sums over the ticks of the sizes of `observability`, `(..., p, n)`, and of
        `controllability`, `(..., n, 1)`."""
        return np.abs(self.observability[0]).sum(-2), np.abs(self.controllability[0]).sum(
            -1, keepdims=True
        )

    @cached_property
    def forced_size(self) -> np.ndarray:
        """Sum of the sizes of the terms of the outputs for forces of the same stretch, `(...,
        p)`."""
        if self.forced:
            return np.abs(self.forced[0]).sum(-1)
        across = (self.second.sizes[0] @ self.first.sizes[1])[..., 0]
        return (self.first.forced_size + self.second.forced_size + across)[..., self.rows]

    def impulse_map(self, index: int = 0) -> np.ndarray:
        """Return the map from all forces to the last output in each tick, for the state 0;
        index: 1 for its errors."""
        if self.impulse:
            return self.impulse[index]
        return _triangular(
            self.first.impulse_map(index), self.across[index], self.second.impulse_map(index)
        )

    @property
    def across(self) -> tuple:
        """The map from forces of the first half to the last output in the second, a pair."""
        last = Bounded(*(outputs[..., -1, :, :] for outputs in self.second.observability))
        return last @ Bounded(*self.first.controllability)


def _joined(first, second):
    """Return one stretch after the other."""
    eye = np.eye(first.E[0].shape[-1])
    before = eye + first.E[0], first.E[1]
    after = Bounded(eye + second.E[0], second.E[1])
    E = then(first.E[0], second.E[0]), both(first.E, second.E)[1]
    outputs = Bounded(*second.observability)
    inputs = Bounded(*first.controllability)
    carried = outputs @ Bounded(*(states[..., None, :, :] for states in before))
    observability = Bounded.joined((first.observability, carried), -2)
    controllability = Bounded.joined((after @ inputs, second.controllability), -1)
    if first.ticks + second.ticks > LEAF:
        return Stretch(E, observability, controllability, None, None, first, second)
    later = outputs @ Bounded(*(states[..., None, :, :] for states in inputs))
    of_first = Bounded(*_padded(first.forced, second.ticks))
    of_second = Bounded(*_padded(second.forced, first.ticks))
    forced = of_first + of_second + Bounded(*_over_lags(later))
    impulse = []
    for before_it, across, after_it in zip(first.impulse, later, second.impulse, strict=True):
        impulse.append(_triangular(before_it, across[..., -1, :, :], after_it))
    return Stretch(E, observability, controllability, forced, impulse)


def _triangular(first, across, second):
    """Return the map of two stretches from those of both, and from the first to the second."""
    batch = np.broadcast_shapes(*(block.shape[:-2] for block in (first, across, second)))
    rows = first.shape[-1]
    joint = np.zeros((*batch, rows + second.shape[-1], rows + second.shape[-1]))
    joint[..., :rows, :rows] = first
    joint[..., rows:, :rows] = across
    joint[..., rows:, rows:] = second
    return joint


def _padded(pair, count):
    return tuple(
        np.concatenate([sums, np.zeros((*sums.shape[:-1], count))], axis=-1) for sums in pair
    )


def _over_lags(later):
    """Return sums over equal numbers of ticks between a force in the first stretch, and an output
    in the second.

    later: a pair of `(..., second, first)`. Their ticks together are the length of the result.
    """
    pair = []
    for impulse in (later[0], later[1] + SHORT_SUM_ROUNDING * np.abs(later[0])):
        batch = impulse.shape[:-2]
        second, first = impulse.shape[-2:]
        wide = np.zeros(
            (*batch, second, first + second)
        )  # each row, put into shorter ones, is shifted by one more
        wide[..., :first] = impulse[..., ::-1]
        wide = wide.reshape(*batch, -1)[..., : second * (first + second - 1)]
        sums = wide.reshape(*batch, second, first + second - 1).sum(-2)
        pair.append(np.concatenate([np.zeros((*sums.shape[:-1], 1)), sums], axis=-1))
    return tuple(pair)


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
    def of(stretch: Stretch, points, memo: dict | None = None) -> "Sums":
        """Return the sums at these points of the circle (see `Circle`); memo: those of its
        halves, by identity."""
        memo = {} if memo is None else memo
        if id(stretch) not in memo:
            memo[id(stretch)] = (
                _of_leaf(stretch, points) if stretch.forced else _of_halves(stretch, points, memo)
            )
        return memo[id(stretch)]


def _of_leaf(stretch, points):
    z = points.ladder(stretch.ticks)
    rough = long_sum(stretch.ticks)
    # contiguous, as BLAS wants them
    real = z.real.copy()
    imag = z.imag.copy()
    O, dO = stretch.observability
    forced, dforced = stretch.forced
    G, dG = stretch.controllability
    size, most = stretch.sizes
    return Sums(
        rows=real.T @ O - 1j * (imag.T @ O),
        drows=dO.sum(-2) + rough * size,
        forced=forced @ real - 1j * (forced @ imag),
        dforced=(dforced + rough * np.abs(forced)).sum(-1, keepdims=True),
        driven=G @ real + 1j * (G @ imag),
        ddriven=dG.sum(-1, keepdims=True) + rough * most,
    )


def _of_halves(stretch, points, memo):
    first = stretch.first
    second = stretch.second
    a = Sums.of(first, points, memo)
    b = Sums.of(second, points, memo)
    eye = np.eye(first.E[0].shape[-1])
    before = eye + first.E[0]
    after = eye + second.E[0]
    dbefore = first.E[1] + SHORT_SUM_ROUNDING * np.abs(before)
    dafter = second.E[1] + SHORT_SUM_ROUNDING * np.abs(after)
    size = second.sizes[0]
    most = first.sizes[1]
    turn = points.turn(first.ticks)
    back = turn.conj()
    carried = (b.rows * a.driven.mT[..., None, :, :]).sum(-1)
    rows = a.rows + back[:, None] * (b.rows @ before[..., None, :, :])
    drows = a.drows + b.drows @ np.abs(before) + size @ dbefore
    forced = a.forced + b.forced + back * carried
    dforced = (
        a.dforced + b.dforced + b.drows @ most + size @ (a.ddriven + SHORT_SUM_ROUNDING * most)
    )
    driven = after @ a.driven + turn * b.driven
    ddriven = np.abs(after) @ a.ddriven + b.ddriven + dafter @ most
    states = slice(None) if stretch.state_index is None else stretch.state_index
    outputs = stretch.rows
    of_rows, of_driven = (SHORT_SUM_ROUNDING * sizes for sizes in stretch.sizes)
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
    def of(port: Port) -> "Lifted":
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
        return self.frame.E[0].shape[-1]

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
    def of_positions(self) -> "tuple[Stretch, np.ndarray]":
        """The frame with the position as its only output, and which loops have numbers there
        whose squares overflow."""
        frame = self.with_position.showing(slice(self.port.outputs, None))
        huge = ~_all(frame, lambda entries: np.abs(entries) < NEXT_TO_OVERFLOW) & ~self.lost
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


def _all(frame, test):
    """Of which loops all entries of a frame pass a test."""
    passed = [test(matrix).all((-1, -2)) for matrix in (*frame.E, *frame.controllability)]
    passed += [test(outputs).all((-1, -2, -3)) for outputs in frame.observability]
    return np.logical_and.reduce(np.broadcast_arrays(*passed))


def _without(port, lost):
    """Return the port with zeros in place of the loops that are lost."""
    lost = lost[..., None, None]

    def zeroed(tick):
        return StateSpace(*(np.where(lost, 0.0, matrix) for matrix in tick))

    return replace(port, maps=tuple(map(zeroed, port.maps)), sizes=tuple(map(zeroed, port.sizes)))


def _with_position(port):
    """Return the port with the position at the beginning of each tick as a further output, a
    state more if it drifts."""
    maps = tuple(_tick_with_position(tick, port.position) for tick in port.maps)
    row = None if port.position is None else np.abs(port.position)
    return replace(
        port, maps=maps, sizes=tuple(_tick_with_position(tick, row) for tick in port.sizes)
    )


def _tick_with_position(tick, position):
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

    def of_row(matrices):
        return tuple(StateSpace(E, B, C[row], D[row]) for E, B, C, D in matrices)

    kind = np.tile(port.kind, ticks // port.kind.size)
    port = replace(port, kind=kind, maps=of_row(port.maps), sizes=of_row(port.sizes))
    frame = Stretch.of(port).showing(slice(None))
    A = frame.E[0]
    B = frame.controllability[0]
    C = frame.observability[0][0]
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
