"""The ports of loops: a map per kind of tick from forces to displacements, without the drift."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wavesweep.engine._drawing.conditions import OF_PLANT
from wavesweep.engine._loops.from_drawing import Ports
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.bounded import Bounded
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine._response.encoder import with_displacements
from wavesweep.engine._state_space import StateSpace
from wavesweep.engine.doubles import ENTRY_ROUNDING, GONE_SUM
from wavesweep.engine.errors import UsageError


class NoPositionError(UsageError):
    """The displacement at a port cannot be counted from tick to tick."""


@dataclass(frozen=True, slots=True, eq=False)
class Port:
    """The port of loops, a map per kind of tick. States that drift are left out, and the remaining
    ones are relative to them.

    Each map goes from the force to the displacement in the tick and the force against it. If the
    latter moves with a drift, the change of that share of it in the tick is a third output. E
    `(..., n, n)` less identity, B `(..., n, 1)`, C `(..., outputs, n)`, D `(..., outputs, 1)`.
    sizes: for each map, those of the terms of its entries' sums. kind: of each tick of the frame.
    period: of the tick, s. position: its row `(..., 1, n)`, None if it drifts. slowest: ticks
    between two runs of the slowest block. rate: ticks per second (Hz) as given; 1/period may differ
    in its last bit. rest: gives what a constant force does in the end, if the structure decides it
    (see `static`). of_signal: the first output is a signal itself and not a displacement; see
    `between`. Of several ports or axes the maps go from all forces to all displacements,
    position has a row for each also if all drift, and drifts is the number of ways in which they do
    so; moves: by how much each shift moves the position. pivot: see `Ticks.facts`.
    """

    maps: tuple[StateSpace, ...]
    sizes: tuple[StateSpace, ...]
    kind: np.ndarray
    period: float
    position: np.ndarray | None
    slowest: int
    rate: float
    rest: Callable[[], Any] | None = None
    of_signal: bool = False
    drifts: int = 0
    moves: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    pivot: object = 1.0

    @staticmethod
    def of(drawn: MultirateLoop, ports: Ports, drift: MarginalModes) -> Port:
        """Return the port of the loops at the hand.

        The displacement of a tick is the difference of two positions, so the position has to be a
        state alone: that of a plant. Errors: NoPositionError if it is not.
        """
        drawn, drift = with_displacements(drawn, drift)
        ticks = Ticks.of(drawn, ports.signals, terms=True)
        places = len(ports.forces)
        reads = ticks.maps[0].C[..., :places, :]
        for row, signal in enumerate(ports.signals[:places]):
            read = reads[..., row, :]
            if any(
                np.any(t.D[..., row, :]) or np.any(t.C[..., row, :] != read) for t in ticks.maps
            ):
                raise NoPositionError(f"[ports]: expected {OF_PLANT}, found {signal}")
        shifts = _Shifts.of(ticks, drift, reads)

        def outputs(tick: StateSpace, absolute: bool) -> list[tuple[np.ndarray, np.ndarray]]:
            read = np.abs(reads) if absolute else reads
            with np.errstate(invalid="ignore"):  # a frame that overflows is lost, see `Lifted`
                displacement = read @ tick.E, read @ tick.B
            if not ports.reaction:
                return [displacement]
            return [displacement, (tick.C[..., 1:2, :], tick.D[..., 1:2, :])]

        columns = [drawn.inputs.index(name) for name in ports.forces]
        reaction = ticks.maps[0].C[..., 1:2, :] if ports.reaction else None
        maps, sizes = _relative_maps(ticks, columns, shifts, reaction, outputs)
        moving = shifts.move(reads)
        position = None if moving and not ports.others else reads[..., shifts.remaining]
        moves = shifts.share_of(reads)
        drifts = int(np.linalg.matrix_rank(moves, rtol=GONE_SUM).max()) if moving else 0
        return Port(
            maps,
            sizes,
            ticks.kind,
            position=position,
            **_timing(drawn),
            drifts=drifts,
            moves=moves,
            pivot=ticks.facts[0],
        )

    @staticmethod
    def between(drawn: MultirateLoop, source: str, signal: str, drift: MarginalModes) -> Port:
        """Return the port between an external input and any signal.

        The first output is the signal in each tick. If it moves with a drift, that share of it is
        left out there, and the change of the share in the tick is a second output. drift: with the
        signal watched.
        """
        drawn, drift = with_displacements(drawn, drift)
        ticks = Ticks.of(drawn, (signal,), terms=True)
        return Port.through(ticks, drawn, source, drift)

    @staticmethod
    def through(ticks: Ticks, drawn: MultirateLoop, source: str, drift: MarginalModes) -> Port:
        """Return the port between an external input of a drawing and the output of its ticks, see
        `between`."""
        column = drawn.inputs.index(source)
        reads = ticks.maps[0].C
        shifts = _Shifts.of(ticks, drift, reads)
        maps, sizes = _relative_maps(
            ticks, slice(column, column + 1), shifts, reads, lambda tick, _: [(tick.C, tick.D)]
        )
        position = np.zeros((1, len(shifts.remaining)))
        return Port(maps, sizes, ticks.kind, position=position, **_timing(drawn), of_signal=True)

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the leading axes."""
        return np.broadcast_shapes(*(matrix.shape[:-2] for tick in self.maps for matrix in tick))

    @property
    def axes(self) -> int:
        """Number of forces."""
        return self.maps[0][1].shape[-1]

    @property
    def held(self) -> np.ndarray:
        """The directions in which no shift moves the position, `(axes, directions)`, orthogonal
        columns.

        Errors: UsageError if they are not the same in all loops.
        """
        if not self.drifts:
            return np.eye(self.axes)
        first = self.moves.reshape(-1, *self.moves.shape[-2:])[0]
        if np.abs(self.moves - first).max() > GONE_SUM * np.abs(first).max():
            raise UsageError(
                "expected a hand that is held in the same directions for all values of the number"
            )
        return np.linalg.svd(first)[0][:, self.drifts :]

    @property
    def outputs(self) -> int:
        """Number of outputs of the maps."""
        return self.maps[0][2].shape[-2]

    def some(self, index: np.ndarray) -> Port:
        """Return the port of some loops of a batch of one axis; index: `(loops,)`, of integers
        or truth values."""

        def chosen(matrix: Any) -> Any:
            if matrix is None or matrix.ndim < 3:
                return matrix
            return np.broadcast_to(matrix, (*self.batch, *matrix.shape[-2:]))[index]

        maps = tuple(StateSpace(*map(chosen, tick)) for tick in self.maps)
        sizes = tuple(StateSpace(*map(chosen, tick)) for tick in self.sizes)
        return replace(
            self, maps=maps, sizes=sizes, position=chosen(self.position), moves=chosen(self.moves)
        )

    def observable(self) -> Port:
        """Return the port without the states that no output depends on."""
        n = self.maps[0].E.shape[-1]
        reads = np.zeros((n, n), bool)
        shown = np.zeros(n, bool)
        for E, _, C, _ in self.maps:
            reads |= (E != 0).any(tuple(range(E.ndim - 2)))
            shown |= (C != 0).any(tuple(range(C.ndim - 1)))
        states = reached(shown, reads)
        maps = tuple(_among(states, tick) for tick in self.maps)
        sizes = tuple(_among(states, tick) for tick in self.sizes)
        position = None if self.position is None else self.position[..., states]
        return replace(self, maps=maps, sizes=sizes, position=position)


def _among(states: np.ndarray, tick: StateSpace) -> StateSpace:
    """The map of a tick among some of its states."""
    E, B, C, D = tick
    return StateSpace(E[..., states[:, None], states], B[..., states, :], C[..., states], D)


def _relative_maps(
    ticks: Ticks,
    columns: list[int] | slice,
    shifts: _Shifts,
    drifting: np.ndarray | None,
    outputs: Callable[..., Any],
) -> tuple[tuple[StateSpace, ...], tuple[StateSpace, ...]]:
    """Return the map of each kind of tick with states relative to the leads, and the sizes of its
    terms.

    columns: of the inputs. drifting: rows of a signal whose share that drifts becomes a further
    output, or None. outputs(tick, absolute): pairs of rows of C and D of the other outputs, of a
    tick or of the sizes of its terms.
    """
    share = None
    if drifting is not None and shifts.move(drifting):
        share = shifts.share_of(drifting)
        size = np.abs(share) + np.abs(drifting) @ shifts.dN / ENTRY_ROUNDING
    maps = []
    sizes = []
    for tick in ticks.maps:
        E = tick.E
        B = tick.B
        C = tick.C
        D = tick.D
        of_E, of_B, of_C, of_D = tick.terms
        exact = StateSpace(E, B[..., columns], C, D[..., columns])
        terms = StateSpace(of_E, of_B[..., columns], of_C, of_D[..., columns])
        rows = outputs(exact, False)
        of_rows = outputs(terms, True)
        if share is not None:
            leads = shifts.leads
            rows.append((share @ E[..., leads, :], share @ exact.B[..., leads, :]))
            of_rows.append((size @ of_E[..., leads, :], size @ terms.B[..., leads, :]))
        maps.append(shifts.relative(exact[:2], rows))
        sizes.append(shifts.relative(terms[:2], of_rows, exact[:2]))
    return tuple(maps), tuple(sizes)


def _timing(drawn: MultirateLoop) -> dict[str, Any]:
    period = float(
        np.ravel(drawn.period)[0].real
    )  # proofs along a rate take complex ones, and do not read it
    rate = 1 / period if drawn.rate is None else float(np.ravel(drawn.rate)[0].real)
    return {"period": period, "slowest": max(placed.every for placed in drawn.placed), "rate": rate}


@dataclass(frozen=True, slots=True, eq=False)
class _Shifts:
    """What drifts in loops: states `leads`, each of which moves others by factors, so that no tick
    changes anything.

    remaining: the other states. N `(..., n, leads)`: the factors, 0 in the rows of all leads; dN:
    bounds on their errors.
    """

    leads: list[int]
    remaining: list[int]
    N: np.ndarray
    dN: np.ndarray

    @staticmethod
    def of(ticks: Ticks, drift: MarginalModes, reads: np.ndarray) -> _Shifts:
        modes = [*drift.constant]
        if not drift.varying:
            modes += [(state, ()) for state in drift.unobserved]
        n = len(drift.states)
        factors = np.zeros((n, len(modes)))
        for column, (_, followers) in enumerate(modes):
            for state, factor in followers:
                factors[state, column] = factor
        leads = [lead for lead, _ in modes]
        varying = list(drift.varying)
        if varying:
            others = [state for state in range(n) if state not in leads]
            varying = _best_leads(ticks, reads, varying, others)
        leads += varying
        remaining = [state for state in range(n) if state not in leads]
        if not varying:
            return _Shifts(leads, remaining, factors, 0 * factors)
        V, dV = _fixed(ticks, remaining, varying)
        N = np.zeros((*V.shape[:-2], n, len(leads)), V.dtype)  # complex beside complex numbers
        dN = np.zeros(N.shape)
        N[..., : len(modes)] = factors
        N[..., remaining, len(modes) :] = V
        dN[..., remaining, len(modes) :] = dV
        return _Shifts(leads, remaining, N, dN)

    def share_of(self, reads: np.ndarray) -> np.ndarray:
        """Return by how much each shift moves a signal, `(..., 1, leads)`."""
        return reads[..., self.leads] + reads @ self.N

    def move(self, reads: np.ndarray) -> bool:
        """Return whether a shift moves a signal at all."""
        size = np.abs(reads[..., self.leads]) + np.abs(reads) @ np.abs(self.N)
        rounding = GONE_SUM * size + np.abs(reads) @ self.dN
        return bool((np.abs(self.share_of(reads)) > rounding).any())

    def relative(
        self,
        steps: tuple[np.ndarray, np.ndarray],
        rows: list[tuple[np.ndarray, np.ndarray]],
        of: tuple[np.ndarray, ...] = (),
    ) -> StateSpace:
        """Return the map of a tick with the states relative to the leads.

        steps: E and B. rows: pairs of rows of C and D. of: E and B, if steps and rows are the sizes
        of their terms.
        """
        E, B = steps
        if self.leads:
            sign, N = (1, np.abs(self.N)) if of else (-1, self.N)
            E = E + sign * (N @ E[..., self.leads, :])
            B = B + sign * (N @ B[..., self.leads, :])
        if self.leads and of:  # errors of the factors, as sizes of terms
            vague = self.dN / ENTRY_ROUNDING
            E = E + vague @ np.abs(of[0][..., self.leads, :])
            B = B + vague @ np.abs(of[1][..., self.leads, :])
        C, D = zip(*rows, strict=True)
        C = np.concatenate(np.broadcast_arrays(*C), axis=-2)
        D = np.concatenate(np.broadcast_arrays(*D), axis=-2)
        index = self.remaining
        return StateSpace(E[..., index, :][..., index], B[..., index, :], C[..., index], D)


def _best_leads(ticks: Ticks, reads: np.ndarray, leads: list[int], states: list[int]) -> list[int]:
    """Return leads of the same shifts: a state that the position reads, if there is one, or one
    whose own changes are small.

    Errors of the factors count as much as the lead changes in a tick. Beside the position,
    differences of it are exact.
    """
    followers = [state for state in states if state not in leads]
    V, _ = _fixed(ticks, followers, leads)
    cost = sum(
        tick.terms[0].max(tuple(range(tick.terms[0].ndim - 2))).sum(-1) for tick in ticks.maps
    )
    weight = np.where(cost > 0, cost, 1.0)
    in_position = (reads != 0).any(tuple(range(reads.ndim - 1)))
    chosen: list[int] = []
    for column, lead in enumerate(leads):
        factors = np.zeros(len(cost))
        factors[lead] = 1.0
        factors[followers] = np.abs(V[..., column]).min(tuple(range(V.ndim - 2)))
        factors[chosen] = 0.0
        first = in_position & (factors > 0)
        merit = np.where(first, factors, 0.0) if first.any() else factors / weight
        chosen.append(int(np.argmax(merit)))
    return chosen


def _fixed(ticks: Ticks, followers: list[int], leads: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the factors V `(..., followers, leads)` of shifts that depend on a loop's numbers, and
    bounds on their errors.

    They are the least-squares solution of `E_followers V = -E_leads`, the equations of all ticks
    together, which do not contradict each other; a factor that is nothing but rounding is 0.
    """
    E = _one_above_the_other([tick.E for tick in ticks.maps])
    sizes = _one_above_the_other([tick.terms[0] for tick in ticks.maps])
    largest = np.abs(E).max(-1, keepdims=True, initial=0)
    finite = np.isfinite(largest) & (largest > 0)
    weight = np.where(finite, 1 / np.where(largest > 0, largest, 1), 0.0)
    E = np.where(np.isfinite(E), E, 0.0) * weight
    sizes = np.where(np.isfinite(sizes), sizes, 0.0) * weight
    A = E[..., followers]
    b = -E[..., leads]
    column = np.abs(A).max(-2, keepdims=True, initial=0)
    column = 1 / np.where(column > 0, column, 1)
    inverse = column.mT * np.linalg.pinv(A * column)
    V = inverse @ b
    for _ in range(2):
        V = V + inverse @ (b - A @ V)
    bounded = Bounded(A, ENTRY_ROUNDING * sizes[..., followers])
    missed = Bounded(b, ENTRY_ROUNDING * sizes[..., leads]) - bounded @ V
    dV = np.abs(inverse) @ missed.size
    return np.where(np.abs(V) <= dV, 0.0, V), dV


def _one_above_the_other(matrices: Sequence[np.ndarray]) -> np.ndarray:
    batch = np.broadcast_shapes(*(matrix.shape[:-2] for matrix in matrices))
    return np.concatenate(
        [np.broadcast_to(matrix, (*batch, *matrix.shape[-2:])) for matrix in matrices], axis=-2
    )


def reached(start: np.ndarray, reads: np.ndarray) -> np.ndarray:
    """Return the indices of the states `start`, a mask `(n,)`, and those that they depend on;
    reads: on which, `(n, n)`."""
    while not np.array_equal(start | reads[start].any(0), start):
        start = start | reads[start].any(0)
    return np.flatnonzero(start)
