"""The drift of a loop that is assembled tick by tick, and frames without it."""

from dataclasses import dataclass, replace
from math import prod

import numpy as np

from wavesweep.engine.loops.from_drawing import POSITION, REACTION
from wavesweep.engine.loops.integrator_modes import shifts
from wavesweep.engine.loops.multirate import MultirateLoop
from wavesweep.engine.monodromy.periodic import Ticks, frame_of, known_frames, ticks_of
from wavesweep.engine.monodromy.product import product_with_errors
from wavesweep.engine.monodromy.rounding import ALIKE, ROUNDING, balance, measured_frame, radius_hidden
from wavesweep.engine.monodromy.unit_circle import solve

SAME = 1e-12  # relative difference of a factor between two loops below which it does not depend on their numbers
ROUGH = 1e-9  # error of an entry, in units that give rows and columns similar sizes, from which on its effect is looked for
NEGLIGIBLE = 1e-10  # entries up to this share of the largest one in their row may be set to 0
SOLVED = 1e-6  # of the terms of the equations for a shift: remainders below it are rounding
ROUNDED = 1e3  # roundings of the largest unknown or right side that any equation may leave


@dataclass(frozen=True, slots=True)
class TickDrift:
    """The drift of a drawn loop, by structure.

    states: those of the frame. moved: pairs of a lead and the states that move with it by constant factors,
    `(lead, ((state, factor), ...))`. folded: leads whose shift depends on the numbers of the loop. unread: states that keep
    their value, but for what others add to it, and that nothing reads. All are indices into `states`.
    """

    states: tuple[str, ...]
    moved: tuple
    folded: tuple[int, ...]
    unread: tuple[int, ...]

    @property
    def kept(self) -> list[int]:
        """Indices of the states that remain."""
        gone = {lead for lead, _ in self.moved} | set(self.folded) | set(self.unread)
        return [index for index in range(len(self.states)) if index not in gone]


def drift_of_drawn(one: MultirateLoop, other: MultirateLoop, watched=()) -> TickDrift:
    """Find the drift from two drawings of a loop, with different values of all numbers that vary; see `shifts`.

    watched: the outputs with which `ticks_of` will be called, since these determine which outputs are states that hold.

    A shift that is the same in both is constant. If it differs, it is eliminated numerically (see `without_drift`). If numbers
    are not known exactly, no shift is found, and what drifts stays as an eigenvalue next to 1.
    """
    held, alive = one.held(watched), _alive(one, watched)
    names = [
        f"{each.block.name}.{name}"
        for each in one.placed
        for name in (*each.block.states, *(f"{port} held" for port in held[each.block.name]))
    ]
    at, moved, folded = {name: i for i, name in enumerate(names)}, [], []
    try:
        first = shifts(one, alive)
        second = shifts(other, alive, [next(iter(shift)) for shift in first]) if first and other is not one else first
    except (ArithmeticError, ValueError):
        first = second = []
    for shift, twin in zip(first, second, strict=True):
        lead, *rest = shift
        if shift.keys() == twin.keys() and all(_alike(shift[name], twin[name]) for name in shift):
            moved.append((at[lead], tuple((at[name], shift[name]) for name in rest if name in at)))
        else:
            folded.append(at[lead])
    idle = [f"{each.block.name}.{state}" for each in one.placed if each.block.name not in alive for state in _idle(each.block)]
    return TickDrift(tuple(names), tuple(moved), tuple(folded), tuple(at[name] for name in idle))


def _alike(one, two):
    return abs(one - two) <= SAME * max(abs(one), abs(two))


def _alive(drawn, watched):
    """The blocks that something reads, a hand's port among others, or that a force from outside moves, and what acts on them.

    The others only watch them, and nothing comes back, so that they may count what drifts, and change for ever.
    """
    ports = {each.block.name: [f"{each.block.name}.{port}" for port in each.block.inputs] for each in drawn.placed}
    sources = {name: set().union(*map(drawn.sources, of_block)) for name, of_block in ports.items()}
    shown = [signal for signal in (POSITION, REACTION) if signal in drawn.sums]
    found = {each.block.name for each in drawn.living((*watched, *shown)).placed}
    found |= {name for name, read in sources.items() if read & set(drawn.inputs)}
    while more := {source.rpartition(".")[0] for name in found for source in sources[name]} & ports.keys() - found:
        found |= more
    return found


def _idle(block):
    """The states of a block that add up others, and that the block itself does not read."""
    read = np.any(block.E != 0, axis=tuple(range(block.E.ndim - 2)))
    kept = list(range(len(block.states)))
    while idle := [i for i in kept if not any(read[j, i] for j in kept)]:
        kept = [i for i in kept if i not in idle]
    return [state for i, state in enumerate(block.states) if i not in kept]


def counted_ticks(ticks: Ticks, drift: TickDrift) -> tuple[Ticks, tuple]:
    """Return the ticks with states counted from others: those that a drift moves from its lead, and copies from their source;
    and which are counted from which, as `TickDrift.moved`.

    A copy is a state that takes over another one's value at times, as that of a difference or of a sampled position does. If
    both were kept, what they have in common would be cancelled in every tick, and its digits with it.
    """
    known = {state for lead, others in drift.moved for state in (lead, *(index for index, _ in others))}
    copies = [(lead, tuple((state, 1.0) for state in some if state not in known)) for lead, some in _copies(ticks).items()]
    copies = [each for each in copies if each[1]]
    groups = (*drift.moved, *copies)
    if not groups:
        return ticks, groups
    leads = [lead for lead, _ in drift.moved]
    return replace(ticks, maps=tuple(_counted(each, groups, leads, dict(copies)) for each in ticks.maps)), groups


def counted_row(row, groups):
    """Return a row over states `(..., n)` as one over states that are counted from others."""
    row = row.copy()
    for lead, others in groups:
        terms = np.stack([row[..., lead], *(factor * row[..., index] for index, factor in others)], axis=-1)
        total = terms.sum(-1)
        row[..., lead] = np.where(np.abs(total) <= ALIKE * np.abs(terms).sum(-1), 0.0, total)
    return row


def _counted(block, groups, leads, copies):
    """The map of a tick in these states; copies: source -> its copies, which either take over its value or keep theirs."""
    parts, sizes = ([each.copy() for each in some] for some in ((block.E, block.B, block.C), block.terms[:3]))
    for lead, others in groups:
        for index, factor in others:
            for (E, B, C), sign in ((parts, 1.0), (sizes, -1.0)):
                by = factor if sign > 0 else abs(factor)
                for each in (E, C):
                    each[..., lead] += by * each[..., index]
                for each in (E, B):
                    kept, share = (0.0, 1.0) if lead in copies else (each[..., index, :], by)
                    each[..., index, :] = kept - sign * share * each[..., lead, :]
                if lead in copies:
                    E[..., index, index] -= sign * np.abs(block.E[..., index, index])
    E, B, C = (_cleaned(part, ALIKE * size) for part, size in zip(parts, sizes, strict=True))
    E[..., leads] = 0.0  # nothing opposes a drift
    sizes = [np.where(part == 0, 0.0, size) for part, size in zip((E, B, C), sizes, strict=True)]
    return replace(block, E=E, B=B, C=C, terms=(*sizes, block.terms[3]))


def _cleaned(part, rounding):
    """Set entries to 0 that are rounding of their terms, unless the rounding in a row could hide an entry."""
    least = NEGLIGIBLE * np.abs(part).max(-1, keepdims=True, initial=0.0)
    return np.where((np.abs(part) <= rounding) & (rounding <= least), 0.0, part)


def _copies(ticks):
    """State -> the states that take over its value in some kind of tick, and keep theirs in all others."""
    n, rows = len(ticks.states), [[] for _ in ticks.states]
    for each in ticks.maps:
        E, driven = each.E.reshape(prod(each.E.shape[:-2]), n, n), np.any(each.B, axis=(*range(each.B.ndim - 2), -1))
        alike = (E[0] == E).all((0, 2)) & ~driven
        for state in range(n):
            rows[state].append(E[0, state] if alike[state] else None)
    sources = {state: source for state in range(n) if (source := _copied(state, rows[state])) is not None}
    found = {}
    for state, source in sources.items():
        if source not in sources:
            found.setdefault(source, []).append(state)
    return found


def _copied(state, rows):
    """The state that a state copies, or None; rows: of all kinds of tick, None for a row that a copy cannot have."""
    if any(row is None for row in rows):
        return None
    entries = {tuple((int(at), row[at].item()) for at in np.flatnonzero(row)) for row in rows} - {()}
    pairs = [dict(each) for each in entries]
    if len(pairs) != 1 or len(pairs[0]) != 2 or pairs[0].get(state) != -1.0:
        return None
    return next((at for at, value in pairs[0].items() if at != state and value == 1.0), None)


def counted_from_leads(parts, drift, sign=-1) -> tuple[np.ndarray, ...]:
    """Return matrices whose rows are changes of states, those that leads move being counted from these; sign: 1 for sizes."""
    parts = tuple(part.copy() for part in parts)
    for lead, others in drift.moved:
        for index, factor in others:
            for part in parts:
                part[..., index, :] += sign * (factor if sign < 0 else np.abs(factor)) * part[..., lead, :]
    return parts


def without_drift(E: np.ndarray, drift: TickDrift, sizes=None) -> np.ndarray:
    """Return the frame's matrix less identity without its drift, `(..., k, k)`: its eigenvalues are the others.

    sizes: of errors of E; then those of the result are returned.

    States that a lead moves by constant factors are counted from it. Factors V that depend on the numbers of a loop are found
    in its frame: with the leads S and the others R, `E_R V = -E_S` by columns, since nothing changes along a shift. The others
    then follow `E_RR - V E_SR`, which has no eigenvalue 0. All rows are kept and weighted alike, since which of them follows
    from the others depends on the combination that the loop conserves, and a lead need not be a part of it.
    """
    parts = [(E, -1)] if sizes is None else [(E, -1), (sizes, 1)]
    index = [i for i in range(len(drift.states)) if i in drift.folded or i in drift.kept]
    if len(index) < E.shape[-1]:
        at = np.ix_(index, index)
        parts = [(counted_from_leads((part,), drift, sign)[0][..., *at], sign) for part, sign in parts]
    (E, _), (found, sign) = parts[0], parts[-1]
    if not drift.folded:
        return found
    folded = np.array([index.index(lead) for lead in drift.folded], int)
    rest = np.array([i for i in range(len(index)) if i not in folded], int)
    V = consistent_solution(E[..., rest], -E[..., folded])
    with np.errstate(over="ignore", invalid="ignore"):  # a frame that overflows is for the caller to see
        if sign < 0:
            return found[..., rest[:, None], rest] - V @ found[..., folded[:, None], rest]
        # To first order V changes by A^+ (dA V + dE_S), of A = E_R with rows of equal size, which is solved for V; the solution
        # adds to each column its rounding, relative to the size of the column (Householder).
        size = np.abs(E[..., rest]).max(-1, keepdims=True)
        size, V = np.where(size > 0, size, 1.0), np.abs(V)
        A, S, dA, dS = (part[..., at] / size for part in (E, found) for at in (rest, folded))
        columns = [rest.size * ROUNDING * np.linalg.norm(part, axis=-2, keepdims=True) for part in (A, S)]
        dV = np.abs(np.linalg.pinv(np.nan_to_num(A))) @ ((dA + columns[0]) @ V + dS + columns[1])
        own = V @ found[..., folded[:, None], rest] + dV @ np.abs(E[..., folded[:, None], rest])
        return found[..., rest[:, None], rest] + own


def consistent_solution(A, b) -> np.ndarray:
    """Return the solution of more equations than unknowns that do not contradict each other, each of weight 1.

    NaN if A is not finite, or if they do by more than SOLVED of their terms and the rounding of the solution.
    """
    size = np.abs(A).max(-1, keepdims=True, initial=0)
    with np.errstate(all="ignore"):
        weight = np.where(size > 0, 1 / size, 1.0)
        finite = np.isfinite(A).all((-1, -2), keepdims=True)
        found = _least_squares(*(np.where(finite, part * weight, 0.0) for part in (A, b)))
        left, terms = np.abs(A @ found - b) * weight, (np.abs(A) @ np.abs(found) + np.abs(b)) * weight
        most = [np.abs(part).max((-1, -2), initial=0.0, keepdims=True) for part in (found, b * weight)]
        rounding = ROUNDED * np.finfo(float).eps * np.maximum(*most)
        finite &= ~(left > SOLVED * terms + rounding).any((-1, -2), keepdims=True)
    return np.where(finite, found, np.nan)


def _least_squares(A, b):
    Q, R = np.linalg.qr(A)
    return solve(R, np.swapaxes(Q.conj(), -1, -2) @ b)


def closed_frame(drawn: MultirateLoop, drift: TickDrift) -> np.ndarray:
    """Return the frame-to-frame matrix less identity, without drift, `(..., k, k)`; NaN where rounding leaves nothing of it.

    Loops of fewer than two states are filled up with eigenvalues at 0 of the frame.
    """
    ticks = ticks_of(drawn, alone=True)
    E, growth = measured_frame(ticks.kind, [each.E for each in ticks.maps])
    return known_frames(filled(without_drift(E, drift)), growth)


def frame_with_reliability(drawn: MultirateLoop, drift: TickDrift) -> tuple[np.ndarray, np.ndarray]:
    """Return `closed_frame`, and whether rounding hides its spectral radius, `(...)` (see `radius_hidden`)."""
    E, dE = errors_of_closed(ticks_of(drawn, alone=True, terms=True), drift)
    finite = np.isfinite(E).all((-1, -2))
    flat, errors = (np.where(finite[..., None, None], part, 0.0).reshape(-1, *E.shape[-2:]) for part in (E, dE))
    units = balance(flat)[1]
    rough = (errors * (units[:, None, :] / units[:, :, None]) > ROUGH).any((-1, -2)) & finite.reshape(-1)
    rough[rough] = radius_hidden(flat[rough], errors[rough])
    return E, rough.reshape(finite.shape)


def closed(ticks: Ticks, drift: TickDrift) -> np.ndarray:
    """`closed_frame` for ticks that are connected already, whatever rounding leaves."""
    return filled(without_drift(frame_of(ticks), drift))


def errors_of_closed(ticks: Ticks, drift: TickDrift) -> tuple[np.ndarray, np.ndarray]:
    """Return `closed` and bounds on the errors of its entries; ticks: with the sizes of their terms."""
    changes, sizes = [each.E for each in ticks.maps], [each.terms[0] for each in ticks.maps]
    E, dE = product_with_errors(ticks.kind, changes, sizes, each=True)
    return filled(without_drift(E, drift)), filled(without_drift(E, drift, dE), 0.0)


def filled(E: np.ndarray, own: float = -1.0) -> np.ndarray:
    """Return frames less identity of two states or more: eigenvalues at 0 of the frame are added; own: of such a state."""
    missing = 2 - E.shape[-1]
    if missing <= 0:
        return E
    whole = np.zeros((*E.shape[:-2], 2, 2), E.dtype)
    whole[..., : E.shape[-1], : E.shape[-1]] = E
    for i in range(E.shape[-1], 2):
        whole[..., i, i] = own
    return whole
