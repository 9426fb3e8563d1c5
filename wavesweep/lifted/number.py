"""A drawn loop cut at a number that is one scalar gain of its frame."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.diagram.drawn import Drawn
from wavesweep.diagram.elimination import ROUNDING
from wavesweep.lifted.cut import Cut
from wavesweep.lifted.periodic import Ticks, ticks_of
from wavesweep.lifted.rounding import measured_frame, sizes_in_all
from wavesweep.lifted.tick_drift import TickDrift, counted_from_leads


@dataclass(frozen=True, slots=True, eq=False)
class OpenFrame:
    """The frame of a loop without a number that is one scalar gain of it, in delta form, from the tick in which it is read.

    ticks: of that frame, with the sizes of their terms. E `(..., n, n)`; B `(..., n, 1)` of the number's product, and of a
    hand's force if there is one two columns more: of a force that is constant over the frame, and of one that grows by 1 with
    every tick from 0. C, D: rows of the signals read and shown, in the first tick; columns of D as those of B. growth,
    cancellation: see `measured_frame`. period: s. inputs: those of the ticks that make the first columns of B.
    """

    ticks: Ticks
    E: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    growth: np.ndarray
    cancellation: np.ndarray
    period: np.ndarray
    inputs: tuple[int, ...]

    @property
    def condition(self):
        """That of the first tick, see `Block`."""
        return self.ticks.maps[self.ticks.kind[0]].condition

    def sizes(self) -> tuple[np.ndarray, ...]:
        """Sizes of the terms of the ticks' entries, in the form of E and B, of all ticks together, and of C and D."""
        count, head = self.ticks.kind.size, self.ticks.maps[self.ticks.kind[0]].terms
        E, B = sizes_in_all(self.ticks), sizes_in_all(self.ticks, 1)[..., self.inputs]
        return E, np.concatenate([B, count * B[..., 1:]], axis=-1), head[2], _with_moment(head[3][..., self.inputs])


def open_frame(
    drawn: Drawn, force: str, read: tuple[str, ...], hand: str = "", shown: tuple[str, ...] = ()
) -> OpenFrame | None:
    """Return the frame without a number that is one scalar gain of it; None if it is not one.

    drawn: the loop whose last input `force` is the number's product. read: the signal that the number multiplies, and others
    that are watched as closely, as the one is that another number of the same sum multiplies. The number is one scalar of the
    frame if the product reaches the loop in a single tick of a frame, or if what it multiplies changes in a single one and is
    held in between. hand: another input. shown: more signals, which need no state that would hold them.
    """
    ticks = ticks_of(drawn, (*read, *shown), held=drawn.held(read), terms=True)
    w = drawn.inputs.index(force)
    at = _only_tick(_showing(ticks, len(read)) if shown else ticks, w)
    if at is None:
        return None
    ticks = ticks.from_tick(at)
    inputs = [w, *([drawn.inputs.index(hand)] if hand else [])]
    head, n = ticks.maps[ticks.kind[0]], len(ticks.states)
    changes, links = [_beside(each.E, _with_moment(each.B[..., inputs])) for each in ticks.maps], np.zeros((n + 1, n + 1))
    links[n, :n] = np.abs(head.C[..., : len(read), :]).max((*range(head.C.ndim - 2), -2))
    E, growth, cancellation = measured_frame(ticks.kind, changes, links, ramp=bool(hand))
    parts = E[..., :n], E[..., n:], head.C, _with_moment(head.D[..., inputs])
    return OpenFrame(ticks, *parts, growth, cancellation, np.asarray(drawn.period) * drawn.ticks, tuple(inputs))


def cut_of(frame: OpenFrame, drift: TickDrift, read: int = 1) -> Cut | None:
    """Return the loop cut at the number of such a frame; None if its drift is none that a cut keeps.

    drift: that of the open loop, with its signals watched. read: 2 if another number multiplies the second signal in the same
    sum: the velocity that a wall's damper reads. Closing the cut is `force = p read`: the wall of a built-in loop under another
    name.
    """
    if frame.ticks.states != drift.states:
        raise ValueError(f"the drift is that of other states: {drift.states}, expected {frame.ticks.states}")
    c, d = frame.C[..., :read, :], frame.D[..., :read, :1]
    if drift.folded or (read > 1 and np.any(shown_of_leads(c[..., 1:, :], drift))):
        return None
    cut = _cut(frame, c, d, drift)
    # Without states beside what drifts, the loop of direct terms decides alone, or a polynomial of order 1.
    return replace(cut, growth=frame.growth) if cut is not None and cut.states else None


def _showing(ticks, count):
    """The ticks with their first signals alone."""
    parts = ({"outputs": each.outputs[:count], "C": each.C[..., :count, :], "D": each.D[..., :count, :]} for each in ticks.maps)
    return replace(ticks, maps=tuple(replace(each, **part) for each, part in zip(ticks.maps, parts, strict=True)))


def _only_tick(ticks, w):
    """Return the tick in which the frame begins, the only one in which the input reaches the loop or changes; None if none."""
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
    """Return the kinds of tick in which the output changes, if it is a state that is held in all others; otherwise none."""
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
    return bool((np.abs(one - other) <= ROUNDING * size).all())


def _beside(E, B):
    """Changes of states, and columns of inputs behind them."""
    batch = np.broadcast_shapes(E.shape[:-2], B.shape[:-2])
    return np.concatenate([np.broadcast_to(part, (*batch, *part.shape[-2:])) for part in (E, B)], axis=-1)


def _with_moment(columns):
    """Columns of the number's product and perhaps of a hand's force, and then a third for one that is 0 in the first tick."""
    return np.concatenate([columns, np.zeros_like(columns[..., 1:])], axis=-1)


def _cut(frame, c, d, drift):
    leads = [lead for lead, _ in drift.moved]
    E, B = counted_from_leads((frame.E, frame.B[..., :1]), drift)
    share = dict(zip(leads, np.moveaxis(shown_of_leads(c[..., :1, :], drift), -1, 0), strict=True))
    read = [lead for lead, value in share.items() if np.any(value)]
    if len(read) > 1:
        return None
    kept, plain = drift.kept, _plain(E, frame.ticks)
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
    read = _read_after(E, C, [at for at, state in enumerate(kept) if state in plain])
    idle = [i for i in range(len(kept)) if i not in read]
    if any(np.any(E[..., i, i] == 0) for i in idle):
        return None  # an eigenvalue 1 that is no drift, as the velocity of a free mass behind a coupling of gain 0
    left = (*leads, *drift.unread, *(kept[i] for i in idle))
    E, B, C, kept = E[..., read, :][..., read], B[..., read, :], C[..., read], [kept[i] for i in read]
    names, left = (tuple(drift.states[i] for i in some) for some in (kept, left))
    return Cut(E, B, C, D, integrates, period=frame.period, states=names, unread=left, condition=frame.condition)


def _plain(E, ticks):
    """States that every frame overwrites, like a held output, or that only add up others: their own change is -1 or 0.

    E: of the frame. In a frame alone -1 may also be a state that has died out.
    """
    set_anew = np.any([(_own(each.E) == -1).all(0) for each in ticks.maps], axis=0)
    return np.flatnonzero((_own(E) == 0).all(0) | ((_own(E) == -1).all(0) & set_anew))


def _own(E):
    """The changes of states by themselves, `(loops, n)`."""
    return E.diagonal(axis1=-2, axis2=-1).reshape(-1, E.shape[-1])


def shown_of_leads(c, drift, size: bool = False):
    """The displacements of outputs along each shift, `(..., rows, shifts)`; 0 if the terms cancel to rounding.

    size: whether c has sizes of terms; then these are added.
    """
    parts = []
    for lead, others in drift.moved:
        factors = [(index, abs(factor) if size else factor) for index, factor in others]
        terms = np.stack([c[..., lead], *(factor * c[..., index] for index, factor in factors)], axis=-1)
        total = terms.sum(-1)
        parts.append(np.where(np.abs(total) <= ROUNDING * np.abs(terms).sum(-1), 0.0, total))
    return np.stack(parts, axis=-1) if parts else np.zeros((*c.shape[:-1], 0))


def _read_after(E, C, plain):
    """Return the indices of the states without some that nothing reads; plain: those that may be left out."""
    moves, shown = (np.any(part != 0, axis=tuple(range(part.ndim - 2))) for part in (E, C))
    kept = list(range(E.shape[-1]))
    while idle := [i for i in kept if i in plain and not shown[:, i].any() and not any(moves[j, i] for j in kept if j != i)]:
        kept = [i for i in kept if i not in idle]
    return kept
