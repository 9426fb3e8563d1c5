"""The closed loop of a frame, ready for any frequency: its frame-to-frame map, and the outputs of each tick."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.analysis.response.ticks import entries_errors, holding, joined, long_sum, plus, repeated, taken, times, unrolled
from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.drift import drift_of, latch, scene_drift
from wavesweep.errors import IllPosedLoopError, WavesweepError
from wavesweep.lifted.circle import solve
from wavesweep.lifted.connect import WORST_CONDITION, connect
from wavesweep.lifted.lift import fast_side, latches, lift_held, slow_sums
from wavesweep.lifted.rounding import ENTRIES, ROUNDING, both


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """Both rates of one loop with the wall in place: `w X = E X + g`, w = z - 1, g the effect of the hand's force in a frame.

    fast: the tick, from `f_h` and the held signals to the first `outputs` of its outputs and the samples. Its states come first
    in X. E, dE `(..., n, n)`: the closed frame, with every position counted from the reference, and a bound on the error of its
    entries; rows, drows: the same matrices before the step of the reference is subtracted from those of the other positions. H,
    dH `(..., held, n)`: the newest held signals; latched: which of X are those of the frame before. shift, dshift `(..., n)`:
    the drift that is treated separately. It is a shift of the whole scene, or the state that belongs to a combination `law X`
    that no wall force changes (then one state is left out of X). still: the outputs in that state. lead: the state that
    represents the position of the scene; None if a spring holds the scene. free: whether nothing reads that state. before: E of
    the ticks until the held signals change, with these as states. shown: the outputs and the effects of the ticks. lost:
    whether the frame overflowed.
    """

    diagram: Diagram
    wall: tuple
    fast: Block
    outputs: int
    states: tuple[str, ...]
    E: np.ndarray
    dE: np.ndarray
    rows: np.ndarray
    drows: np.ndarray
    H: np.ndarray
    dH: np.ndarray
    latched: np.ndarray
    shift: np.ndarray
    dshift: np.ndarray
    still: np.ndarray
    lead: int | None
    free: np.ndarray
    law: np.ndarray | None
    dlaw: np.ndarray | None
    before: tuple | None
    lost: np.ndarray
    shown: "Shown | None" = None

    @property
    def counted(self) -> np.ndarray:
        """0 for the state that others are counted from, which is the origin in the frame; 1 for the others, `(n,)`."""
        return np.array([float(index != self.lead) for index in range(len(self.states))])


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A frame tick by tick, as pairs of arrays and bounds on the errors of their entries.

    seen: `(..., p, ticks, n)`, the outputs in each tick for each state at the frame's start. impulse: `(..., p, ticks)`, the
    outputs for a force that many ticks ago. left: `(..., n, ticks)`, the part that the force of each tick adds to the state
    after the frame; law: `(..., 1, ticks)`, the part that it adds to the conserved combination.
    """

    seen: tuple
    impulse: tuple
    left: tuple
    law: tuple | None

    def sums(self, z, *, alone=False):
        """Return at each point the outputs' sums over the frame, each tick's times z^-i, under the force z^i.

        z: `(ticks, points)`. The result is four pairs: the part of the sums per state `(..., p, points, n)`, the part without
        the state `(..., p, points)`, and the parts that are added to the state `(..., n, points)` and to the conserved
        combination `(..., 1, points)`; the last is None if there is no such combination. alone: no product of matrices is of
        several points, so that a point's bits do not depend on the other points.
        """
        ticks, real, imag = z.shape[0], z.real.copy(), z.imag.copy()  # contiguous, as BLAS wants them
        rough, weight = long_sum(ticks), np.arange(ticks, 0, -1)
        (seen, dseen), impulse = self.seen, tuple(part * weight for part in self.impulse)
        if alone:
            turn = z.T.copy()  # its order in memory decides in which order sums are taken
            rows = (turn.conj()[:, None, :] @ seen[..., None, :, :])[..., 0, :]
            own, *made = (
                (part[..., None, :] * each).sum(-1)
                for part, each in (
                    (impulse[0], turn.conj()),
                    (self.left[0], turn),
                    *(((self.law[0], turn),) if self.law else ()),
                )
            )
        else:
            rows, own = real.T @ seen - 1j * (imag.T @ seen), impulse[0] @ real - 1j * (impulse[0] @ imag)
            made = [part[0] @ real + 1j * (part[0] @ imag) for part in (self.left, self.law) if part]
        made = [
            (sums, (part[1] + rough * np.abs(part[0])).sum(-1, keepdims=True))
            for sums, part in zip(made, (self.left, self.law), strict=False)
        ] + [None] * (self.law is None)
        return (
            (rows, (dseen + rough * np.abs(seen)).sum(-2)),
            (own, (impulse[1] + rough * np.abs(impulse[0])).sum(-1, keepdims=True)),
            *made,
        )


def prepare(diagram: Diagram, K_VE, B_VE, outputs=None) -> Loop:
    """Connect and lift the loop once, for any number of frequencies.

    diagram: the drawing. `K_VE` (N/m), `B_VE` (N*s/m): numbers or arrays over the diagram's batch. outputs: signals of the fast
    side; by default those of the drawing, the displacement in the tick and the control force.
    """
    outputs = tuple(outputs or (diagram.hand.displacement, diagram.hand.reaction))
    samples = tuple(dict.fromkeys(diagram.samples.values()))
    fast = fast_side(diagram, (*outputs, *(name for name in samples if name not in outputs)), terms=True)
    if np.any(fast.D[..., [fast.outputs.index(name) for name in samples], :1]):
        raise WavesweepError("a sampler reads the hand's force in the same tick: the response of such a loop is not known")
    with np.errstate(all="ignore"):  # a frame that overflows is found below
        tick = holding(fast, len(outputs))
        one = (tick.E, entries_errors(tick)[0])
        before, after = (repeated(one, n) for n in (diagram.delay, diagram.ratio - diagram.delay))
        parts = _closed(diagram, fast, samples, (before, after), (K_VE, B_VE))
        drift = drift_of(diagram)
        if not drift.driven and drift.lead in parts["states"]:
            parts |= _conserved(parts, fast, parts["states"].index(drift.lead))
        parts["still"] = _still(parts, fast, outputs, diagram.hand)
    lost = ~np.logical_and.reduce([np.isfinite(parts[name]).all((-1, -2)) for name in ("E", "dE", "H", "dH")])
    for name in ("E", "dE", "rows", "drows", "H", "dH"):
        parts[name] = np.where(lost[..., None, None], 0.0, parts[name])
    loop = Loop(diagram, (K_VE, B_VE), fast, len(outputs), before=before, lost=lost, **parts)
    with np.errstate(all="ignore"):
        return replace(loop, shown=shown(loop, tick))


def shown(loop: Loop, tick: Block) -> Shown:
    """Return the outputs of a tick, with held inputs as states, in a frame of this loop."""
    n, ratio, (_, dB, _, dD) = len(loop.fast.states), loop.diagram.ratio, entries_errors(tick)
    reads, force = unrolled(tick, ratio)
    later = times(reads, tuple(part[..., None, :, :] for part in (tick.B, dB)))
    impulse = joined(((tick.D, dD), taken(later, (..., slice(0, ratio - 1), 0))), -1)
    # The last tick's force is the one that nothing has changed yet.
    back = taken(force, (..., slice(0, n), slice(None, None, -1)))
    into, law = np.eye(len(loop.states), n), None
    if loop.lead is not None and loop.lead < n:
        into[:, loop.lead] -= loop.shift * loop.counted
    left = times((into, 0 * into), back)
    if loop.law is not None:
        law = times((loop.law[..., None, :], loop.dlaw[..., None, :]), back)
        left = plus(left, times((-loop.shift[..., None], loop.dshift[..., None]), law))
    return Shown(_seen(loop, reads), impulse, left, law)


def _seen(loop, reads):
    """Return the outputs for the state at the start of a frame: by itself, and through the held signals, old and new."""
    n, delay, rest = len(loop.fast.states), loop.diagram.delay, loop.diagram.ratio - loop.diagram.delay
    own, held = taken(reads, (..., slice(0, n))), taken(reads, (..., slice(n, None)))
    new = old = taken(held, (..., slice(0, delay), slice(None)))
    new = tuple(0 * part for part in new)
    if rest:
        later = tuple(0 * part[..., :rest, :] for part in held)
        if loop.before:
            change = tuple(part[..., None, :n, n:] for part in loop.before)
            later = times(taken(own, (..., slice(0, rest), slice(None))), change)
        old, new = joined((old, later), -2), joined((new, taken(held, (..., slice(0, rest), slice(None)))), -2)
    H = tuple(part[..., None, :, :] for part in (loop.H, loop.dH))
    seen = plus(times(old, (loop.latched, 0 * loop.latched)), times(new, H))
    for part, of_state in zip(seen, own, strict=True):
        part[..., :n] += of_state * loop.counted[:n]
    return seen


def _closed(diagram, fast, samples, sizes, wall) -> dict:
    """Return the frame with the wall closed, drifting states counted from the state that leads them."""
    frame = lift_held(fast, diagram.ratio, diagram.delay, tuple(diagram.holds), samples)
    sources, fast_states = tuple(diagram.holds.values()), len(fast.states)
    outputs = (*diagram.wall, *sources)
    block = connect(
        "slow", (frame, *diagram.slow, *latches(diagram)), slow_sums(diagram), (diagram.wall_force,), outputs, terms=True
    )
    names, E, C = block.states, block.E.copy(), block.C.copy()
    latched = np.array([[latch(name) == state for state in names] for name in diagram.holds], float)
    latched = latched.reshape(len(sources), len(names))
    shift, lead = np.zeros(len(names)), None
    if drift_of(diagram).driven:
        drift = scene_drift(diagram)
        lead = names.index(drift.lead)
        shift = np.array([drift.shift.get(name, 0.0) for name in names]) / drift.shift[drift.lead]
        E[..., lead] = C[..., lead] = 0  # the sum of the columns of all that drifts, zero by structure
        C[..., 0, lead] = 1 / drift.shift[drift.lead]
    unsure = (ENTRIES * np.asarray(block.condition * fast.condition, float))[..., None, None]
    of_fast = (ENTRIES * np.asarray(fast.condition, float))[..., None, None]
    E_terms, B_terms, C_terms, D_terms = (of_fast * part for part in block.terms)
    if lead is not None:  # these entries are exact
        E_terms[..., lead] = C_terms[..., lead] = 0
    K, F = (np.asarray(value, float)[..., None, None] for value in wall)
    of_loops = block.condition / frame.condition * fast.condition  # without that of modes which turn by whole circles
    read, dread = _force_of_wall((K, F), C, block, (C_terms, D_terms), (unsure, of_loops))
    H, rows = C[..., 2:, :] + block.D[..., 2:, :] * read, E + block.B * read
    dH = C_terms[..., 2:, :] + D_terms[..., 2:, :] * np.abs(read) + np.abs(block.D[..., 2:, :]) * dread
    drows = E_terms + B_terms * np.abs(read) + np.abs(block.B) * dread
    drows[..., :fast_states, :] += _frame_error(sizes, latched, np.abs(H), unsure, fast_states)
    E, dE, free = rows, drows, np.zeros((), bool)
    if lead is not None:
        others = (shift * (np.arange(len(names)) != lead))[:, None]
        E, dE = rows - others * rows[..., lead : lead + 1, :], drows + others * drows[..., lead : lead + 1, :]
        free = K[..., 0, 0] == 0
    found = {
        "states": names,
        "E": E,
        "dE": dE,
        "rows": rows,
        "drows": drows,
        "H": H,
        "dH": dH,
        "latched": latched,
        "shift": shift,
        "dshift": 0 * shift,
        "lead": lead,
        "free": free,
        "law": None,
        "dlaw": None,
    }
    return _without_unread(found, fast_states)


def _force_of_wall(wall, C, block, terms, unsure):
    """Return the row that gives the force of the closed wall from the states, and the errors of its entries.

    terms: errors of C and of the block's D. unsure: rounding of entries, and the condition of the block's algebraic loops.
    """
    (K, F), (C_terms, D_terms), (unsure, condition) = wall, terms, unsure
    (x, v), (D_x, D_v) = (C[..., :1, :], C[..., 1:2, :]), (block.D[..., :1, :], block.D[..., 1:2, :])
    through, size = 1 - K * D_x - F * D_v, 1 + np.abs(K * D_x) + np.abs(F * D_v)
    _refuse_ill_posed(condition, size / np.abs(through))
    read = (K * x + F * v) / through
    vague = K * D_terms[..., :1, :] + F * D_terms[..., 1:2, :] + unsure * size
    error = (K * C_terms[..., :1, :] + F * C_terms[..., 1:2, :] + unsure * (np.abs(K * x) + np.abs(F * v))) / np.abs(through)
    return read, error + vague / np.abs(through) * np.abs(read)


def _refuse_ill_posed(condition, gain):
    """Raise IllPosedLoopError if the wall's force depends on itself in the same instant and has no solution."""
    worst = condition * gain[..., 0, 0]
    worst = float(np.max(np.where(np.isfinite(worst) | (gain[..., 0, 0] == np.inf), worst, 0.0)))
    if worst > WORST_CONDITION:
        raise IllPosedLoopError(
            f"the algebraic loop through the wall is ill-posed: condition number {worst:.1e}, expected below "
            f"{WORST_CONDITION:.0e}; give the loop a delay (environment.delay or local_model.delay) or change the wall"
        )


def _frame_error(sizes, latched, held, unsure, n):
    """Return the error of the rows of the fast states: of the frame's own matrix and of the effect of held signals in it."""
    before, after = sizes
    whole = both(before, after) if before and after else before or after
    none = np.zeros((n, held.shape[-2]))
    new = taken(after, (..., slice(0, n), slice(n, None))) if after else (none, none)
    old = taken(before, (..., slice(0, n), slice(n, None))) if before else (none, none)
    if before and after:
        old = times((np.eye(n) + after[0][..., :n, :n], after[1][..., :n, :n]), old)
    error = (new[1] + unsure * np.abs(new[0])) @ held + (old[1] + unsure * np.abs(old[0])) @ latched
    error[..., :n] += whole[1][..., :n, :n]
    return error


def _without_unread(found, fast_states) -> dict:
    """Leave out slow states that nothing reads; they may drift."""
    batch = tuple(range(found["rows"].ndim - 2))
    reads, kept = np.any(found["rows"] != 0, axis=batch), np.any(found["H"] != 0, axis=(*batch, found["H"].ndim - 2))
    kept = kept | found["latched"].any(0)
    kept[:fast_states] = True
    if found["lead"] is not None:
        kept[found["lead"]] = True
    for _ in found["states"]:
        kept = kept | np.any(reads[kept], axis=0)
    index = np.flatnonzero(kept)
    lead = None if found["lead"] is None else int(np.flatnonzero(index == found["lead"])[0])
    square = {name: found[name][..., index[:, None], index] for name in ("E", "dE", "rows", "drows")}
    wide = {name: found[name][..., index] for name in ("H", "dH", "latched", "shift", "dshift")}
    return found | square | wide | {"states": tuple(found["states"][i] for i in index), "lead": lead}


def _conserved(found, fast, ref) -> dict:
    """Separate the conserved combination `q = s - l x`: s is that state, l = E_sR E_RR^-1, and (-l, 1) E = 0.

    The state that belongs to q, (N, 1 + l N) with E (N, 1 + l N) = 0, is constant within the frame; the rest of the other
    states follows E_RR + E_Rs l, which has no eigenvalue 0.
    """
    rest = np.flatnonzero(np.arange(len(found["states"])) != ref)
    (inner, from_s, into_s), (dinner, dfrom, dinto) = (
        (part[..., rest[:, None], rest], part[..., rest, ref : ref + 1], part[..., ref : ref + 1, :][..., rest])
        for part in (found["rows"], found["drows"])
    )
    inverse = _inverse(inner)
    along = into_s @ inverse
    along = along + (into_s - along @ inner) @ inverse
    left = ROUNDING * (np.abs(into_s) + np.abs(along) @ np.abs(inner))
    dalong = (dinto + np.abs(along) @ dinner + left) @ np.abs(inverse)
    moved = inner + from_s @ along
    dmoved = dinner + dfrom @ np.abs(along) + np.abs(from_s) @ dalong + ROUNDING * (np.abs(from_s) @ np.abs(along))
    own = _inverse(moved)
    N = -own @ from_s
    N = N - own @ (from_s + moved @ N)
    dN = np.abs(own) @ (dfrom + dmoved @ np.abs(N) + ROUNDING * (np.abs(from_s) + np.abs(moved) @ np.abs(N)))
    n = len(fast.states)
    of_s, dof = (found[name][..., ref : ref + 1] for name in ("H", "dH"))
    H = found["H"][..., rest] + of_s @ along
    dH = found["dH"][..., rest] + dof @ np.abs(along) + np.abs(of_s) @ dalong
    return {
        "states": tuple(found["states"][i] for i in rest),
        "E": moved,
        "dE": dmoved,
        "rows": moved,
        "drows": dmoved,
        "H": H,
        "dH": dH,
        "latched": found["latched"][:, rest],
        "shift": N[..., 0],
        "dshift": dN[..., 0],
        "still_held": (H @ N + of_s)[..., 0],
        "law": -along[..., 0, :n],
        "dlaw": dalong[..., 0, :n],
    }


def _still(found, fast, outputs, hand):
    """Return the outputs in the state `shift`, which is at rest: nothing is displaced, and a shift of the scene is not felt."""
    n, p = len(fast.states), len(outputs)
    held = found.pop("still_held", None)
    if held is None:
        moved = dict(zip(found["states"], found["shift"], strict=True)).get(f"frame.{hand.position}", 0.0)
        return np.array([moved * (name == hand.position) for name in outputs])
    seen = fast.C[..., :p, :] @ found["shift"][..., :n, None] + fast.D[..., :p, 1:] @ held[..., None]
    return seen[..., 0] * [float(name != hand.displacement) for name in outputs]


def _inverse(A):
    return solve(A, np.broadcast_to(np.eye(A.shape[-1]), A.shape))
