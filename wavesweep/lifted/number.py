"""A drawn loop cut at a number that is one scalar gain of its frame."""

from dataclasses import replace
from functools import reduce

import numpy as np

from wavesweep.diagram.drawn import Drawn
from wavesweep.diagram.elimination import ROUNDING
from wavesweep.lifted.cut import Cut
from wavesweep.lifted.periodic import STILL, grown, growth_over, in_a_row, then, ticks_of
from wavesweep.lifted.tick_drift import TickDrift, consistent_solution

LEFT = 1e-10  # of the largest entry of a row, what rounding over a frame may leave of the change along a state that rests


def cut_at_number(drawn: Drawn, drift: TickDrift, force: str, read: str, damped: str = "") -> Cut | None:
    """Cut the loop at a number that is one scalar gain of a frame; None if it is not one.

    drawn: the loop whose last input `force` is the number's product; the number would multiply the signal `read`. damped: a
    second signal, which another number multiplies in the same sum: the velocity that a wall's damper reads. drift: that of this
    open loop, with these signals watched. The number is one scalar of the frame if the product reaches the loop in a single
    tick of a frame, or if `read` changes in a single one and is held in between. Closing it is `force = p read`: the wall of a
    built-in loop under another name.
    """
    ticks = ticks_of(drawn, (read, *((damped,) if damped else ())))
    if ticks.states != drift.states:
        raise ValueError(f"the drift is that of other states: {drift.states}, expected {ticks.states}")
    at = _only_tick(ticks, drawn.inputs.index(force))
    if at is None or drift.folded:
        return None
    first, whole_frame = at
    ticks = ticks.from_tick(first)
    w = drawn.inputs.index(force)
    E, B, growth = _with_input(ticks, w, whole_frame)
    head = ticks.maps[ticks.kind[0]]
    c, d = head.C, head.D[..., w : w + 1]
    if damped and np.any(_shown_of_leads(c[..., 1:, :], drift)):
        return None
    cut = _cut(E, B, c, d, drift, np.asarray(drawn.period) * drawn.ticks, head.condition)
    # Without states there is no mode that could cross: only the solution of the loop of direct terms decides.
    return replace(cut, growth=growth) if cut is not None and cut.order else None


def _only_tick(ticks, w):
    """Return the tick in which the frame begins for this input, and whether it is held over the frame; None if none."""
    reached = [np.any(each.B[..., w]) or np.any(each.D[..., w]) for each in ticks.maps]
    where = np.flatnonzero(np.array(reached)[ticks.kind])
    if where.size == 0:
        return None
    if where.size == 1:
        return int(where[0]), False
    changes = _changing(ticks)
    where = np.flatnonzero(np.isin(ticks.kind, changes)) if changes else np.zeros(0)
    return (int(where[0]), True) if where.size == 1 else None


def _changing(ticks):
    """Return the kinds of tick in which the output changes, if it is a state that is held in all others; otherwise none."""
    for still in ticks.maps:
        shown = still.C
        held = [shown @ each.E for each in ticks.maps]
        follows = [
            np.array_equal(*np.broadcast_arrays(shown + step, each.C))
            and np.array_equal(*np.broadcast_arrays(shown @ each.B, each.D))
            for step, each in zip(held, ticks.maps, strict=True)
        ]
        if not np.any(still.D) and all(follows):
            return [kind for kind, step in enumerate(held) if np.any(step) or np.any(ticks.maps[kind].D)]
    return []


def _with_input(ticks, w, held):
    """Return the frame with the input of its first tick, or with the same input in all of its ticks, and its growth."""
    kinds = ticks.kind.tolist()
    driven = [(each.E, each.B[..., w : w + 1], STILL) for each in ticks.maps]
    silent = [(E, 0 * B, STILL) for E, B, _ in driven]

    def joined(first, second):
        (E, B, _), (later, more, _) = first, second
        both = then(E, later)
        return both, B + later @ B + more, grown(first, second, both)

    with np.errstate(all="ignore"):
        if held:
            E, B, found = in_a_row(kinds, driven, joined)
        else:
            rest = [in_a_row(kinds[1:], silent, joined)] if len(kinds) > 1 else []
            E, B, found = reduce(joined, rest, driven[kinds[0]])
        return E, B, growth_over(E, found)


def _cut(E, B, c, d, drift, period, condition):
    leads = {lead: dict(others) for lead, others in drift.moved}
    E, B = E.copy(), B.copy()
    for lead, others in leads.items():
        for index, factor in others.items():
            E[..., index, :] -= factor * E[..., lead, :]
            B[..., index, :] -= factor * B[..., lead, :]
    share = dict(zip(leads, np.moveaxis(_shown_of_leads(c[..., :1, :], drift), -1, 0), strict=True))
    read = [lead for lead, value in share.items() if np.any(value)]
    if len(read) > 1:
        return None
    kept = [i for i in range(len(drift.states)) if i not in leads]
    advance, step = np.zeros((1, len(kept))), np.zeros((1, 1))
    if read:
        advance, step = (
            share[read[0]][..., None] * part for part in (E[..., read[0] : read[0] + 1, kept], B[..., read[0] : read[0] + 1, :])
        )
    integrates = bool(read)
    E, B, c = E[..., kept, :][..., kept], B[..., kept, :], c[..., kept]
    v, dv = (c[..., 1:, :], d[..., 1:, :]) if c.shape[-2] > 1 else (0 * c, 0 * d)
    C = np.concatenate(np.broadcast_arrays(v, advance, c[..., :1, :]), axis=-2)
    D = np.concatenate(np.broadcast_arrays(dv, step, d[..., :1, :]), axis=-2)
    read = _read_after(E, C)
    left = (*leads, *(kept[i] for i in range(len(kept)) if i not in read))
    E, B, C, kept = E[..., read, :][..., read], B[..., read, :], C[..., read], [kept[i] for i in read]
    if drift.ramp in kept:
        E, B, C = _counted_from(kept.index(drift.ramp), E, B, C)
    names, left = (tuple(drift.states[i] for i in some) for some in (kept, left))
    return Cut(E, B, C, D, integrates, period=period, states=names, unread=left, condition=condition)


def _counted_from(ramp, E, B, C):
    """Return the loop with the other states counted from one that may rest anywhere, whose column of E is then exactly 0.

    A loop in which that state may not rest anywhere, by more than rounding leaves, stays as it is.
    """
    others = [i for i in range(E.shape[-1]) if i != ramp]
    column = E[..., ramp]
    V = consistent_solution(E[..., others], -column[..., None])[..., 0]
    left = np.abs(column + (E[..., others] * V[..., None, :]).sum(-1))
    size = np.abs(E).max(-1) * np.maximum(np.abs(V).max(-1, initial=0.0), 1.0)[..., None]
    rests = (left <= LEFT * size).all(-1, keepdims=True)
    V = np.where(rests, V, 0.0)
    E, B, C = (part.copy() for part in (E, B, C))
    E[..., ramp] = np.where(rests, 0.0, column)
    E[..., others, :] -= V[..., None] * E[..., ramp : ramp + 1, :]
    B[..., others, :] = B[..., others, :] - V[..., None] * B[..., ramp : ramp + 1, :]
    shown = C[..., ramp] + (C[..., others] * V[..., None, :]).sum(-1)
    C = np.array(np.broadcast_to(C, (*shown.shape, C.shape[-1])))
    C[..., ramp] = shown
    return E, B, C


def _shown_of_leads(c, drift):
    """The displacements of outputs along each shift, `(..., rows, shifts)`; 0 if the terms cancel to rounding."""
    parts = []
    for lead, others in drift.moved:
        terms = np.stack([c[..., lead], *(factor * c[..., index] for index, factor in others)], axis=-1)
        total = terms.sum(-1)
        parts.append(np.where(np.abs(total) <= ROUNDING * np.abs(terms).sum(-1), 0.0, total))
    return np.stack(parts, axis=-1) if parts else np.zeros((*c.shape[:-1], 0))


def _read_after(E, C):
    """Return the indices of the states without some that nothing reads.

    A state that nothing reads is left out if every frame overwrites it, like a held output, or if it only adds up others, and
    drifts.
    """
    moves, shown = (np.any(part != 0, axis=tuple(range(part.ndim - 2))) for part in (E, C))
    own = E.diagonal(axis1=-2, axis2=-1)
    plain = np.logical_or(*((own == still).all(axis=tuple(range(own.ndim - 1))) for still in (-1, 0)))
    kept = list(range(len(plain)))
    while idle := [i for i in kept if plain[i] and not shown[:, i].any() and not any(moves[j, i] for j in kept if j != i)]:
        kept = [i for i in kept if i not in idle]
    return kept
