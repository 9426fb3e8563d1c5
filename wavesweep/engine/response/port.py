"""Loops seen from the hand's port: a map per kind of tick, without the drift."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.drawing.conditions import OF_PLANT
from wavesweep.engine.errors import UsageError
from wavesweep.engine.loops.multirate import MultirateLoop
from wavesweep.engine.loops.ports import Ports
from wavesweep.engine.monodromy.drift import TickDrift
from wavesweep.engine.monodromy.periodic import Ticks, ticks_of
from wavesweep.engine.monodromy.rounding import ENTRIES, ROUNDING
from wavesweep.engine.response.bounded_sums import long_sum
from wavesweep.engine.response.encoder import with_displacements

STILL = 1e-9  # of the terms of a shift: a movement below it is rounding


class NoPositionError(UsageError):
    """The displacement at a port cannot be counted from tick to tick."""


@dataclass(frozen=True, slots=True, eq=False)
class Port:
    """Loops seen from their port, a map per kind of tick; states that drift are left out, and the others counted from them.

    Each map goes from the force to the displacement in the tick and the force against it. If the latter moves with a drift,
    the change of that share of it in the tick is a third output. E `(..., n, n)` less identity, B `(..., n, 1)`, C `(...,
    outputs, n)`, D `(..., outputs, 1)`. sizes: for each map, those of the terms of its entries' sums. kind: of each tick of
    the frame. period: of the tick, s. position: its row `(..., 1, n)`, None if it drifts. slowest: ticks between two runs
    of the slowest block. rate: ticks per second (Hz) as given; 1/period may differ in its last bit. rest: gives what a
    constant force does in the end, if the structure decides it (see `static`). between: the first output is a signal itself
    and not a displacement; see `port_between`. Of several ports or axes the maps go from all forces to all displacements,
    position has a row for each also if all drift, and drifts is the number of ways in which they do so; moves: by how much
    each shift moves the position.
    """

    maps: tuple[tuple[np.ndarray, ...], ...]
    sizes: tuple[tuple[np.ndarray, ...], ...]
    kind: np.ndarray
    period: float
    position: np.ndarray | None
    slowest: int
    rate: float
    rest: object = None
    between: bool = False
    drifts: int = 0
    moves: np.ndarray | None = None

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the leading axes."""
        return np.broadcast_shapes(*(part.shape[:-2] for each in self.maps for part in each))

    @property
    def axes(self) -> int:
        """Number of forces."""
        return self.maps[0][1].shape[-1]

    @property
    def held(self) -> np.ndarray:
        """The directions in which no shift moves the position, `(axes, directions)`, orthogonal columns.

        Errors: UsageError if they are not the same in all loops.
        """
        if not self.drifts:
            return np.eye(self.axes)
        first = self.moves.reshape(-1, *self.moves.shape[-2:])[0]
        if np.abs(self.moves - first).max() > STILL * np.abs(first).max():
            raise UsageError("expected a hand that is held in the same directions for all values of the number")
        return np.linalg.svd(first)[0][:, self.drifts :]

    @property
    def outputs(self) -> int:
        """Number of outputs of the maps."""
        return self.maps[0][2].shape[-2]

    @property
    def rough(self) -> float:
        """Relative error of sums over a frame."""
        return long_sum(self.kind.size)

    def seen(self) -> "Port":
        """Return the port without the states that no output depends on."""
        alive = _alive(self.maps)
        maps, sizes = (tuple(_some(each, alive) for each in parts) for parts in (self.maps, self.sizes))
        return replace(self, maps=maps, sizes=sizes, position=None if self.position is None else self.position[..., alive])


def port_of(drawn: MultirateLoop, ports: Ports, drift: TickDrift) -> Port:
    """Return the loops as they are seen from their port.

    The displacement of a tick is the difference of two positions, so the position has to be a state alone: that of a plant.
    Errors: NoPositionError if it is not.
    """
    drawn, drift = with_displacements(drawn, drift)
    ticks = ticks_of(drawn, ports.signals, terms=True)
    places = len(ports.forces)
    reads = ticks.maps[0].C[..., :places, :]
    for at, position in enumerate(ports.signals[:places]):
        if any(np.any(each.D[..., at, :]) or np.any(each.C[..., at, :] != reads[..., at, :]) for each in ticks.maps):
            raise NoPositionError(f"[ports]: expected {OF_PLANT}, found {position}")
    shifts = _Shifts.of(ticks, drift, reads)
    answers = ticks.maps[0].C[..., 1:2, :] if ports.reaction else None
    share = shifts.seen(answers) if ports.reaction else None
    moves = ports.reaction and shifts.move(answers)
    force = [drawn.inputs.index(each) for each in ports.forces]
    maps, sizes = [], []
    for each in ticks.maps:
        for of_sizes, parts, found in ((False, (each.E, each.B, each.C, each.D), maps), (True, each.terms, sizes)):
            E, B, C, D = parts
            B, D = B[..., force], D[..., force]
            read = np.abs(reads) if of_sizes else reads
            with np.errstate(invalid="ignore"):  # a frame that overflows is lost, see `Lifted`
                first = read @ E, read @ B
            rows = [first] + ([(C[..., 1:2, :], D[..., 1:2, :])] if ports.reaction else [])
            if moves:
                along = np.abs(share) + np.abs(answers) @ shifts.dN / ENTRIES if of_sizes else share
                rows.append((along @ E[..., shifts.leads, :], along @ B[..., shifts.leads, :]))
            found.append(shifts.counted((E, B), rows, (each.E, each.B[..., force]) if of_sizes else ()))
    moving = shifts.move(reads)
    position = None if moving and not ports.others else reads[..., shifts.kept]
    seen = shifts.seen(reads)
    drifts = int(np.linalg.matrix_rank(seen, rtol=STILL).max()) if moving else 0
    return Port(tuple(maps), tuple(sizes), ticks.kind, *_timing(drawn, position), drifts=drifts, moves=seen)


def port_between(drawn: MultirateLoop, source: str, signal: str, drift: TickDrift) -> Port:
    """Return the loops as they are seen from an input from outside and a signal, which may be any.

    The first output is the signal in each tick. If it moves with a drift, that share of it is left out there, and the change of
    the share in the tick is a second output. drift: with the signal watched.
    """
    drawn, drift = with_displacements(drawn, drift)
    ticks, column = ticks_of(drawn, (signal,), terms=True), slice(drawn.inputs.index(source), drawn.inputs.index(source) + 1)
    answers = ticks.maps[0].C
    shifts = _Shifts.of(ticks, drift, answers)
    share, moves = shifts.seen(answers), shifts.move(answers)
    maps, sizes = [], []
    for each in ticks.maps:
        for of_sizes, (E, B, C, D), found in ((False, (each.E, each.B, each.C, each.D), maps), (True, each.terms, sizes)):
            rows = [(C, D[..., column])]
            if moves:
                along = np.abs(share) + np.abs(answers) @ shifts.dN / ENTRIES if of_sizes else share
                rows.append((along @ E[..., shifts.leads, :], along @ B[..., shifts.leads, column]))
            found.append(shifts.counted((E, B[..., column]), rows, (each.E, each.B[..., column]) if of_sizes else ()))
    nowhere = np.zeros((1, len(shifts.kept)))
    return Port(tuple(maps), tuple(sizes), ticks.kind, *_timing(drawn, nowhere), between=True)


def _timing(drawn, position):
    period = float(np.ravel(drawn.period)[0].real)  # proofs along a rate take complex ones, and do not read it
    rate = 1 / period if drawn.rate is None else float(np.ravel(drawn.rate)[0].real)
    return period, position, max(each.every for each in drawn.placed), rate


@dataclass(frozen=True, slots=True, eq=False)
class _Shifts:
    """What drifts in loops: states `leads`, each of which moves others by factors, so that no tick changes anything.

    N `(..., n, leads)`: the factors, 0 in the rows of all leads; dN: bounds on their errors.
    """

    leads: list[int]
    kept: list[int]
    N: np.ndarray
    dN: np.ndarray

    @staticmethod
    def of(ticks: Ticks, drift: TickDrift, reads) -> "_Shifts":
        moved = [*drift.moved, *(() if drift.folded else ((state, ()) for state in drift.unread))]
        constant = np.zeros((len(drift.states), len(moved)))
        for column, (_, others) in enumerate(moved):
            for state, factor in others:
                constant[state, column] = factor
        leads, folded = [lead for lead, _ in moved], list(drift.folded)
        if folded:
            folded = _best_leads(ticks, reads, folded, [state for state in range(len(drift.states)) if state not in leads])
        leads += folded
        kept = [state for state in range(len(drift.states)) if state not in leads]
        if not folded:
            return _Shifts(leads, kept, constant, 0 * constant)
        V, dV = _fixed(ticks, kept, folded)
        N, dN = np.zeros((2, *V.shape[:-2], len(drift.states), len(leads)))
        N[..., : len(moved)] = constant
        N[..., kept, len(moved) :], dN[..., kept, len(moved) :] = V, dV
        return _Shifts(leads, kept, N, dN)

    def seen(self, reads):
        """Return by how much each shift moves a signal, `(..., 1, leads)`."""
        return reads[..., self.leads] + reads @ self.N

    def move(self, reads) -> bool:
        """Return whether a shift moves a signal at all."""
        size = np.abs(reads[..., self.leads]) + np.abs(reads) @ np.abs(self.N)
        return bool((np.abs(self.seen(reads)) > STILL * size + np.abs(reads) @ self.dN).any())

    def counted(self, steps, rows, of=()):
        """Return the map of a tick with the states counted from the leads.

        steps: E and B. rows: pairs of rows of C and D. of: E and B, if the others are the sizes of their terms.
        """
        if self.leads:
            sign, N = (1, np.abs(self.N)) if of else (-1, self.N)
            vague = [self.dN / ENTRIES @ np.abs(part[..., self.leads, :]) for part in of] or (0.0, 0.0)  # as that of terms
            steps = [part + sign * (N @ part[..., self.leads, :]) + more for part, more in zip(steps, vague, strict=True)]
        C, D = (np.concatenate(np.broadcast_arrays(*part), axis=-2) for part in zip(*rows, strict=True))
        return steps[0][..., self.kept, :][..., self.kept], steps[1][..., self.kept, :], C[..., self.kept], D


def _best_leads(ticks, reads, leads, states):
    """Return leads of the same shifts: a state that the position reads, if there is one, or one whose own changes are small.

    Errors of the factors count as much as the lead changes in a tick. Beside the position, differences of it are exact.
    """
    others = [state for state in states if state not in leads]
    V, _ = _fixed(ticks, others, leads)
    cost = sum(each.terms[0].max(tuple(range(each.terms[0].ndim - 2))).sum(-1) for each in ticks.maps)
    place, found = (reads != 0).any(tuple(range(reads.ndim - 1))), []
    for column, lead in enumerate(leads):
        factors = np.zeros(len(cost))
        factors[lead], factors[others] = 1.0, np.abs(V[..., column]).min(tuple(range(V.ndim - 2)))
        factors[found] = 0.0
        first = place & (factors > 0)
        found.append(int(np.argmax(np.where(first, factors, 0.0) if first.any() else factors / np.where(cost > 0, cost, 1.0))))
    return found


def _fixed(ticks, kept, leads):
    """Return the factors V `(..., kept, leads)` of shifts that depend on a loop's numbers, and bounds on their errors.

    They are the least-squares solution of `E_kept V = -E_leads`, the equations of all ticks together, which do not contradict
    each other; a factor that is nothing but rounding is 0.
    """
    batch = np.broadcast_shapes(*(each.E.shape[:-2] for each in ticks.maps))
    E, sizes = (
        np.concatenate([np.broadcast_to(part, (*batch, *part.shape[-2:])) for part in parts], axis=-2)
        for parts in zip(*((each.E, each.terms[0]) for each in ticks.maps), strict=True)
    )
    weight = np.abs(E).max(-1, keepdims=True, initial=0)
    weight = np.where(np.isfinite(weight) & (weight > 0), 1 / np.where(weight > 0, weight, 1), 0.0)
    E, sizes = (np.where(np.isfinite(part), part, 0.0) * weight for part in (E, sizes))
    A, b = E[..., kept], -E[..., leads]
    column = np.abs(A).max(-2, keepdims=True, initial=0)
    column = 1 / np.where(column > 0, column, 1)
    inverse = np.swapaxes(column, -1, -2) * np.linalg.pinv(A * column)
    V = inverse @ b
    for _ in range(2):
        V = V + inverse @ (b - A @ V)
    left = np.abs(b - A @ V) + (ENTRIES * sizes[..., kept] + ROUNDING * np.abs(A)) @ np.abs(V) + ENTRIES * sizes[..., leads]
    dV = np.abs(inverse) @ left
    return np.where(np.abs(V) <= dV, 0.0, V), dV


def _alive(maps):
    """Return the indices of the states that the outputs depend on in some tick of some loop."""
    n = maps[0][0].shape[-1]
    reads, seen = np.zeros((n, n), bool), np.zeros(n, bool)
    for E, _, C, _ in maps:
        reads |= (E != 0).any(tuple(range(E.ndim - 2)))
        seen |= (C != 0).any(tuple(range(C.ndim - 1)))
    return reached(seen, reads)


def reached(seen, reads) -> np.ndarray:
    """Return the indices of the states that are seen, `(n,)`, or that these depend on; reads: on which, `(n, n)`."""
    while not np.array_equal(seen | reads[seen].any(0), seen):
        seen = seen | reads[seen].any(0)
    return np.flatnonzero(seen)


def _some(parts, alive):
    E, B, C, D = parts
    return E[..., alive[:, None], alive], B[..., alive, :], C[..., alive], D
