"""The frame of a loop without a number that is one scalar gain of it, and the cut loop that it makes."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.loops.block import concatenated
from wavesweep.engine.loops.multirate import MultirateLoop
from wavesweep.engine.monodromy.cut import ADVANCE, OFFSET, Cut
from wavesweep.engine.monodromy.drift import TickDrift, counted_ticks
from wavesweep.engine.monodromy.periodic import Ticks, ticks_of
from wavesweep.engine.monodromy.product import blocks_of, product_with_errors
from wavesweep.engine.monodromy.rounding import ALIKE, ENTRIES
from wavesweep.engine.monodromy.unit_circle import inverse


@dataclass(frozen=True, slots=True, eq=False)
class OpenFrame:
    """The frame of a loop without a number that is one scalar gain of it, in delta form, from the tick in which it is read.

    ticks: of that frame, with the sizes of their terms. counted: which states are counted from which, see `counted_ticks`.
    E `(..., n, n)`; B `(..., n, 1)` of the number's product, and of a hand's force if there is one two columns more: of a force
    that is constant over the frame, and of one that grows by 1 with every tick from 0. C, D: rows of signals read and shown,
    in the first tick; columns of D as those of B. dE, dB, dC, dD: bounds on the errors of their entries. period: s.
    """

    ticks: Ticks
    counted: tuple
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
    drift: TickDrift,
    force: str,
    read: tuple[str, ...],
    hand: str = "",
    shown: tuple[str, ...] = (),
    *,
    each: bool = False,
) -> OpenFrame | None:
    """Return the frame without a number that is one scalar gain of it; None if it is not one.

    drawn: the loop whose last input `force` is the number's product. drift: its drift with the signals watched. read: the
    signal that the number multiplies, and perhaps the one that another number of the same sum multiplies. The number is one
    scalar of the frame if the product reaches the loop in a single tick of a frame, or if what it multiplies changes in a
    single one and is held in between. hand: another input. shown: more signals, which need no state that would hold them.
    each: see `product_with_errors`.
    """
    ticks = ticks_of(drawn, (*read, *shown), held=drawn.held(read), terms=True)
    w = drawn.inputs.index(force)
    at = _only_tick(_showing(ticks, len(read)) if shown else ticks, w)
    if at is None:
        return None
    if ticks.states != drift.states:
        raise ValueError(f"the drift is that of other states: {drift.states}, expected {ticks.states}")
    ticks, groups = counted_ticks(ticks.from_tick(at), drift)
    inputs = [w, *([drawn.inputs.index(hand)] if hand else [])]
    head, n = ticks.maps[ticks.kind[0]], len(ticks.states)
    changes = [concatenated((each.E, _with_moment(each.B[..., inputs])), -1) for each in ticks.maps]
    sizes = [concatenated((each.terms[0], _with_moment(each.terms[1][..., inputs])), -1) for each in ticks.maps]
    E, dE = product_with_errors(ticks.kind, changes, sizes, ramp=bool(hand), each=each)
    D, dD = (_with_moment(each[..., inputs]) for each in (head.D, head.terms[3]))
    parts = E[..., :n], E[..., n:], head.C, D, dE[..., :n], dE[..., n:], ENTRIES * head.terms[2], ENTRIES * dD
    return OpenFrame(ticks, groups, *parts, np.asarray(drawn.period) * drawn.ticks)


def _showing(ticks, count):
    """The ticks with their first signals alone."""
    parts = ({"outputs": each.outputs[:count], "C": each.C[..., :count, :], "D": each.D[..., :count, :]} for each in ticks.maps)
    return replace(ticks, maps=tuple(replace(each, **part) for each, part in zip(ticks.maps, parts, strict=True)))


def _only_tick(ticks, w):
    """The tick in which the frame begins, the only one in which the input reaches the loop or changes; None if none."""
    reached = [np.any(each.B[..., w]) or np.any(each.D[..., w]) for each in ticks.maps]
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
        held = [shown @ each.E for each in ticks.maps]
        follows = [
            _alike(shown + step, each.C, np.abs(shown) + np.abs(shown) @ np.abs(each.E))
            and _alike(shown @ each.B, each.D, np.abs(shown) @ np.abs(each.B))
            for step, each in zip(held, ticks.maps, strict=True)
        ]
        if not np.any(still.D) and all(follows):
            return [kind for kind, step in enumerate(held) if np.any(step) or np.any(ticks.maps[kind].D)]
    return []


def _alike(one, other, size):
    """Whether sums of the same terms in another order are equal but for rounding, in all loops; size: of their terms."""
    return bool((np.abs(one - other) <= ALIKE * size).all())


def _with_moment(columns):
    """Columns of the number's product and perhaps of a hand's force, and then a third for one that is 0 in the first tick."""
    return np.concatenate([columns, np.zeros_like(columns[..., 1:])], axis=-1)


@np.errstate(over="ignore", invalid="ignore")  # a frame that overflows is for the caller to see
def cut_of(frame: OpenFrame, drift: TickDrift, read: int = 1, *, conserved: bool = False) -> Cut | None:
    """Return the loop cut at the numbers of such a frame; None if its drift cannot be represented in a cut.

    drift: that of the open loop. read: 2 if another number multiplies the second signal in the same sum. conserved: whether the
    integrator that the number reads remains in the closed loop: then a combination of states, which no number changes, takes
    its place.
    """
    c, d, dc, dd = (part[..., :read, :] for part in (frame.C, frame.D[..., :1], frame.dC, frame.dD[..., :1]))
    leads = [lead for lead, _ in drift.moved]
    if drift.folded or (read > 1 and np.any(c[..., 1:, leads])):
        return None
    share = c[..., 0, leads]
    seen = [at for at in range(len(leads)) if np.any(share[..., at])]
    if len(seen) > 1:
        return None
    E, B, dE, dB = frame.E, frame.B[..., :1], frame.dE, frame.dB[..., :1]
    kept = [i for i in range(len(drift.states)) if i not in leads and i not in drift.unread]
    rows = [(0 * part[..., :1, kept], 0 * whole[..., :1, :]) for part, whole in ((c, d), (dc, dd))]
    if seen:
        lead, factor = leads[seen[0]], share[..., seen[0], None, None]
        rows = [(factor * E[..., [lead], :][..., kept], factor * B[..., [lead], :])]
        rows.append((np.abs(factor) * dE[..., [lead], :][..., kept], np.abs(factor) * dB[..., [lead], :]))
    parts = []
    for (advance, step), (C, D) in zip(rows, ((c, d), (dc, dd)), strict=True):
        v, dv = (C[..., 1:, kept], D[..., 1:, :]) if read > 1 else (0 * C[..., kept], 0 * D)
        parts.append(_stacked((v, advance, C[..., :1, kept]), (dv, step, D[..., :1, :])))
    (C, D), (dC, dD) = parts
    E, dE = (part[..., kept, :][..., kept] for part in (E, dE))
    B, dB = B[..., kept, :], dB[..., kept, :]
    names = tuple(drift.states[i] for i in kept)
    cut = Cut(E, B, C, D, dE, dB, dC, dD, bool(seen), frame.period, names)
    if conserved and seen:
        cut = _without_integrator(cut)
    left = tuple(drift.states[i] for i in range(len(drift.states)) if i not in kept)
    return _acted_on(cut, left)


def _stacked(rows, columns):
    return tuple(np.concatenate(np.broadcast_arrays(*part), axis=-2) for part in (rows, columns))


def _without_integrator(cut):
    """The loop whose integrator s follows the other states, since `s - l x` is conserved, with `l = ADVANCE E^-1`."""
    back = inverse(cut.E)
    l = cut.C[..., ADVANCE : ADVANCE + 1, :] @ back
    unsure = (cut.dC[..., ADVANCE : ADVANCE + 1, :] + np.abs(l) @ cut.dE) @ np.abs(back)
    C, D, dC, dD = (part.copy() for part in (cut.C, cut.D, cut.dC, cut.dD))
    C, dC = np.broadcast_to(C, (*cut.batch, *C.shape[-2:])).copy(), np.broadcast_to(dC, (*cut.batch, *dC.shape[-2:])).copy()
    C[..., OFFSET, :] += l[..., 0, :]
    dC[..., OFFSET, :] += unsure[..., 0, :]
    for part in (C, D, dC, dD):
        part[..., ADVANCE, :] = 0.0
    return replace(cut, C=C, D=D, dC=dC, dD=dD, integrates=False)


def _acted_on(cut: Cut, left: tuple[str, ...]) -> Cut | None:
    """Return the part of the loop that the numbers close, by the triangular form of its pattern; None if it has no state."""
    n = cut.E.shape[-1]
    acts, given, shown = (np.any(part != 0, axis=tuple(range(part.ndim - 2))) for part in (cut.E, cut.B, cut.C))
    whole = np.zeros((n + 1, n + 1), bool)
    whole[:n, :n], whole[:n, n], whole[n, :n] = acts, given[:, 0], shown.any(0)
    kept, others = None, []
    for block in blocks_of(whole):
        if n in block:
            kept = block[block < n]
        elif not (block.size == 1 and np.all(cut.E[..., block[0], block[0]] == -1)):  # set anew in every frame
            others.append(cut.E[..., block[:, None], block])
    if kept is None or not kept.size:
        return None
    at = np.ix_(kept, kept)
    parts = {"E": cut.E[..., *at], "dE": cut.dE[..., *at], "B": cut.B[..., kept, :], "dB": cut.dB[..., kept, :]}
    parts |= {"C": cut.C[..., kept], "dC": cut.dC[..., kept]}
    names = tuple(cut.states[i] for i in kept)
    gone = (*left, *(name for name in cut.states if name not in names))
    return replace(cut, **parts, states=names, unread=gone, others=tuple(others), poles_at_one=_poles_at_one(parts["E"]))


def _poles_at_one(E):
    """How many eigenvalues of E are 0 in every loop because of where its entries are not zero."""
    acts = np.any(E != 0, axis=tuple(range(E.ndim - 2)))
    return sum(block.size == 1 and not acts[block[0], block[0]] for block in blocks_of(acts))
