"""The frame of a loop of several rates: its ticks one after the other, in delta form."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from itertools import pairwise
from typing import Any

import numpy as np

from wavesweep.engine._loops.block import Block
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.batches import in_parts, product
from wavesweep.engine._monodromy.interconnect import all_sums, connect
from wavesweep.engine._state_space import StateSpace


@dataclass(frozen=True, slots=True, eq=False)
class Ticks:
    """Every kind of tick of a drawn loop.

    maps: a block per kind, all with the same states, from the inputs to the outputs. kind: of each
    tick of the frame, `(M,)`.
    """

    maps: tuple[Block, ...]
    kind: np.ndarray

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.maps[0].states

    @property
    def facts(self) -> tuple[np.ndarray | complex, np.ndarray | float]:
        """The pivot and the condition of the frame, the products of those of its kinds of ticks;
        see `Block`."""
        pivot = reduce(np.multiply, [block.pivot for block in self.maps])
        condition = reduce(np.multiply, [block.condition for block in self.maps])
        return pivot, condition

    def of_loop(self, index: int) -> "Ticks":
        """The ticks of one loop of a batch."""
        return replace(self, maps=tuple(block.of_loop(index) for block in self.maps))

    @staticmethod
    def of(
        drawn: MultirateLoop,
        outputs: Sequence[str] = (),
        alone: bool = False,
        through: str = "",
        held_ports: Mapping[str, Sequence[str]] | None = None,
        terms: bool = False,
        places: Sequence[int] | np.ndarray | None = None,
    ) -> "Ticks":
        """Connect the blocks that run in each tick, or in the ticks at some places of the frame.

        outputs: signals that every tick gives. alone: without the inputs. through: the only input
        that remains, in the ticks that it reaches, and only these have outputs then. held_ports: the
        ports that each block holds, if they are not those that are read in the drawing and the
        outputs. terms: whether the blocks have the sizes of their terms (see `Block`). Errors:
        IllPosedLoopError for an algebraic loop without a solution.
        """
        sets, kind = drawn.schedule()
        if places is not None:
            used, kind = np.unique(kind[places], return_inverse=True)
            sets = [sets[index] for index in used]
        if held_ports is None:
            held_ports = drawn.held(outputs)
        blocks = [scheduled.block for scheduled in drawn.placed]
        sums = all_sums(blocks, drawn.sums)
        silent = sums | {name: {} for name in drawn.inputs}
        inputs = drawn.inputs
        wires = sums
        if through:
            inputs = (through,)
            wires = {name: sources for name, sources in silent.items() if name != through}
        elif alone:
            inputs = ()
            wires = silent
        maps = []
        for runs in map(set, sets):
            in_tick = []
            for index, block in enumerate(blocks):
                in_tick.append(_in_tick(block, index in runs, held_ports[block.name]))
            if through and not _reaches(drawn, runs, through):
                maps.append(connect("tick", in_tick, silent, (), (), terms))
            else:
                maps.append(connect("tick", in_tick, wires, inputs, tuple(outputs), terms))
        return Ticks(tuple(maps), kind)


def _reaches(drawn: MultirateLoop, runs: set[int], signal: str) -> bool:
    """Return whether one of the blocks that run reads the signal."""
    for index in runs:
        block = drawn.placed[index].block
        for port in block.inputs:
            if signal in drawn.sources(f"{block.name}.{port}"):
                return True
    return False


def _in_tick(block: Block, runs: bool, held_ports: Sequence[str]) -> Block:
    """Return the block with states for the outputs that it holds.

    If it does not run, none of its states changes, and its outputs are the held ones.
    """
    if runs and not held_ports:
        return block
    rows = [block.outputs.index(port) for port in held_ports]
    system = _holding(StateSpace(block.E, block.B, block.C, block.D), rows, runs, -1.0)
    terms: tuple[np.ndarray, ...] = ()
    if block.terms and runs:
        terms = _holding(StateSpace(*block.terms), rows, runs, 1.0)
    held_states = [f"{port} held" for port in held_ports]
    states = (*block.states, *held_states)
    return replace(block, states=states, **system._asdict(), labels=(), terms=terms)


def _holding(system: StateSpace, rows: list[int], runs: bool, forgotten: float) -> StateSpace:
    """Return a system with states for the outputs `rows`; forgotten: of each of them if the
    block runs."""
    n, m = system.B.shape[-2:]
    p = system.C.shape[-2]
    h = len(rows)
    batch: tuple[int, ...] = ()
    kind: np.dtype[Any] | type = float
    if runs:
        batch = np.broadcast_shapes(*(matrix.shape[:-2] for matrix in system))
        kind = np.result_type(*system)
    E = np.zeros((*batch, n + h, n + h), kind)
    B = np.zeros((*batch, n + h, m), kind)
    C = np.zeros((*batch, p, n + h), kind)
    D = np.zeros((*batch, p, m), kind)
    if runs:
        E[..., :n, :n] = system.E
        E[..., n:, :n] = system.C[..., rows, :]
        E[..., n:, n:] = forgotten * np.eye(h)
        B[..., :n, :] = system.B
        B[..., n:, :] = system.D[..., rows, :]
        C[..., :n] = system.C
        D[...] = system.D
    else:
        C[..., rows, n:] = np.eye(h)
    return StateSpace(E, B, C, D)


def frame_of(ticks: Ticks) -> np.ndarray:
    """Return `(I + E)` of all ticks in a row, less the identity, `(..., n, n)`.

    Delta form keeps the digits of slow poles. Overflow gives infinities or NaN without a warning.
    """
    n = len(ticks.states)
    kinds = ticks.kind.tolist()
    if not kinds:
        return np.zeros((n, n))
    matrices = [tick.E for tick in ticks.maps]
    changes = [Change.of(E) for E in matrices]
    batch = np.broadcast_shapes(*(E.shape[:-2] for E in matrices))

    def frame(index: Any) -> np.ndarray:
        part = [change.at(index) for change in changes]
        return in_a_row(kinds, part, Change.then).E

    with np.errstate(over="ignore", invalid="ignore"):
        return in_parts(frame, batch, n, np.result_type(*matrices))


GROWING = 32.0  # growth beyond which it is computed for each loop (see `rounding`)
LOST_GROWTH = 1e6  # growth beyond which a frame has no digits that are known


def growth_of(kind: np.ndarray, changes: Sequence[np.ndarray]) -> np.ndarray:
    """Return the growth of stretches of ticks over the frame that they make, `(...)`, 1 or more, in
    no units of the states.

    kind: of each tick; changes: per kind, the matrix less identity, `(..., n, n)`.

    The product `Q P` of two stretches has an error of a rounding of `|Q| |P|`, which is larger than
    `Q P` where terms cancel. The size of each such product (see `size_of`) is compared to that of Q
    P and to that of the frame, or to 1. Accuracy: a measure of the digits that are lost, not a
    bound.
    """

    def joined(
        first: tuple[np.ndarray, np.ndarray | float, np.ndarray | float],
        second: tuple[np.ndarray, np.ndarray | float, np.ndarray | float],
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        P, largest_P, lost_P = first
        Q, largest_Q, lost_Q = second
        both = then(P, Q)
        terms = size_of(np.abs(_with_identity(Q)) @ np.abs(_with_identity(P)))
        largest = np.maximum(largest_P, largest_Q)
        lost = np.maximum(lost_P, lost_Q)
        lost_here = terms / np.fmax(1.0, size_of(_with_identity(both)))
        return both, np.maximum(largest, terms), np.fmax(lost, lost_here)

    with np.errstate(all="ignore"):  # of a frame that overflows
        of_ticks = [(E, 1.0, 1.0) for E in changes]
        E, largest, lost = in_a_row(kind.tolist(), of_ticks, joined)
        of_frame = np.fmax(1.0, size_of(_with_identity(E)))
        return np.fmax(lost, largest / of_frame)


def known_frames(E: np.ndarray, growth: np.ndarray) -> np.ndarray:
    """Return frames, and NaN for those that are lost in rounding; growth: see `growth_of`."""
    if not np.any(growth > LOST_GROWTH):
        return E
    is_known = growth <= LOST_GROWTH
    return np.where(is_known[..., None, None], E, np.nan)


def _with_identity(E: np.ndarray) -> np.ndarray:
    return E + np.eye(E.shape[-1])


def size_of(matrix: np.ndarray) -> np.ndarray:
    """Return the largest geometric mean of two entries (i, j) and (j, i), `(...)`, which no
    units of the states change."""
    squares = np.abs(matrix * matrix.mT)
    return np.sqrt(squares.max((-1, -2), initial=0.0))


def in_a_row(kinds: Sequence[int], maps: Sequence[Any], joined: Callable[[Any, Any], Any]) -> Any:
    """Return the maps of a sequence of kinds joined in a row; repeated stretches are joined once.

    joined(first, second): one map after the other. All that does not repeat is joined two by two,
    so that bounds on errors go through few joins: one after the other they would grow with the
    entries of hundreds of short stretches.
    """
    row = stretches(kinds, maps, joined)
    while len(row) > 1:
        shorter = [
            joined(first, second) for first, second in zip(row[::2], row[1::2], strict=False)
        ]
        if len(row) % 2:
            shorter.append(row[-1])
        row = shorter
    return row[0]


def products_of_rows(
    rows: Sequence[Sequence[int]],
    maps: tuple[np.ndarray, ...],
    joined: Callable[[Any, Any], tuple[np.ndarray, ...]],
) -> tuple[np.ndarray, ...]:
    """Return the maps of several rows of kinds, joined two by two, `(rows, ...)`.

    maps: arrays `(kinds, ...)`, of all kinds together. joined(first, second): the maps of some
    pairs, one after the other, each as such arrays. All pairs of neighbours that differ are joined
    in one call, in whatever row they are, so that rows which have much in common cost little more
    than one of them. Overflow gives infinities or NaN without a warning.
    """
    steps, of_rows = _pairs_of_rows(tuple(map(tuple, rows)), len(maps[0]))
    for first, second in steps:
        pairs = [tuple(entries[some] for entries in maps) for some in (first, second)]
        with np.errstate(all="ignore"):
            products = joined(*pairs)
        maps = tuple(np.concatenate(entries) for entries in zip(maps, products, strict=True))
    return tuple(entries[of_rows] for entries in maps)


@lru_cache(maxsize=64)
def _pairs_of_rows(
    rows: tuple[tuple[int, ...], ...], count: int
) -> tuple[list[np.ndarray], list[int]]:
    """The pairs that are joined in each step, as indices of both, the maps of all steps being in a
    row after those of the kinds; and the index of the map of each row. count: of the kinds."""
    steps = []
    while max(map(len, rows)) > 1:
        pairs: dict[tuple[int, int], int] = {}
        shorter = []
        for row in rows:
            halved = []
            for pair in zip(row[::2], row[1::2], strict=False):
                halved.append(count + pairs.setdefault(pair, len(pairs)))
            if len(row) % 2:
                halved.append(row[-1])
            shorter.append(tuple(halved))
        rows = tuple(shorter)
        steps.append(np.array(list(pairs)).T)
        count += len(pairs)
    return steps, [row[0] for row in rows]


def stretches(
    kinds: Sequence[int], maps: Sequence[Any], joined: Callable[[Any, Any], Any]
) -> list[Any]:
    """Return the maps of the longest stretches of a sequence of kinds that repeat, and of the
    rest between them, in a row."""
    pairs, rest = _plan(np.asarray(kinds, np.int64).tobytes())
    joined_maps = dict(enumerate(maps))
    for name, (first, second) in pairs:
        joined_maps[name] = joined(joined_maps[first], joined_maps[second])
    return [joined_maps[name] for name in rest]


@lru_cache(maxsize=64)
def _plan(kinds: bytes) -> tuple[tuple[tuple[Any, ...], ...], tuple[int, ...]]:
    """Return names for pairs of neighbours that occur more than once, and the sequence written with
    them.

    The most frequent pair is replaced again and again (N. J. Larsson, A. Moffat, Proc. IEEE 88,
    2000); a run of equal ticks becomes its powers of two, and a pattern that recurs is joined once.
    """
    sequence = np.frombuffer(kinds, np.int64).tolist()
    pairs = []
    name = 1 + max(sequence)
    while len(sequence) > 1:
        pair, count = _most_frequent(sequence)
        if count < 2:
            break
        sequence = _replaced(sequence, pair, name)
        pairs.append((name, pair))
        name += 1
    return tuple(pairs), tuple(sequence)


def _most_frequent(sequence: list[int]) -> tuple[tuple[int, int], int]:
    """Return the pair of neighbours that occurs most often without overlap, the first of
    several, and its count."""
    counts: dict[tuple[int, int], int] = {}
    last: dict[tuple[int, int], int] = {}
    for place, pair in enumerate(pairwise(sequence)):
        if last.get(pair) == place - 1 and pair[0] == pair[1]:
            last.pop(pair)
            continue
        last[pair] = place
        counts[pair] = counts.get(pair, 0) + 1
    pair = max(counts, key=counts.__getitem__)
    return pair, counts[pair]


def _replaced(sequence: list[int], pair: tuple[int, int], name: int) -> list[int]:
    """The sequence with a name in place of a pair of neighbours."""
    replaced = []
    place = 0
    while place < len(sequence):
        if place + 1 < len(sequence) and (sequence[place], sequence[place + 1]) == pair:
            replaced.append(name)
            place += 2
        else:
            replaced.append(sequence[place])
            place += 1
    return replaced


def then(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return `(I + second)(I + first) - I`; a state that either of them forgets is forgotten
    exactly.

    A plain sum would leave a rounding error in place of such a state.
    """
    return Change.of(first).then(Change.of(second)).E


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """The change of states over some ticks, less the identity, and the states that the ticks
    forget.

    E: `(..., n, n)`, or with columns of inputs that are held over the ticks behind it, `(..., n, n
    + inputs)`. unread: states on whose values before these ticks no state depends after them, each
    with the loops in which that is so. unset: states whose values after these ticks are zero, in
    the same way.
    """

    E: np.ndarray
    unread: list[tuple[int, np.ndarray]]
    unset: list[tuple[int, np.ndarray]]

    @staticmethod
    def of(E: np.ndarray) -> "Change":
        """The change by matrices less identity, `(..., n, n)`, perhaps with columns of inputs
        behind these of the states."""
        square = E[..., : E.shape[-2]]
        return Change(E, _forgotten(square), _forgotten(square.mT))

    def at(self, index: Any) -> "Change":
        """Return the change of some matrices of a batch."""
        if self.E.ndim == 2 or len(self.E) == 1:
            return self
        unread = [(state, loops[index]) for state, loops in self.unread]
        unset = [(state, loops[index]) for state, loops in self.unset]
        return Change(self.E[index], unread, unset)

    def then(self, later: "Change") -> "Change":
        """This change, and then a later one."""
        E = self.E + later.E
        E += product(later.E[..., : E.shape[-2]], self.E)
        # Of a state that is forgotten, the other entries of its column, or its row, cancel exactly.
        for state, loops in (*self.unread, *later.unset):
            E[..., state, state] = np.where(loops, -1.0, E[..., state, state])
        return Change(E, self.unread, later.unset)


def _forgotten(E: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Return the columns of `I + E` that are zero in some matrices, each with the matrices in which
    it is, `(...)`.

    Each matrix has its own, since a state may die out in one loop of a batch and not in another.
    """
    less = -np.eye(E.shape[-1])
    dead = E.diagonal(axis1=-2, axis2=-1) == -1
    columns = np.flatnonzero(dead.any(tuple(range(dead.ndim - 1))))
    forgotten = []
    for column in columns.tolist():
        loops = (E[..., column] == less[column]).all(-1)
        if loops.any():
            forgotten.append((column, loops))
    return forgotten
