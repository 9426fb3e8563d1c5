"""The frame of a loop of several rates: its ticks one after the other, in delta form."""

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from wavesweep.diagram.block import Block
from wavesweep.diagram.drawn import Drawn, shifts
from wavesweep.lifted.connect import connect
from wavesweep.lifted.cut import Cut


@dataclass(frozen=True, slots=True, eq=False)
class Ticks:
    """Every kind of tick of a drawn loop.

    maps: a block per kind, all with the same states, from the inputs to the outputs. kind: of each tick of the frame, `(M,)`.
    """

    maps: tuple[Block, ...]
    kind: np.ndarray

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.maps[0].states

    def from_tick(self, first: int) -> "Ticks":
        """The frame that begins with that tick."""
        return replace(self, kind=np.roll(self.kind, -first))


def ticks_of(drawn: Drawn, outputs=()) -> Ticks:
    """Connect the blocks that run in each tick; outputs: signals that are wanted in every tick.

    Errors: IllPosedLoopError for an algebraic loop without a solution.
    """
    sets, kind = drawn.schedule()
    held = drawn.held(outputs)
    return Ticks(tuple(_connected(drawn, set(running), held, outputs) for running in sets), kind)


def _connected(drawn, running, held, outputs):
    blocks = [_in_tick(each.block, index in running, held[each.block.name]) for index, each in enumerate(drawn.placed)]
    unfed = {f"{block.name}.{port}": {} for block in blocks for port in block.inputs}
    return connect("tick", blocks, unfed | dict(drawn.sums), drawn.inputs, tuple(outputs))


def _in_tick(block, runs, held):
    """The block with states for the outputs that it holds; if it does not run, nothing changes and these are shown."""
    if not held:
        return block if runs else replace(block, E=0 * block.E, B=0 * block.B, C=0 * block.C, D=0 * block.D)
    n, h, rows = len(block.states), len(held), [block.outputs.index(port) for port in held]
    batch, kind = block.batch, np.result_type(block.E, block.B, block.C, block.D)
    E, B = np.zeros((*batch, n + h, n + h), kind), np.zeros((*batch, n + h, len(block.inputs)), kind)
    C, D = np.zeros((*batch, len(block.outputs), n + h), kind), np.zeros((*batch, len(block.outputs), len(block.inputs)), kind)
    if runs:
        E[..., :n, :n], B[..., :n, :], C[..., :n], D[...] = block.E, block.B, block.C, block.D
        E[..., n:, :n], B[..., n:, :], E[..., n:, n:] = block.C[..., rows, :], block.D[..., rows, :], -np.eye(h)
    else:
        C[..., rows, n:] = np.eye(h)
    return replace(block, states=(*block.states, *(f"{port} held" for port in held)), E=E, B=B, C=C, D=D, labels=(), terms=None)


def frame_of(ticks: Ticks, skipped: int = 0) -> np.ndarray:
    """`(I + E)` of all ticks but the first `skipped` in a row, less the identity, `(..., n, n)`.

    Delta form keeps the digits of slow poles. Overflow gives infinities or NaN, silently.
    """
    n, kinds = len(ticks.states), ticks.kind[skipped:].tolist()
    if not kinds:
        return np.zeros((n, n))
    with np.errstate(over="ignore", invalid="ignore"):
        return in_a_row(kinds, [each.E for each in ticks.maps], then)


def in_a_row(kinds, maps, joined):
    """The maps of a sequence of kinds joined in a row; repeated stretches are joined once.

    joined(first, second): one map after the other.
    """
    pairs, rest = _plan(np.asarray(kinds, np.int64).tobytes())
    known = dict(enumerate(maps))
    for name, (first, second) in pairs:
        known[name] = joined(known[first], known[second])
    total = known[rest[0]]
    for name in rest[1:]:
        total = joined(total, known[name])
    return total


@lru_cache(maxsize=64)
def _plan(kinds: bytes):
    """Names for pairs of neighbours that occur more than once, and the sequence written with them.

    The most frequent pair is replaced again and again (N. J. Larsson, A. Moffat, Proc. IEEE 88, 2000); a run of equal ticks
    becomes its powers of two, and a pattern that recurs is joined once.
    """
    sequence = np.frombuffer(kinds, np.int64).tolist()
    pairs, name = [], 1 + max(sequence)
    while len(sequence) > 1:
        pair, count = _most_frequent(sequence)
        if count < 2:
            break
        sequence = _replaced(sequence, pair, name)
        pairs.append((name, pair))
        name += 1
    return tuple(pairs), tuple(sequence)


def _most_frequent(sequence):
    """The pair of neighbours that occurs most often without overlap, the first of these."""
    counts, last = {}, {}
    for at, pair in enumerate(pairwise(sequence)):
        if last.get(pair) == at - 1 and pair[0] == pair[1]:
            last.pop(pair)
            continue
        last[pair] = at
        counts[pair] = counts.get(pair, 0) + 1
    pair = max(counts, key=counts.get)
    return pair, counts[pair]


def _replaced(sequence, pair, name):
    found, at = [], 0
    while at < len(sequence):
        if at + 1 < len(sequence) and (sequence[at], sequence[at + 1]) == pair:
            found.append(name)
            at += 2
        else:
            found.append(sequence[at])
            at += 1
    return found


def then(first, second):
    """`(I + second)(I + first) - I`; a state that either forgets is forgotten exactly, where a sum would leave a rounding."""
    E = first + second + second @ first
    columns, rows = _forgotten(first), _forgotten(np.swapaxes(second, -1, -2))
    E[..., columns], E[..., rows, :] = -np.eye(E.shape[-1])[:, columns], -np.eye(E.shape[-1])[rows]
    return E


def _forgotten(E):
    """Indices of the columns of `I + E` that are zero in all matrices."""
    less, one = -np.eye(E.shape[-1]), E[(0,) * (E.ndim - 2)]
    some = np.flatnonzero((one == less).all(0))
    return some[[bool((E[..., column] == less[column]).all()) for column in some]]


@dataclass(frozen=True, slots=True)
class Drift:
    """The drift of a drawn loop, by structure.

    states: those of the frame. moved: pairs of a lead and the states that move with it by constant factors, `(lead, ((state,
    factor), ...))`. folded: leads whose shift depends on the numbers of the loop. unread: states that nothing reads once the
    leads are gone, in the order of their removal. Names are indices into `states`.
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


def drift_of_drawn(tame: Drawn, other: Drawn, watched=()) -> Drift:
    """Find the drift in two drawings of the loop from different tame numbers; see `shifts`.

    watched: the outputs with which `ticks_of` will be called, since these decide which outputs are states that hold.

    A shift that is the same in both is constant. One that differs is folded away with numbers (see `without_drift`).
    """
    ticks = ticks_of(tame, watched)
    at, (first, second) = {name: i for i, name in enumerate(ticks.states)}, (shifts(tame), shifts(other))
    moved, folded = [], []
    for one, two in zip(first, second, strict=True):
        lead, *rest = one
        if one.keys() == two.keys() and all(abs(one[name] - two[name]) < SAME for name in one):
            moved.append((at[lead], tuple((at[name], one[name]) for name in rest if name in at)))
        else:
            folded.append(at[lead])
    drift = Drift(ticks.states, tuple(moved), tuple(folded), ())
    E, kept, unread = without_drift(frame_of(ticks), drift), drift.kept, []
    while True:
        idle = [i for i, index in enumerate(kept) if not np.any(E[..., i])]
        if not idle:
            return replace(drift, unread=tuple(unread))
        unread += [kept[i] for i in idle]
        kept = [index for i, index in enumerate(kept) if i not in idle]
        E = without_drift(frame_of(ticks), replace(drift, unread=tuple(unread)))


SAME = 1e-9  # difference of two factors of a shift, up to which it does not depend on the numbers


def without_drift(E: np.ndarray, drift: Drift) -> np.ndarray:
    """The frame's matrix less identity without its drift, `(..., k, k)`: its eigenvalues are the others.

    A lead moves others by constant factors: they are counted from it. A shift of other factors, which a left null vector
    `l E = 0` belongs to, is folded away: `l = E_sR E_RR^-1`, and what is left goes by `E_RR + E_Rs l`.
    """
    leads = [lead for lead, _ in drift.moved]
    if drift.moved:
        E = E.copy()
        for lead, others in drift.moved:
            for index, factor in others:
                E[..., index, :] -= factor * E[..., lead, :]
    index = [i for i in range(len(drift.states)) if i not in leads]
    E = E[..., index, :][..., index]
    for lead in drift.folded:
        s = index.index(lead)
        rest = [i for i in range(len(index)) if i != s]
        inner, into, out = E[..., rest, :][..., rest], E[..., s, rest], E[..., rest, s]
        try:
            along = np.linalg.solve(np.swapaxes(inner, -1, -2), into[..., None])[..., 0]
        except np.linalg.LinAlgError:
            along = np.full(into.shape, np.nan)
        E, index = inner + out[..., :, None] * along[..., None, :], [index[i] for i in rest]
    kept = [i for i, name in enumerate(index) if name not in drift.unread]
    return E[..., kept, :][..., kept]


def closed_frame(drawn: Drawn, drift: Drift) -> np.ndarray:
    """The frame-to-frame matrix less identity, without drift, `(..., k, k)`; loops of less than two states are filled up with
    eigenvalues at 0 of the frame."""
    E = without_drift(frame_of(ticks_of(drawn)), drift)
    missing = 2 - E.shape[-1]
    if missing <= 0:
        return E
    whole = np.zeros((*E.shape[:-2], 2, 2), E.dtype)
    whole[..., : E.shape[-1], : E.shape[-1]] = E
    for i in range(E.shape[-1], 2):
        whole[..., i, i] = -1.0
    return whole


def cut_at_number(drawn: Drawn, drift: Drift, force: str, read: str, damped: str = "") -> Cut | None:
    """Cut the loop at a number that is one scalar gain of a frame; None if it is not one.

    drawn: the loop in which the number's product is the input `force`, its last one, and the number would multiply the signal
    `read`. damped: a second signal, which another number multiplies in the same sum: the velocity that a wall's damper reads.
    drift: that of this open loop, with these signals watched.
    The number is one scalar of the frame if the product reaches the loop in a single tick of a frame, or if `read` changes in a
    single one and is held in between. Closing it is `force = p read`: the wall of a built-in loop under another name.
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
    E, B = _with_input(ticks, w, whole_frame)
    head = ticks.maps[ticks.kind[0]]
    c, d = head.C, head.D[..., w : w + 1]
    if damped and np.any(_shown_of_leads(c[..., 1:, :], drift)):
        return None
    return _cut(E, B, c, d, drift, np.asarray(drawn.period) * drawn.ticks, head.condition)


def _only_tick(ticks, w):
    """The tick in which the frame begins for this input, and whether the input is held over the frame; or None."""
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
    """The kinds of tick in which the output changes, if it is a state that is held in all others; else none."""
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
    """The frame with the input of its first tick, or with the same input in all of its ticks."""
    kinds = ticks.kind.tolist()
    pairs = [(each.E, each.B[..., w : w + 1]) for each in ticks.maps]
    silent = [(E, 0 * B) for E, B in pairs]

    def joined(first, second):
        return then(first[0], second[0]), first[1] + second[0] @ first[1] + second[1]

    with np.errstate(over="ignore", invalid="ignore"):
        if held:
            return in_a_row(kinds, pairs, joined)
        rest = in_a_row(kinds[1:], silent, joined) if len(kinds) > 1 else None
        return pairs[kinds[0]] if rest is None else joined(pairs[kinds[0]], rest)


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
    E, B, C, kept = E[..., read, :][..., read], B[..., read, :], C[..., read], [kept[i] for i in read]
    names = tuple(drift.states[i] for i in kept)
    left = tuple(drift.states[i] for i in leads)
    return Cut(E, B, C, D, integrates, period=period, states=names, unread=left, condition=condition)


def _shown_of_leads(c, drift):
    """What rows of outputs show of each shift, `(..., rows, shifts)`."""
    parts = [c[..., lead] + sum(factor * c[..., index] for index, factor in others) for lead, others in drift.moved]
    return np.stack(parts, axis=-1) if parts else np.zeros((*c.shape[:-1], 0))


def _read_after(E, C):
    """Indices of the states without those that every frame overwrites, as held outputs, and that nothing reads."""
    moves, shown = (np.any(part != 0, axis=tuple(range(part.ndim - 2))) for part in (E, C))
    over = np.all(E.diagonal(axis1=-2, axis2=-1) == -1, axis=tuple(range(E.ndim - 2)))
    kept = list(range(len(over)))
    while idle := [i for i in kept if over[i] and not shown[:, i].any() and not any(moves[j, i] for j in kept if j != i)]:
        kept = [i for i in kept if i not in idle]
    return kept
