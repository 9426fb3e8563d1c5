"""The frame of a loop without a number that is one scalar gain of it, and the cut loop that it
makes."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine._loops.block import concatenated
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.batches import nonzero
from wavesweep.engine._monodromy.cut import ADVANCE, OFFSET, LinearFractional
from wavesweep.engine._monodromy.drift import ConstantModes, MarginalModes
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine._monodromy.product import blocks_of, product_with_errors
from wavesweep.engine._monodromy.unit_circle import inverse
from wavesweep.engine._state_space import StateSpace
from wavesweep.engine.doubles import CANCELLED_SUM, ENTRY_ROUNDING

# by which a matrix times its inverse may be off from 1, where there is an inverse
WORST_INVERSE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class OpenFrame:
    """The frame of a loop without a number that is one scalar gain of it, in delta form, from the
    tick in which it is read.

    ticks: of that frame, with the sizes of their terms. relative: which states are relative to
    which, see `relative_ticks`. E `(..., n, n)`; B `(..., n, 1)` of the number's product, and of a
    hand's force if there is one two columns more: of a force that is constant over the frame, and
    of one that grows by 1 with every tick from 0. C, D: rows of signals read and shown, in the
    first tick; columns of D as those of B. dE, dB, dC, dD: bounds on the errors of their entries.
    period: s.
    """

    ticks: Ticks
    relative: ConstantModes
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
    """Return the frame without a number k that is one scalar gain of it; None if it is not one.

    The loop is cut where `u = k y`, y being the signal that the number multiplies. The number is
    one scalar of the frame if u reaches the loop in a single tick of it, or if y changes in a
    single one and is held in between. From that tick on frame j is

        x[j+1] - x[j] = E x[j] + B u[j],   y[j] = C x[j] + D u[j],

    I + E being the product of the ticks' `I + E_i`. drawn: the loop whose last input `force` is u.
    drift: its drift with the signals watched. read: y, and perhaps the signal that another number
    of the same sum multiplies. hand: another input. shown: more signals, which need no state that
    would hold them. per_loop: see `product_with_errors`.
    """
    ticks = Ticks.of(drawn, (*read, *shown), held_ports=drawn.held(read), terms=True)
    product_input = drawn.inputs.index(force)
    begin = _only_tick(ticks, product_input, len(read))
    if begin is None:
        return None
    if ticks.states != drift.states:
        raise ValueError(
            f"the drift is that of other states: {drift.states}, expected {ticks.states}"
        )
    from_there = replace(ticks, kind=np.roll(ticks.kind, -begin))
    ticks, relative = drift.relative_ticks(from_there)
    inputs = [product_input]
    if hand:
        inputs.append(drawn.inputs.index(hand))
    changes = []
    sizes = []
    for block in ticks.maps:
        size_E, size_B, *_ = block.terms
        changes.append(concatenated((block.E, _with_ramp(block.B[..., inputs])), -1))
        sizes.append(concatenated((size_E, _with_ramp(size_B[..., inputs])), -1))
    EB, dEB = product_with_errors(ticks.kind, changes, sizes, ramp=bool(hand), per_loop=per_loop)
    n = len(ticks.states)
    first = ticks.maps[ticks.kind[0]]
    *_, size_C, size_D = first.terms
    return OpenFrame(
        ticks,
        relative,
        E=EB[..., :n],
        B=EB[..., n:],
        C=first.C,
        D=_with_ramp(first.D[..., inputs]),
        dE=dEB[..., :n],
        dB=dEB[..., n:],
        dC=ENTRY_ROUNDING * size_C,
        dD=ENTRY_ROUNDING * _with_ramp(size_D[..., inputs]),
        period=np.asarray(drawn.period) * drawn.ticks,
    )


def _only_tick(ticks: Ticks, product_input: int, read: int) -> int | None:
    """The tick in which the frame begins: the only one in which the product reaches the loop, or
    else the only one in which what is read changes; None if there are several.

    product_input: index of the product among the inputs. read: number of signals that are read.
    """
    is_reached = []
    for block in ticks.maps:
        reaches_states = np.any(block.B[..., product_input])
        is_reached.append(reaches_states or np.any(block.D[..., :read, product_input]))
    candidates = np.flatnonzero(np.array(is_reached)[ticks.kind])
    if candidates.size > 1:
        changing = np.array(_changing(ticks, read), int)
        candidates = np.flatnonzero(np.isin(ticks.kind, changing))
    return int(candidates[0]) if candidates.size == 1 else None


def _changing(ticks: Ticks, read: int) -> list[int]:
    """The kinds of tick in which the first signals change, if they are states that all others
    hold; otherwise none."""
    rows = [(block.C[..., :read, :], block.D[..., :read, :]) for block in ticks.maps]
    for shown, direct in rows:
        if np.any(direct):
            continue
        changing = []
        follows = True
        for kind, block in enumerate(ticks.maps):
            C, D = rows[kind]
            size = np.abs(shown)
            step = shown @ block.E
            follows &= _alike(shown + step, C, size + size @ np.abs(block.E))
            follows &= _alike(shown @ block.B, D, size @ np.abs(block.B))
            if np.any(step) or np.any(D):
                changing.append(kind)
        if follows:
            return changing
    return []


def _alike(a: np.ndarray, b: np.ndarray, size: np.ndarray) -> bool:
    """Whether sums of the same terms in another order are equal but for rounding, in all loops;
    size: of their terms."""
    return bool((np.abs(a - b) <= CANCELLED_SUM * size).all())


def _with_ramp(columns: np.ndarray) -> np.ndarray:
    """Columns of the number's product and perhaps of a hand's constant force, and then a third for
    a force that grows from 0, and so does nothing in a first tick."""
    return np.concatenate([columns, np.zeros_like(columns[..., 1:])], axis=-1)


@np.errstate(over="ignore", invalid="ignore")  # a frame that overflows is for the caller to see
def cut_of(
    frame: OpenFrame, drift: MarginalModes, read: int = 1, *, conserved: bool = False
) -> LinearFractional | None:
    """Return the loop cut at the numbers of such a frame; None if its drift cannot be represented
    in a cut.

    drift: that of the open loop. read: 2 if another number multiplies the second signal in the same
    sum. conserved: whether the integrator that the number reads remains in the closed loop: then a
    combination of states, which no number changes, takes its place.
    """
    leads = drift.leads
    share = frame.C[..., 0, leads]
    moving = [at for at in range(len(leads)) if np.any(share[..., at])]
    second_drifts = np.any(frame.C[..., 1:read, leads])
    if drift.varying or len(moving) > 1 or second_drifts:
        return None
    remaining = drift.remaining
    system = StateSpace(frame.E, frame.B[..., :1], frame.C[..., :read, :], frame.D[..., :read, :1])
    errors = StateSpace(
        frame.dE, frame.dB[..., :1], frame.dC[..., :read, :], frame.dD[..., :read, :1]
    )
    if moving:
        lead = leads[moving[0]]
        factor = share[..., moving[0], None, None]
        system = _with_rows_of_number(system, remaining, lead, factor)
        errors = _with_rows_of_number(errors, remaining, lead, np.abs(factor))
    else:
        system = _with_rows_of_number(system, remaining)
        errors = _with_rows_of_number(errors, remaining)
    names = tuple(drift.states[i] for i in remaining)
    cut = LinearFractional(*system, *errors, bool(moving), frame.period, names)
    if conserved and moving:
        followed = _without_integrator(cut)
        return followed and _acted_on(followed)
    return _acted_on(cut)


def _with_rows_of_number(
    system: StateSpace, states: list[int], lead: int | None = None, factor: np.ndarray | None = None
) -> StateSpace:
    """Return a system of the states x that remain, with the rows that a number reads.

    The first signal is `factor x_l + c x + d u`, of which x_l is the state `lead` that drifts, or
    None; it is read as its change over a frame and as what is left, the second signal as it is:

        VELOCITY  c_2 x + d_2 u,   ADVANCE  factor (E_l x + B_l u),   OFFSET  c x + d u.
    """
    E, B, C, D = system
    offset = C[..., :1, states]
    offset_direct = D[..., :1, :]
    if lead is None:
        advance = 0 * offset
        advance_direct = 0 * offset_direct
    else:
        advance = factor * E[..., [lead], :][..., states]
        advance_direct = factor * B[..., [lead], :]
    if C.shape[-2] > 1:
        velocity = C[..., 1:, states]
        velocity_direct = D[..., 1:, :]
    else:
        velocity = 0 * offset
        velocity_direct = 0 * offset_direct
    rows = np.concatenate(np.broadcast_arrays(velocity, advance, offset), axis=-2)
    direct = [velocity_direct, advance_direct, offset_direct]
    columns = np.concatenate(np.broadcast_arrays(*direct), axis=-2)
    return StateSpace(E[..., states, :][..., states], B[..., states, :], rows, columns)


def _without_integrator(cut: LinearFractional) -> LinearFractional | None:
    """The loop whose integrator s follows the other states, since `s - l x` is conserved, with `l =
    ADVANCE E^-1`.

    None if E has no inverse: then another state or sum of states is conserved too, and which of
    them is left to the closed loop depends on the number.
    """
    back = inverse(cut.E)
    missed = np.abs(back @ cut.E - np.eye(cut.E.shape[-1]))
    if not (missed <= WORST_INVERSE).all():
        return None
    l = cut.C[..., ADVANCE : ADVANCE + 1, :] @ back
    unsure = (cut.dC[..., ADVANCE : ADVANCE + 1, :] + np.abs(l) @ cut.dE) @ np.abs(back)
    of_all_loops = (*cut.batch, *cut.C.shape[-2:])
    C = np.broadcast_to(cut.C, of_all_loops).copy()
    dC = np.broadcast_to(cut.dC, of_all_loops).copy()
    D = cut.D.copy()
    dD = cut.dD.copy()
    C[..., OFFSET, :] += l[..., 0, :]
    dC[..., OFFSET, :] += unsure[..., 0, :]
    for matrix in (C, D, dC, dD):
        matrix[..., ADVANCE, :] = 0.0
    return replace(cut, C=C, D=D, dC=dC, dD=dD, integrates=False)


def _acted_on(cut: LinearFractional) -> LinearFractional | None:
    """Return the loop with the states that the numbers act on, by the triangular form of its
    pattern; None if it has none."""
    n = cut.E.shape[-1]
    acts = nonzero(cut.E)
    pattern = np.zeros((n + 1, n + 1), bool)
    pattern[:n, :n] = acts
    pattern[:n, n] = nonzero(cut.B)[:, 0]
    pattern[n, :n] = nonzero(cut.C).any(0)
    states = np.zeros(0, int)
    uncontrolled = []
    for block in blocks_of(pattern):
        if n in block:
            states = block[block < n]
            continue
        E = cut.E[..., block[:, None], block]
        set_anew_in_every_frame = block.size == 1 and np.all(E == -1)
        if not set_anew_in_every_frame:
            uncontrolled.append(E)
    if not states.size:
        return None
    column = states[:, None]
    # Eigenvalues are 0 in every loop because of where entries of E are not zero.
    acts = acts[column, states]
    poles_at_one = 0
    for block in blocks_of(acts):
        poles_at_one += block.size == 1 and not acts[block[0], block[0]]
    return replace(
        cut,
        E=cut.E[..., column, states],
        B=cut.B[..., states, :],
        C=cut.C[..., states],
        dE=cut.dE[..., column, states],
        dB=cut.dB[..., states, :],
        dC=cut.dC[..., states],
        states=tuple(cut.states[i] for i in states),
        poles_at_one=poles_at_one,
        uncontrolled=tuple(uncontrolled),
    )
