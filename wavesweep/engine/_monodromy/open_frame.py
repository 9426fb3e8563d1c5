"""The frame of a loop without a number that is one scalar gain of it, and the cut loop that it makes."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine._loops.block import concatenated
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.cut import ADVANCE, OFFSET, LinearFractional
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine._monodromy.product import blocks_of, product_with_errors
from wavesweep.engine._monodromy.rounding import ALIKE, ENTRIES
from wavesweep.engine._monodromy.unit_circle import inverse
from wavesweep.engine._state_space import StateSpace


@dataclass(frozen=True, slots=True, eq=False)
class OpenFrame:
    """The frame of a loop without a number that is one scalar gain of it, in delta form, from the tick in which it is read.

    ticks: of that frame, with the sizes of their terms. relative: which states are relative to which, see `relative_ticks`.
    E `(..., n, n)`; B `(..., n, 1)` of the number's product, and of a hand's force if there is one two columns more: of a force
    that is constant over the frame, and of one that grows by 1 with every tick from 0. C, D: rows of signals read and shown,
    in the first tick; columns of D as those of B. dE, dB, dC, dD: bounds on the errors of their entries. period: s.
    """

    ticks: Ticks
    relative: tuple
    E: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dE: np.ndarray
    dB: np.ndarray
    dC: np.ndarray
    dD: np.ndarray
    period: np.ndarray


def open_frame(
    drawn: MultirateLoop,
    drift: MarginalModes,
    force: str,
    read: tuple[str, ...],
    hand: str = "",
    shown: tuple[str, ...] = (),
    *,
    per_loop: bool = False,
) -> OpenFrame | None:
    """Return the frame without a number that is one scalar gain of it; None if it is not one.

    drawn: the loop whose last input `force` is the number's product. drift: its drift with the signals watched. read: the
    signal that the number multiplies, and perhaps the one that another number of the same sum multiplies. The number is one
    scalar of the frame if the product reaches the loop in a single tick of a frame, or if what it multiplies changes in a
    single one and is held in between. hand: another input. shown: more signals, which need no state that would hold them.
    per_loop: see `product_with_errors`.
    """
    ticks = Ticks.of(drawn, (*read, *shown), held=drawn.held(read), terms=True)
    w = drawn.inputs.index(force)
    at = _only_tick(_showing(ticks, len(read)) if shown else ticks, w)
    if at is None:
        return None
    if ticks.states != drift.states:
        raise ValueError(f"the drift is that of other states: {drift.states}, expected {ticks.states}")
    ticks, groups = drift.relative_ticks(replace(ticks, kind=np.roll(ticks.kind, -at)))  # the frame begins with that tick
    inputs = [w, *([drawn.inputs.index(hand)] if hand else [])]
    head, n = ticks.maps[ticks.kind[0]], len(ticks.states)
    changes = [concatenated((block.E, _with_moment(block.B[..., inputs])), -1) for block in ticks.maps]
    sizes = [concatenated((block.terms[0], _with_moment(block.terms[1][..., inputs])), -1) for block in ticks.maps]
    E, dE = product_with_errors(ticks.kind, changes, sizes, ramp=bool(hand), per_loop=per_loop)
    D, dD = _with_moment(head.D[..., inputs]), _with_moment(head.terms[3][..., inputs])
    system = StateSpace(E[..., :n], E[..., n:], head.C, D)
    errors = dE[..., :n], dE[..., n:], ENTRIES * head.terms[2], ENTRIES * dD
    return OpenFrame(ticks, groups, *system, *errors, np.asarray(drawn.period) * drawn.ticks)


def _showing(ticks, count):
    """The ticks with their first signals alone."""
    return replace(
        ticks,
        maps=tuple(
            replace(block, outputs=block.outputs[:count], C=block.C[..., :count, :], D=block.D[..., :count, :])
            for block in ticks.maps
        ),
    )


def _only_tick(ticks, w):
    """The tick in which the frame begins, the only one in which the input reaches the loop or changes; None if none."""
    reached = [np.any(block.B[..., w]) or np.any(block.D[..., w]) for block in ticks.maps]
    where = np.flatnonzero(np.array(reached)[ticks.kind])
    if where.size == 0:
        return None
    if where.size == 1:
        return int(where[0])
    changes = _changing(ticks)
    where = np.flatnonzero(np.isin(ticks.kind, changes)) if changes else np.zeros(0)
    return int(where[0]) if where.size == 1 else None


def _changing(ticks):
    """The kinds of tick in which the output changes, if it is a state that is held in all others; otherwise none."""
    for still in ticks.maps:
        shown = still.C
        held = [shown @ block.E for block in ticks.maps]
        follows = [
            _alike(shown + step, block.C, np.abs(shown) + np.abs(shown) @ np.abs(block.E))
            and _alike(shown @ block.B, block.D, np.abs(shown) @ np.abs(block.B))
            for step, block in zip(held, ticks.maps, strict=True)
        ]
        if not np.any(still.D) and all(follows):
            return [kind for kind, step in enumerate(held) if np.any(step) or np.any(ticks.maps[kind].D)]
    return []


def _alike(a, b, size):
    """Whether sums of the same terms in another order are equal but for rounding, in all loops; size: of their terms."""
    return bool((np.abs(a - b) <= ALIKE * size).all())


def _with_moment(columns):
    """Columns of the number's product and perhaps of a hand's force, and then a third for one that is 0 in the first tick."""
    return np.concatenate([columns, np.zeros_like(columns[..., 1:])], axis=-1)


@np.errstate(over="ignore", invalid="ignore")  # a frame that overflows is for the caller to see
def cut_of(frame: OpenFrame, drift: MarginalModes, read: int = 1, *, conserved: bool = False) -> LinearFractional | None:
    """Return the loop cut at the numbers of such a frame; None if its drift cannot be represented in a cut.

    drift: that of the open loop. read: 2 if another number multiplies the second signal in the same sum. conserved: whether the
    integrator that the number reads remains in the closed loop: then a combination of states, which no number changes, takes
    its place.
    """
    leads = drift.leads
    share = frame.C[..., 0, leads]
    moving = [at for at in range(len(leads)) if np.any(share[..., at])]
    if drift.varying or len(moving) > 1 or (read > 1 and np.any(frame.C[..., 1:read, leads])):
        return None
    remaining = [i for i in range(len(drift.states)) if i not in leads and i not in drift.unobserved]
    system = StateSpace(frame.E, frame.B[..., :1], frame.C[..., :read, :], frame.D[..., :read, :1])
    errors = StateSpace(frame.dE, frame.dB[..., :1], frame.dC[..., :read, :], frame.dD[..., :read, :1])
    lead, factor = (leads[moving[0]], share[..., moving[0], None, None]) if moving else (None, None)
    system = _with_rows(system, remaining, lead, factor)
    errors = _with_rows(errors, remaining, lead, factor if factor is None else np.abs(factor))
    names = tuple(drift.states[i] for i in remaining)
    cut = LinearFractional(*system, *errors, bool(moving), frame.period, names)
    if conserved and moving:
        cut = _without_integrator(cut)
    return _acted_on(cut)


def _with_rows(system, states, lead, factor):
    """Return a system with its remaining states, and the rows VELOCITY, ADVANCE and OFFSET; lead: the state that the first
    signal moves with, by the factor, or None."""
    E, B, C, D = system
    advance = 0 * C[..., :1, states] if lead is None else factor * E[..., [lead], :][..., states]
    step = 0 * D[..., :1, :] if lead is None else factor * B[..., [lead], :]
    v, dv = (C[..., 1:, states], D[..., 1:, :]) if C.shape[-2] > 1 else (0 * C[..., states], 0 * D)
    rows = np.concatenate(np.broadcast_arrays(v, advance, C[..., :1, states]), axis=-2)
    columns = np.concatenate(np.broadcast_arrays(dv, step, D[..., :1, :]), axis=-2)
    return StateSpace(E[..., states, :][..., states], B[..., states, :], rows, columns)


def _without_integrator(cut):
    """The loop whose integrator s follows the other states, since `s - l x` is conserved, with `l = ADVANCE E^-1`."""
    back = inverse(cut.E)
    l = cut.C[..., ADVANCE : ADVANCE + 1, :] @ back
    unsure = (cut.dC[..., ADVANCE : ADVANCE + 1, :] + np.abs(l) @ cut.dE) @ np.abs(back)
    C, dC = (np.broadcast_to(rows, (*cut.batch, *rows.shape[-2:])).copy() for rows in (cut.C, cut.dC))
    D, dD = cut.D.copy(), cut.dD.copy()
    C[..., OFFSET, :] += l[..., 0, :]
    dC[..., OFFSET, :] += unsure[..., 0, :]
    for matrix in (C, D, dC, dD):
        matrix[..., ADVANCE, :] = 0.0
    return replace(cut, C=C, D=D, dC=dC, dD=dD, integrates=False)


def _acted_on(cut: LinearFractional) -> LinearFractional | None:
    """Return the loop with the states that the numbers act on, by the triangular form of its pattern; None if it has none."""
    n = cut.E.shape[-1]
    acts, driven, shown = (np.any(matrix != 0, axis=tuple(range(matrix.ndim - 2))) for matrix in (cut.E, cut.B, cut.C))
    pattern = np.zeros((n + 1, n + 1), bool)
    pattern[:n, :n], pattern[:n, n], pattern[n, :n] = acts, driven[:, 0], shown.any(0)
    states, uncontrolled = np.zeros(0, int), []
    for block in blocks_of(pattern):
        if n in block:
            states = block[block < n]
        elif not (block.size == 1 and np.all(cut.E[..., block[0], block[0]] == -1)):  # set anew in every frame
            uncontrolled.append(cut.E[..., block[:, None], block])
    if not states.size:
        return None
    at = np.ix_(states, states)
    E, dE, B, dB = cut.E[..., *at], cut.dE[..., *at], cut.B[..., states, :], cut.dB[..., states, :]
    acts = acts[at]  # eigenvalues are 0 in every loop because of where entries of E are not zero
    poles_at_one = sum(block.size == 1 and not acts[block[0], block[0]] for block in blocks_of(acts))
    names = tuple(cut.states[i] for i in states)
    facts = {"states": names, "poles_at_one": poles_at_one, "uncontrolled": tuple(uncontrolled)}
    return replace(cut, E=E, dE=dE, B=B, dB=dB, C=cut.C[..., states], dC=cut.dC[..., states], **facts)
