"""A loop cut at one or two numbers of a wire that are scalar gains of its frame: the linear fractional transformation (LFT)
that the numbers close, as a wall's stiffness and damping do."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.loops.block import concatenated, frozen
from wavesweep.loops.multirate import MultirateLoop
from wavesweep.monodromy.circle import inverse
from wavesweep.monodromy.drift import TickDrift, counted_ticks
from wavesweep.monodromy.periodic import Ticks, ticks_of
from wavesweep.monodromy.product import blocks_of, product_with_errors
from wavesweep.monodromy.rounding import ALIKE, ENTRIES, ROUNDING

V, ADVANCE, OFFSET = 0, 1, 2  # rows of C and D
PARTS = ("E", "B", "C", "D")
ERRORS = ("dE", "dB", "dC", "dD")


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """Everything but the numbers, once a frame, in delta form (`w = z - 1`).

    E `(..., n, n)`, B `(..., n, 1)`, C `(..., 3, n)`, D `(..., 3, 1)`; the rows of C and D are V: the signal that the second
    number multiplies, G_v (of a wall the velocity); ADVANCE and OFFSET: the one that the first number multiplies is
    G_x = ADVANCE/w + OFFSET. dE, dB, dC, dD: bounds on the errors of their entries. integrates: whether there is an ADVANCE. It
    is the exact eigenvalue 1 of the cut loop, as of the position of the whole scene if no spring holds the hand. It is kept out
    of E, so it is never rounded. period: of the frame, s (a number or an array over the batch). states, unread: names of the
    states that are kept and left out. poles_at_one: how many eigenvalues of E are exactly 0 by its pattern, as that of a mass
    that nothing brakes. others: the diagonal blocks of the monodromy matrix less identity that the numbers do not act on, in
    the block-triangular form of its pattern.
    """

    E: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dE: np.ndarray
    dB: np.ndarray
    dC: np.ndarray
    dD: np.ndarray
    integrates: bool
    period: np.ndarray
    states: tuple[str, ...]
    unread: tuple[str, ...] = ()
    poles_at_one: int = 0
    others: tuple[np.ndarray, ...] = ()

    def __post_init__(self):
        for name in (*PARTS, *ERRORS, "period"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def order(self) -> int:
        """Number of states of the loop with the numbers in place."""
        return self.E.shape[-1] + self.integrates

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the leading axes."""
        return np.broadcast_shapes(*(getattr(self, name).shape[:-2] for name in PARTS))

    def at(self, index) -> "Cut":
        """Return the loops `index` (anything that indexes the leading axes) of the batch."""
        batch = self.batch

        def pick(array, tail):
            array = np.asarray(array)
            full = batch + array.shape[array.ndim - tail :]
            return (array if array.shape == full else np.broadcast_to(array, full))[index]

        parts = {name: pick(getattr(self, name), 2) for name in (*PARTS, *ERRORS)}
        return replace(self, **parts, period=pick(self.period, 0), others=tuple(pick(each, 2) for each in self.others))


def with_batch(cut: Cut, size: int) -> Cut:
    """The cut as a batch of `size` loops, all its parts over all of them; a single loop is repeated."""
    if cut.batch:
        return cut.at(slice(None))
    return cut.at(np.newaxis) if size == 1 else cut.at(np.newaxis).at(np.zeros(size, int))


def open_in(cut: Cut, along: str, fixed) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the loop with one number closed and the other open: (E, B, C, D) from the open part's product to its factor.

    along: the open number, "K_VE" or "B_VE"; fixed: value of the other one, an array that broadcasts with the batch.
    """
    at_rest = along == "B_VE"
    A, B, x, v = whole(cut)
    (closed, through), open_ = ((x, cut.D[..., OFFSET, 0]), v) if at_rest else ((v, cut.D[..., V, 0]), x)
    direct = (cut.D[..., V, 0] if at_rest else cut.D[..., OFFSET, 0])[..., None, None]
    left = (1 - fixed * through)[..., None, None]
    gain = fixed[..., None, None] / left
    return A + B * gain * closed, B / left, open_ + direct * gain * closed, direct / left


def whole(cut):
    """Return E and B with the integrator as the last state, and the rows of the two signals."""
    x, v = cut.C[..., OFFSET : OFFSET + 1, :], cut.C[..., V : V + 1, :]
    if not cut.integrates:
        return cut.E, cut.B, x, v
    one = np.ones((*cut.batch, 1, 1))
    A = np.concatenate([cut.E, cut.C[..., ADVANCE : ADVANCE + 1, :]], axis=-2)
    A = np.concatenate([A, np.zeros((*A.shape[:-1], 1))], axis=-1)
    B = np.concatenate([cut.B, cut.D[..., ADVANCE : ADVANCE + 1, :]], axis=-2)
    return A, B, np.concatenate([x + 0 * one, one], axis=-1), np.concatenate([v + 0 * one, 0 * one], axis=-1)


def errors_of_whole(cut: Cut):
    """Return bounds on the errors of the entries of `whole`."""
    dE, dB, dx, dv = whole(replace(cut, **dict(zip(PARTS, (cut.dE, cut.dB, cut.dC, cut.dD), strict=True))))
    return dE, dB, np.concatenate([dx[..., :-1], 0 * dx[..., -1:]], axis=-1) if cut.integrates else dx, dv


def close(cut: Cut, K, F) -> np.ndarray:
    """Return the monodromy matrix less identity of the loop with the numbers in place, `(..., order, order)`.

    K, F: values of the first and the second number, which broadcast with the batch. If K = 0, nothing reads the integrator; its
    eigenvalue 1 is a drift and is replaced by 0 (a delta of -1).
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # a frame that overflows is for the caller to see
        K, F = (np.asarray(each)[..., None, None] for each in (K, F))
        E, B, x, v = whole(cut)
        read = (K * x + F * v) / (1 - K * cut.D[..., OFFSET : OFFSET + 1, :] - F * cut.D[..., V : V + 1, :])
        A = E + B * read
        if cut.integrates:
            A[..., -1, -1] = np.where(K[..., 0, 0] == 0, -1.0, A[..., -1, -1])
    return A


def errors_of_closed(cut: Cut, K, F) -> np.ndarray:
    """Return bounds on the errors of the entries of `close`, `(..., order, order)`, to first order."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        K, F = (np.asarray(each, float)[..., None, None] for each in (K, F))
        through = np.abs(1 - K * cut.D[..., OFFSET : OFFSET + 1, :] - F * cut.D[..., V : V + 1, :])
        K, F = np.abs(K), np.abs(F)
        size = replace(cut, **{name: np.abs(getattr(cut, name)) for name in PARTS})
        (_, B, x, v), (dE, dB, dx, dv) = whole(size), errors_of_whole(cut)
        off = K * cut.dD[..., OFFSET : OFFSET + 1, :] + F * cut.dD[..., V : V + 1, :]
        read, unsure = (K * x + F * v) / through, (K * dx + F * dv) / through
        return dE + dB * read + B * (unsure + read * (off / through + ROUNDING))


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
