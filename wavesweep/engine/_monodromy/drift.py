"""The drift of a loop that is assembled tick by tick, and frames without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine._loops.from_drawing import POSITION, REACTION
from wavesweep.engine._loops.integrator_modes import shifts
from wavesweep.engine._loops.lasting_modes import lasting_modes
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.bounded import Bounded
from wavesweep.engine._monodromy.periodic import Ticks, frame_of, known_frames
from wavesweep.engine._monodromy.product import (
    product_with_errors,
    product_with_tight_errors,
)
from wavesweep.engine._monodromy.rounding import balance, measured_frame, radius_hidden
from wavesweep.engine._monodromy.unit_circle import solve
from wavesweep.engine.doubles import CANCELLED_SUM, EPS

if TYPE_CHECKING:
    from wavesweep.engine._loops.block import Block

# relative difference of a factor between two loops below which it does not depend on their numbers
SAME_FACTOR = 1e-12
# error of an entry, in units that give rows and columns similar sizes, from which on its effect is
# looked for
ROUGH_ENTRY = 1e-9
NEGLIGIBLE = 1e-10  # entries up to this share of the largest one in their row may be set to 0
SOLVED = 1e-6  # of the terms of the equations for a shift: remainders below it are rounding
ROUNDINGS_LEFT = 1e3  # roundings of the largest unknown or right side that any equation may leave


# leads with the states that move with each by factors, see `MarginalModes`
ConstantModes = tuple[tuple[int, tuple[tuple[int, float], ...]], ...]


@dataclass(frozen=True, slots=True)
class MarginalModes:
    """The marginal modes of a drawn loop by its structure: what drifts in it.

    states: those of the frame. constant: modes whose shapes are the same for all numbers, as pairs
    of a lead and the states that move with it by factors, `(lead, ((state, factor), ...))`.
    varying: leads of modes whose shapes depend on the numbers of the loop. unobserved: states that
    keep their value, but for what others add to it, and that nothing reads. All are indices into
    `states`.
    """

    states: tuple[str, ...]
    constant: ConstantModes
    varying: tuple[int, ...]
    unobserved: tuple[int, ...]

    @property
    def leads(self) -> list[int]:
        """Indices of the leads of the constant modes."""
        return [lead for lead, _ in self.constant]

    @property
    def remaining(self) -> list[int]:
        """Indices of the states that remain."""
        gone = {*self.leads, *self.varying, *self.unobserved}
        return [index for index in range(len(self.states)) if index not in gone]

    @staticmethod
    def of(drawn: MultirateLoop, twin: MultirateLoop, watched: Sequence[str] = ()) -> MarginalModes:
        """Find the drift from two drawings of a loop, with different values of all numbers that
        vary; see `shifts`.

        watched: the outputs with which `Ticks.of` will be called, since these determine which
        outputs are states that hold.

        A shift that is the same in both is constant. If it differs, it is eliminated numerically
        (see `without_drift`). If numbers are not known exactly, no shift is found, and what drifts
        stays as an eigenvalue next to 1.
        """
        return MarginalModes._of(drawn, twin, watched)[0]

    @staticmethod
    def of_frames(
        drawn: MultirateLoop, twin: MultirateLoop, watched: Sequence[str] = ()
    ) -> MarginalModes:
        """Find the drift as `of`, and with it the modes that last beside sums that count for ever
        (see `lasting_modes`): from frame to frame they stay, but they may move within a frame.

        They are among those whose shapes depend on numbers, but nothing is known of them in single
        ticks.
        """
        of_structure, alive, pairs = MarginalModes._of(drawn, twin, watched)
        lasting = [
            lasting_modes(drawing, alive, [pair[side] for pair in pairs], side)
            for side, drawing in enumerate((drawn, twin))
        ]
        return _with_more(of_structure, drawn, watched, min(lasting) - len(pairs))

    @staticmethod
    def _of(
        drawn: MultirateLoop, twin: MultirateLoop, watched: Sequence[str]
    ) -> tuple[MarginalModes, set[str], list[tuple[Any, ...]]]:
        """The drift, the blocks that it is of, and its shifts in both drawings."""
        held_ports = drawn.held(watched)
        alive = living_blocks(drawn, watched)
        names = []
        idle = []
        for scheduled in drawn.placed:
            block = scheduled.block
            for state in block.states:
                names.append(f"{block.name}.{state}")
            for port in held_ports[block.name]:
                names.append(f"{block.name}.{port} held")
            if block.name not in alive:
                idle += [f"{block.name}.{state}" for state in _idle(block)]
        index = {name: i for i, name in enumerate(names)}
        constant = []
        varying = []
        pairs = _shifts_of_both(drawn, twin, alive)
        for shift, other_shift in pairs:
            lead, *rest = shift
            if _same_shape(shift, other_shift):
                followers = tuple((index[name], shift[name]) for name in rest if name in index)
                constant.append((index[lead], followers))
            else:
                varying.append(index[lead])
        unobserved = tuple(index[name] for name in idle)
        found = MarginalModes(tuple(names), tuple(constant), tuple(varying), unobserved)
        return found, alive, pairs

    def relative_ticks(self, ticks: Ticks, copied: bool = True) -> tuple[Ticks, ConstantModes]:
        """Return the ticks with states relative to others: those that a drift moves to its lead,
        and copies to their source if asked for; and which are relative to which, as
        `MarginalModes.constant`.

        A copy is a state that takes over another one's value at times, as that of a difference or
        of a sampled position does. If both were kept, what they have in common would be cancelled
        in every tick, and its digits with it.
        """
        drifting = set()
        for lead, followers in self.constant:
            drifting.add(lead)
            drifting.update(index for index, _ in followers)
        copies = {}
        for source, states in _copies(ticks).items() if copied else ():
            followers = tuple((state, 1.0) for state in states if state not in drifting)
            if followers:
                copies[source] = followers
        groups = (*self.constant, *copies.items())
        if not groups:
            return ticks, groups
        maps = tuple(_relative_block(block, groups, self.leads, copies) for block in ticks.maps)
        return replace(ticks, maps=maps), groups

    def closed_frame(self, drawn: MultirateLoop) -> np.ndarray:
        """Return the frame-to-frame matrix less identity, without drift, `(..., k, k)`; NaN where
        rounding leaves nothing of it.

        Loops of fewer than two states are filled up with eigenvalues at 0 of the frame.
        """
        ticks = Ticks.of(drawn, alone=True)
        E, growth = measured_frame(ticks.kind, [block.E for block in ticks.maps])
        return known_frames(self.removed_from(E), growth)

    def frame_with_reliability(self, drawn: MultirateLoop) -> tuple[np.ndarray, np.ndarray]:
        """Return `closed_frame`, and whether rounding hides its spectral radius, `(...)` (see
        `radius_hidden`)."""
        ticks = Ticks.of(drawn, alone=True, terms=True)
        E, dE = self.frames_with_errors(ticks)
        matrices = (-1, *E.shape[-2:])
        finite = np.isfinite(E).all((-1, -2))
        flat = np.where(finite[..., None, None], E, 0.0).reshape(matrices)
        errors = np.where(finite[..., None, None], dE, 0.0).reshape(matrices)
        units = balance(flat)[1]
        errors_in_units = errors * (units[:, None, :] / units[:, :, None])
        rough = (errors_in_units > ROUGH_ENTRY).any((-1, -2)) & finite.reshape(-1)
        rough[rough] = radius_hidden(flat[rough], errors[rough])
        return E, rough.reshape(finite.shape)

    def frames_of(self, ticks: Ticks) -> np.ndarray:
        """`closed_frame` for ticks that are connected already, whatever rounding leaves."""
        return filled(without_drift(frame_of(ticks), self))

    def frames_with_errors(
        self, ticks: Ticks, *, tight: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return `frames_of`, and bounds on the errors of its entries; ticks: with the sizes of
        their terms.

        tight: whether the bounds are those of `product_with_tight_errors`.
        """
        changes = [block.E for block in ticks.maps]
        sizes = [block.terms[0] for block in ticks.maps]
        if tight:
            E, dE = product_with_tight_errors(ticks.kind, changes, sizes)
        else:
            E, dE = product_with_errors(ticks.kind, changes, sizes, per_loop=True)
        return self.removed_from(E), filled(without_drift(E, self, dE), 0.0)

    def removed_from(self, E: np.ndarray) -> np.ndarray:
        """Return frames less identity without the modes, see `without_drift`, filled up to two
        states, see `filled`."""
        return filled(without_drift(E, self))


def _with_more(
    marginal: MarginalModes, drawn: MultirateLoop, watched: Sequence[str], count: int
) -> MarginalModes:
    """Marginal modes with so many more, which the frame of a loop shows.

    Their leads are the states that the vectors x with `E x = 0` move most, in units that give rows
    and columns of E similar sizes.
    """
    if count <= 0:
        return marginal
    E = without_drift(frame_of(Ticks.of(drawn, watched, alone=True)), marginal)
    if not np.isfinite(E).all():
        return marginal
    from scipy.linalg import qr

    balanced, _ = balance(E[None])
    *_, shapes = np.linalg.svd(balanced[0])
    _, leads = qr(shapes[-count:], mode="r", pivoting=True)
    more = np.array(marginal.remaining)[leads[:count]].tolist()
    return replace(marginal, varying=(*marginal.varying, *more))


def _shifts_of_both(
    drawn: MultirateLoop, twin: MultirateLoop, alive: set[str]
) -> list[tuple[dict[Any, Any], dict[Any, Any]]]:
    """Pairs of a shift in one drawing and in the other; none if the numbers are not known
    exactly."""
    try:
        first = shifts(drawn, alive)
        second = first
        if first and twin is not drawn:
            leads = [next(iter(shift)) for shift in first]
            second = shifts(twin, alive, leads)
    except (ArithmeticError, ValueError):
        return []
    return list(zip(first, second, strict=True))


def _same_shape(shift: dict[str, float], second: dict[str, float]) -> bool:
    """Whether two shifts move the same states by the same factors."""
    if shift.keys() != second.keys():
        return False
    for name, factor in shift.items():
        largest = max(abs(factor), abs(second[name]))
        if abs(factor - second[name]) > SAME_FACTOR * largest:
            return False
    return True


def living_blocks(drawn: MultirateLoop, watched: Sequence[str]) -> set[str]:
    """The blocks that something reads, a hand's port among others, or that a force from outside
    moves, and what acts on them.

    The others only watch them, and nothing comes back, so that they may count what drifts, and
    change for ever.
    """
    sources: dict[str, set[str]] = {}
    for scheduled in drawn.placed:
        block = scheduled.block
        read = sources[block.name] = set()
        for port in block.inputs:
            read.update(drawn.sources(f"{block.name}.{port}"))
    shown = [signal for signal in (POSITION, REACTION) if signal in drawn.sums]
    alive = {scheduled.block.name for scheduled in drawn.living((*watched, *shown)).placed}
    moved = {name for name, read in sources.items() if not read.isdisjoint(drawn.inputs)}
    alive |= moved
    reached = set(alive)
    while reached:
        acting: set[str] = set()
        for name in reached:
            acting.update(source.rpartition(".")[0] for source in sources[name])
        reached = acting & sources.keys() - alive
        alive |= reached
    return alive


def _idle(block: Block) -> list[str]:
    """The states of a block that add up others, and that the block itself does not read."""
    read = np.any(block.E != 0, axis=tuple(range(block.E.ndim - 2)))
    busy = np.ones(len(block.states), bool)
    while True:
        read_by_busy = read[busy].any(0)
        if read_by_busy[busy].all():
            break
        busy &= read_by_busy
    return [state for state, is_busy in zip(block.states, busy, strict=True) if not is_busy]


def relative_row(
    row: np.ndarray, groups: Sequence[tuple[int, Sequence[tuple[int, float]]]]
) -> np.ndarray:
    """Return a row over states `(..., n)` as one over states that are relative to others."""
    row = row.copy()
    for lead, followers in groups:
        terms = [row[..., lead]]
        for index, factor in followers:
            terms.append(factor * row[..., index])
        together = np.stack(terms, axis=-1)
        total = together.sum(-1)
        rounding = CANCELLED_SUM * np.abs(together).sum(-1)
        row[..., lead] = np.where(np.abs(total) <= rounding, 0.0, total)
    return row


def _relative_block(
    block: Block,
    groups: tuple[tuple[int, tuple[Any, ...]], ...],
    leads: list[int],
    copies: dict[int, tuple[tuple[Any, ...], ...]],
) -> Block:
    """The map of a tick in these states.

    copies: source -> its copies, which either take over its value or keep theirs.
    """
    exact = [block.E.copy(), block.B.copy(), block.C.copy()]
    sizes = [terms.copy() for terms in block.terms[:3]]
    for lead, followers in groups:
        copied = lead in copies
        for state, factor in followers:
            _make_relative(exact, state, lead, factor, 1.0, copied)
            _make_relative(sizes, state, lead, abs(factor), -1.0, copied)
            if copied:
                taken_over = np.abs(block.E[..., state, state])
                exact[0][..., state, state] -= taken_over
                sizes[0][..., state, state] += taken_over
    E, B, C = map(_without_rounding, exact, sizes)
    E[..., leads] = 0.0  # nothing opposes a drift
    sizes = [
        np.where(matrix == 0, 0.0, size) for matrix, size in zip((E, B, C), sizes, strict=True)
    ]
    return replace(block, E=E, B=B, C=C, terms=(*sizes, block.terms[3]))


def _without_rounding(matrix: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Set entries to 0 that are rounding of their terms, unless the rounding in a row could hide
    an entry."""
    rounding = CANCELLED_SUM * size
    least = NEGLIGIBLE * np.abs(matrix).max(-1, keepdims=True, initial=0.0)
    negligible = (np.abs(matrix) <= rounding) & (rounding <= least)
    return np.where(negligible, 0.0, matrix)


def _make_relative(
    matrices: list[np.ndarray], state: int, lead: int, factor: float, sign: float, copied: bool
) -> None:
    """Make a state relative to its lead in E, B and C of a tick, in place, or in their sizes
    with the sign -1."""
    E, B, C = matrices
    for matrix in (E, C):
        matrix[..., lead] += factor * matrix[..., state]
    for matrix in (E, B):
        if copied:
            matrix[..., state, :] = 0.0 - sign * matrix[..., lead, :]
        else:
            matrix[..., state, :] -= sign * factor * matrix[..., lead, :]


def _copies(ticks: Ticks) -> dict[int, list[int]]:
    """State -> the states that take over its value in some kind of tick, and keep theirs in all
    others."""
    n = len(ticks.states)
    rows: list[list[np.ndarray | None]] = [[] for _ in ticks.states]
    for block in ticks.maps:
        E = block.E.reshape(prod(block.E.shape[:-2]), n, n)
        driven = np.any(block.B, axis=(*range(block.B.ndim - 2), -1))
        alike = (E[0] == E).all((0, 2)) & ~driven
        for state in range(n):
            rows[state].append(E[0, state] if alike[state] else None)
    sources = {}
    for state in range(n):
        source = _copied(state, rows[state])
        if source is not None:
            sources[state] = source
    copies: dict[int, list[int]] = {}
    for state, source in sources.items():
        if source not in sources:
            copies.setdefault(source, []).append(state)
    return copies


def _copied(state: int, rows: list[np.ndarray | None]) -> int | None:
    """The state that a state copies, or None; rows: of all kinds of tick, None for a row that a
    copy cannot have."""
    taking_over = None
    for row in rows:
        if row is None:
            return None
        if not row.any():
            continue
        if taking_over is not None and not np.array_equal(row, taking_over):
            return None
        taking_over = row
    if taking_over is None or taking_over[state] != -1.0:
        return None
    sources = [
        state_before
        for state_before in np.flatnonzero(taking_over).tolist()
        if state_before != state
    ]
    if len(sources) != 1 or taking_over[sources[0]] != 1.0:
        return None
    return sources[0]


def relative_to_leads(
    matrices: tuple[np.ndarray, ...], drift: MarginalModes, sign: int = -1
) -> tuple[np.ndarray, ...]:
    """Return matrices whose rows are changes of states, those that leads move being relative to
    these; sign: 1 for sizes."""
    matrices = tuple(matrix.copy() for matrix in matrices)
    for lead, followers in drift.constant:
        for index, factor in followers:
            weight = -factor if sign < 0 else abs(factor)
            for matrix in matrices:
                matrix[..., index, :] += weight * matrix[..., lead, :]
    return matrices


def without_drift(
    E: np.ndarray, drift: MarginalModes, sizes: np.ndarray | None = None
) -> np.ndarray:
    """Return the frame's matrix less identity without its marginal modes, `(..., k, k)`; it has all
    other eigenvalues.

    sizes: of errors of E; then those of the result are returned.

    States that a lead moves by constant factors are relative to it. Factors V that depend on the
    numbers of a loop are found in its frame: with the leads S and the remaining states R, `E_R V =
    -E_S` by columns, since nothing changes along a shift. The states R then follow `E_RR - V E_SR`,
    which has no eigenvalue 0. All rows are used with equal weight, since it depends on the
    combination that the loop conserves which row is redundant, and a lead need not be in it.
    """
    index = sorted({*drift.varying, *drift.remaining})
    if len(index) < E.shape[-1]:
        column = np.array(index, int)[:, None]
        (E,) = relative_to_leads((E,), drift)
        E = E[..., column, column.T]
        if sizes is not None:
            (sizes,) = relative_to_leads((sizes,), drift, 1)
            sizes = sizes[..., column, column.T]
    if not drift.varying:
        return E if sizes is None else sizes
    leads = np.searchsorted(index, drift.varying)
    rest = np.delete(np.arange(len(index)), leads)
    V = consistent_solution(E[..., rest], -E[..., leads])
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # a frame that overflows is for the caller to see
        if sizes is not None:
            return _errors_without(Bounded(E, sizes), V, leads, rest)
        return E[..., rest[:, None], rest] - V @ E[..., leads[:, None], rest]


def _errors_without(E: Bounded, V: np.ndarray, leads: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Return bounds on the errors of `without_drift`; E: with bounds on its errors.

    V misses the equations `E_R V = -E_S` by no more than `missed`, of any E within the bounds, and
    a left inverse of E_R takes that to what V itself is off by, to first order.
    """
    R = E.part(..., rest)
    missed = (R @ V + E.part(..., leads)).size
    size = np.abs(R.value).max(-1, keepdims=True)
    size = np.where(size > 0, size, 1.0)
    inverse = np.linalg.pinv(np.nan_to_num(R.value / size)) / size.mT
    factors = Bounded(V, np.abs(inverse) @ missed)
    remaining = E.part(..., rest[:, None], rest)
    return (remaining - factors @ E.part(..., leads[:, None], rest)).error


def consistent_solution(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the solution of more equations than unknowns that do not contradict each other, each
    of weight 1.

    NaN if A is not finite, or if they do by more than SOLVED of their terms and the rounding of the
    solution.
    """
    size = np.abs(A).max(-1, keepdims=True, initial=0)
    with np.errstate(all="ignore"):
        weight = np.where(size > 0, 1 / size, 1.0)
        finite = np.isfinite(A).all((-1, -2), keepdims=True)
        weighted = b * weight
        Q, R = np.linalg.qr(np.where(finite, A * weight, 0.0))
        adjoint = Q.conj().mT
        x = solve(R, adjoint @ np.where(finite, weighted, 0.0))
        residual = np.abs(A @ x - b) * weight
        terms = (np.abs(A) @ np.abs(x) + np.abs(b)) * weight
        largest_x = np.abs(x).max((-1, -2), initial=0.0, keepdims=True)
        largest_b = np.abs(weighted).max((-1, -2), initial=0.0, keepdims=True)
        rounding = ROUNDINGS_LEFT * EPS * np.maximum(largest_x, largest_b)
        finite &= ~(residual > SOLVED * terms + rounding).any((-1, -2), keepdims=True)
    return np.where(finite, x, np.nan)


def filled(E: np.ndarray, diagonal: float = -1.0) -> np.ndarray:
    """Return frames less identity of two states or more: eigenvalues at 0 of the frame are
    added, each with that diagonal."""
    missing = 2 - E.shape[-1]
    if missing <= 0:
        return E
    frames = np.zeros((*E.shape[:-2], 2, 2), E.dtype)
    frames[..., : E.shape[-1], : E.shape[-1]] = E
    for i in range(E.shape[-1], 2):
        frames[..., i, i] = diagonal
    return frames
