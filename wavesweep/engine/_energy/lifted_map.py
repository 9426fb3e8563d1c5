"""Maps of a frame of ticks from one signal to another: their Hermitian parts at each frequency,
and the pencils of levels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from wavesweep.engine._energy.hinf import NORM_TOLERANCE, SOFT, Element, Peak, hinf_norm
from wavesweep.engine._monodromy.batches import NUMBERS_AT_ONCE, nonzero
from wavesweep.engine._monodromy.periodic import Change, in_a_row, known_frames
from wavesweep.engine._monodromy.rounding import balance, measured_frame
from wavesweep.engine._monodromy.unit_circle import on_circle, solve
from wavesweep.engine._state_space import StateSpace


@dataclass(frozen=True, slots=True, eq=False)
class TickMaps:
    """Every kind of tick of some loops, from inputs u to outputs y.

    maps: per kind E `(loops, n, n)` less identity, B `(loops, n, m)`, C `(loops, p, n)` and D
    `(loops, p, m)`; m and p may differ from kind to kind. kind: of each tick of the frame, `(M,)`.
    """

    maps: tuple[tuple[np.ndarray, ...], ...]
    kind: np.ndarray

    @staticmethod
    def of(
        maps: Sequence[Sequence[np.ndarray]], kind: np.ndarray, batch: tuple[int, ...]
    ) -> "TickMaps":
        """Return the ticks with their batch, broadcast to `batch`, in one axis."""
        flat = []
        for matrices in maps:
            flat.append(StateSpace(*(_flat(matrix, batch) for matrix in matrices)))
        return TickMaps(tuple(flat), kind)

    @property
    def loops(self) -> int:
        """Number of loops."""
        return len(self.maps[0][0])

    def at(self, loops: np.ndarray | slice | list[int]) -> "TickMaps":
        """Return some of the loops."""
        maps = []
        for matrices in self.maps:
            maps.append(StateSpace(*(matrix[loops] for matrix in matrices)))
        return TickMaps(tuple(maps), self.kind)

    def in_even_units(self) -> "TickMaps":
        """Return the ticks with states in units that give their entries similar sizes.

        States of a transfer function differ in size like powers of its poles, and so would errors
        of the eigenvalues of a level's pencil.
        """
        n = self.maps[0][0].shape[-1]
        sizes = np.zeros((self.loops, n + 1, n + 1))
        for E, B, C, _ in self.maps:
            sizes[:, :n, :n] += np.abs(E)
            sizes[:, :n, n] += np.abs(B).sum(-1)
            sizes[:, n, :n] += np.abs(C).sum(-2)
        units = balance(np.where(np.isfinite(sizes), sizes, 0.0), thorough=True)[1]
        u = (units[:, :n] / units[:, n:])[:, None, :]
        maps = []
        for E, B, C, D in self.maps:
            maps.append(StateSpace(E * (u / u.mT), B / u.mT, C * u, D))
        return TickMaps(tuple(maps), self.kind)

    def pencil(self, owner: np.ndarray, level: np.ndarray) -> Element:
        """Return the frame of the loops `owner` with the balance `2 u y - 2 level |u|^2`; see
        `hinf`."""

        def costs(C: np.ndarray, D: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
            return 0.0, C.mT, D + D.mT - 2 * level[:, None, None] * np.eye(D.shape[-1])

        return self._frame(owner, costs)

    def loss_pencil(self, owner: np.ndarray | list[int], square: np.ndarray) -> Element:
        """Return the frame of the loops `owner` with the balance `square |u|^2 - |y|^2`; see
        `hinf`."""

        def costs(C: np.ndarray, D: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            of_inputs = square[:, None, None] * np.eye(D.shape[-1]) - D.mT @ D
            return -C.mT @ C, -C.mT @ D, of_inputs

        return self._frame(owner, costs)

    def _frame(self, owner: np.ndarray | list[int], costs: Callable[..., Any]) -> Element:
        with np.errstate(all="ignore"):
            elements = []
            for E, B, C, D in self.at(owner).maps:
                elements.append(Element.of(np.eye(E.shape[-1]) + E, B, *costs(C, D)))
            return in_a_row(self.kind.tolist(), elements, Element.then)

    def frame(self, *, measured: bool = True) -> np.ndarray:
        """Return the frame less identity, `(loops, n, n)`; if measured, NaN where rounding
        leaves nothing of it."""
        changes = [E for E, *_ in self.maps]
        if measured:
            E, growth = measured_frame(self.kind, changes)
            return known_frames(E, growth)
        with np.errstate(all="ignore"):
            return in_a_row(self.kind.tolist(), [*map(Change.of, changes)], Change.then).E

    def lifted(self, *, measured: bool = True) -> "LiftedMap":
        """Return the map from the inputs of a frame to its outputs; measured: see `frame`."""
        n = self.maps[0][0].shape[-1]
        loops = self.loops
        ticks = [self.maps[kind] for kind in self.kind.tolist()]
        height = sum(D.shape[-2] for *_, D in ticks)
        width = sum(D.shape[-1] for *_, D in ticks)
        number = np.result_type(*(matrix for matrices in self.maps for matrix in matrices))
        O = np.zeros((loops, height, n), number)
        T = np.zeros((loops, height, width), number)
        drive = np.zeros((loops, n, width), number)
        state = np.broadcast_to(np.eye(n), (loops, n, n))
        row = 0
        column = 0
        with np.errstate(all="ignore"):
            for E, B, C, D in ticks:
                rows = slice(row, row + C.shape[-2])
                new = slice(column, column + B.shape[-1])
                O[:, rows] = C @ state
                T[:, rows, :column] = C @ drive[..., :column]
                T[:, rows, new] = D
                state = state + E @ state
                drive[..., :column] += E @ drive[..., :column]
                drive[..., new] = B
                row = rows.stop
                column = new.stop
        return LiftedMap(self.frame(measured=measured), T, O, drive)


def _flat(matrix: np.ndarray, batch: tuple[int, ...]) -> np.ndarray:
    tail = matrix.shape[-2:]
    return np.broadcast_to(matrix, (*batch, *tail)).reshape(prod(batch), *tail)


def read(maps: Sequence[Sequence[np.ndarray]]) -> np.ndarray:
    """Whether the outputs of some tick depend on each state, at once or later, `(n,)`; maps: see
    `TickMaps`."""
    at_once = np.logical_or.reduce([nonzero(C).any(0) for _, _, C, _ in maps])
    return closure([E for E, *_ in maps], at_once)


def connected(maps: Sequence[Sequence[np.ndarray]]) -> np.ndarray:
    """Whether inputs of some tick reach each state, and outputs read it, at once or later,
    `(n,)`."""
    at_once = np.logical_or.reduce([nonzero(B).any(-1) for _, B, *_ in maps])
    return read(maps) & closure([E.mT for E, *_ in maps], at_once)


def closure(changes: Sequence[np.ndarray], states: np.ndarray) -> np.ndarray:
    """The states, a mask, and those that these read by the changes of some tick, `(n,)`."""
    reads = np.logical_or.reduce([nonzero(E) for E in changes])
    while (reached_states := states | reads[states].any(0)).sum() > states.sum():
        states = reached_states
    return states


@dataclass(frozen=True, slots=True, eq=False)
class LiftedMap:
    """`T + O (w - E)^-1 G` at `w = z - 1` of the frame, for each of some loops.

    E `(loops, n, n)` less identity, T `(loops, p, m)`, O `(loops, p, n)`, G `(loops, n, m)`.
    """

    E: np.ndarray
    T: np.ndarray
    O: np.ndarray
    G: np.ndarray

    def at(self, loops: np.ndarray | slice) -> "LiftedMap":
        """Return some of the loops."""
        return LiftedMap(self.E[loops], self.T[loops], self.O[loops], self.G[loops])

    @property
    def mean(self) -> np.ndarray:
        """Mean eigenvalue of the Hermitian part over all frequencies, `(loops,)`: that of the
        direct terms."""
        return np.diagonal(self.T, axis1=-2, axis2=-1).mean(-1)

    def smallest(self, owner: np.ndarray, theta: np.ndarray, noise: float = 0.0) -> np.ndarray:
        """Return the smallest eigenvalue of the Hermitian part, of the loops `owner` at the angles
        `theta` (rad per frame).

        noise: share of the largest one that is added. NaN where the map is not finite. Accuracy:
        rounding of the largest entry.
        """

        def eigenvalue(H: np.ndarray) -> np.ndarray:
            eigenvalues = np.linalg.eigvalsh((H + H.conj().mT) / 2)
            if not noise:
                return eigenvalues[:, 0]
            return eigenvalues[:, 0] + noise * np.abs(eigenvalues).max(-1)

        return self._measured(owner, theta, eigenvalue)

    def largest_square(self, owner: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return the square of the largest singular value, in the same way."""

        def square(H: np.ndarray) -> np.ndarray:
            H = H if H.shape[-2] <= H.shape[-1] else H.conj().mT
            if H.shape[-2] <= 1:
                return (np.abs(H) ** 2).sum((-1, -2))
            return np.linalg.eigvalsh(H @ H.conj().mT)[:, -1]

        return self._measured(owner, theta, square)

    def response(self, owner: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return the map of the loops `owner` at the angles `theta`, `(points, p, m)`."""
        with np.errstate(all="ignore"):
            A = on_circle(theta)[:, None, None] * np.eye(self.E.shape[-1]) - self.E[owner]
            # Of two complex arrays, since numpy takes 15 times as long for a real one beside it.
            return self.T[owner] + (self.O[owner] + 0j) @ solve(A, self.G[owner] + 0j)

    def _measured(
        self, owner: np.ndarray, theta: np.ndarray, measure: Callable[..., Any]
    ) -> np.ndarray:
        owner, theta = np.broadcast_arrays(np.asarray(owner), np.asarray(theta, float))
        measures = np.full(owner.size, np.nan)
        step = max(1, NUMBERS_AT_ONCE // max(1, self.T[0].size))
        for first in range(0, owner.size, step):
            index = slice(first, first + step)
            H = self.response(owner[index], theta[index])
            good = np.isfinite(H).all((-1, -2))
            measures[index][good] = measure(H[good])
        return measures


def damping_peak(ticks: TickMaps, lifted: LiftedMap, period: np.ndarray, least: np.ndarray) -> Peak:
    """Return the damping that loops need, from their ticks and their maps of a frame from
    displacements to forces.

    period: of a tick, s; least: angle from which on frequencies are examined, rad per frame;
    `(loops,)` each.
    """

    def needed(owner: np.ndarray, theta: np.ndarray, _: np.ndarray) -> np.ndarray:
        smallest = lifted.smallest(owner, np.maximum(theta, least[owner]))
        return np.nan_to_num(-period[owner] * smallest, nan=-np.inf)

    def angles_at(owner: np.ndarray, level: np.ndarray) -> np.ndarray:
        return ticks.pencil(owner, -level / period[owner]).angles()

    def slack(_: np.ndarray, level: np.ndarray) -> np.ndarray:
        return NORM_TOLERANCE * (1 + np.abs(level))

    return hinf_norm(needed, angles_at, ticks.loops, slack, SOFT)
