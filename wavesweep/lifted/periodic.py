"""The frame of a loop of several rates: its ticks one after the other, in delta form."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.diagram.block import Block
from wavesweep.diagram.drawn import Drawn, shifts
from wavesweep.lifted.connect import connect


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
    unfed = [f"{b.name}.{port}" for b in blocks for port in b.inputs if f"{b.name}.{port}" not in drawn.sums]
    return connect("tick", blocks, dict(drawn.sums) | dict.fromkeys(unfed, {}), drawn.inputs, tuple(outputs))


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

    Repeated stretches are taken to powers by doubling; delta form keeps the digits of slow poles. Overflow gives infinities or
    NaN, silently.
    """
    n, kinds = len(ticks.states), ticks.kind[skipped:].tolist()
    if not kinds:
        return np.zeros((n, n))
    with np.errstate(over="ignore", invalid="ignore"):
        return _product(kinds, [each.E for each in ticks.maps])


def _product(kinds, maps):
    """The product of a sequence of maps: the power of its period if it has one, else of its halves."""
    if len(kinds) == 1:
        return maps[kinds[0]]
    period = _period(kinds)
    if period < len(kinds):
        return _power(_product(kinds[:period], maps), len(kinds) // period)
    # Cut behind the longest run at the start, so that runs stay whole.
    run = next(index for index, kind in enumerate(kinds) if kind != kinds[0])
    cut = run if run > 1 else next((i for i in range(2, len(kinds)) if kinds[i] == kinds[0]), len(kinds) // 2)
    return then(_product(kinds[:cut], maps), _product(kinds[cut:], maps))


def _period(kinds):
    """The least period that divides the length (Knuth, Morris, Pratt 1977)."""
    border, k = [0] * len(kinds), 0
    for i in range(1, len(kinds)):
        while k and kinds[i] != kinds[k]:
            k = border[k - 1]
        k += kinds[i] == kinds[k]
        border[i] = k
    period = len(kinds) - border[-1]
    return period if len(kinds) % period == 0 else len(kinds)


def _power(E, count):
    total = None
    for bit in f"{count:b}":
        total = None if total is None else then(total, total)
        if bit == "1":
            total = E if total is None else then(total, E)
    return total


def then(first, second):
    """`(I + second)(I + first) - I`."""
    return first + second + second @ first


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


def drift_of_drawn(tame: Drawn, other: Drawn) -> Drift:
    """Find the drift in two drawings of the loop from different tame numbers; see `shifts`.

    A shift that is the same in both is constant. One that differs is folded away with numbers (see `without_drift`).
    """
    ticks = ticks_of(tame)
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
