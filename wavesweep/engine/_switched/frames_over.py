"""The frames of loops over cells of a box of numbers: ticks as Taylor models, and their products.

Which blocks run in which tick, and what drifts, follow from the loop in doubles, and are the same
in all cells. The proof is "Unknown numbers" in docs/proof.md, whose symbols are used here.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any

import numpy as np

from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.drift import ConstantModes, MarginalModes
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine._sets.enclosed_loop import BlockModel, EnclosedLoop, Side
from wavesweep.engine._sets.taylor_models import Polynomials, UnresolvedError, monomials
from wavesweep.engine._switched.folded import lasting
from wavesweep.engine._switched.loop_frames import Symbol, alive
from wavesweep.engine.doubles import NEXT_TO_ZERO, UNIT_ROUNDING
from wavesweep.engine.loop import Loops

TOTAL_DEGREE = 5  # total degree of the polynomials
# the same for so many numbers where frames are all alike, whose forms are of that degree too
ORDERS = (8, 10, 8, 6, 6)
EQUATION_ROUNDINGS = 16.0  # of its terms, that a row of equations is known to at best
INSIDE = np.array(
    [[0.3], [0.7]]
)  # places in a box at which the structure of its ticks is looked at


Groups = Sequence[tuple[int, Sequence[tuple[int, float]]]]
"""States that are counted from others: of each of these its followers, with factors."""


@dataclass(frozen=True, slots=True, eq=False)
class TickPlace:
    """A tick of a loop in doubles: the one at a place of its frame. held, exact: see
    `LoopModel.tick`."""

    loop: MultirateLoop
    place: int
    held: Mapping[str, Sequence[str]]
    exact: Collection[str] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Enclosed:
    """The matrices of all symbols in a box.

    due: how much of what is left out of blocks and gains is due to each of the wide sides,
    `(sides,)`, relative to these.
    """

    box: np.ndarray
    matrices: Polynomials
    due: np.ndarray

    def within(self, box: np.ndarray) -> Polynomials:
        """The matrices in a part of the box."""
        if np.array_equal(box, self.box):
            return self.matrices
        wide = np.flatnonzero(box[0] < box[1])
        half = (self.box[1] - self.box[0])[wide] / 2
        middle = (box.mean(0) - self.box.mean(0))[wide] / half
        # Both middles are rounded: the part is taken wider by that, so that its ends are within.
        rounding = 4 * UNIT_ROUNDING * (1 + np.abs(self.box[:, wide]).max(0) / half)
        return self.matrices.within(middle, (box[1] - box[0])[wide] / 2 / half + rounding)


@dataclass(frozen=True, slots=True, eq=False)
class FramesOver:
    """The frames of a loop over cells of a box of sides.

    ticks: of each kind, with the loop that it is a tick of; those of one loop stand together.
    drift: what drifts in it. copies: see `relative_ticks`. rows, samples, symbols: see
    `LoopFrames`. units: `(sides, k)` exponents; the k states x that are kept are replaced by
    `exp(units' (s - about)) x` at the sides s. scale: what frames are multiplied by. kept: the states
    that not every frame forgets, once known.
    """

    ticks: Sequence[tuple[EnclosedLoop, TickPlace]]
    drift: MarginalModes
    rows: tuple[tuple[int, ...], ...]
    samples: tuple[int, ...]
    symbols: tuple[Symbol, ...]
    copies: Groups = ()
    units: np.ndarray | None = None
    about: np.ndarray | float = 0.0
    scale: float = 1.0
    kept: list[int] = field(default_factory=list)

    @property
    def states(self) -> int:
        """The number of states without drift, including those that every frame forgets."""
        return len(self.drift.remaining)

    def of_words(self, words: Sequence[Sequence[int]]) -> FramesOver:
        """The products of words of frames in place of these."""
        rows = []
        for word in words:
            row = []
            for symbol in word[:-1]:
                row += [*self.rows[symbol], self.samples[symbol]]
            rows.append((*row, *self.rows[word[-1]]))
        samples = tuple(self.samples[word[-1]] for word in words)
        return replace(self, rows=tuple(rows), samples=samples)

    def over(self, boxes: np.ndarray) -> list[Enclosed | int]:
        """What encloses the frames in boxes; see `Frames`."""
        enclosed: list[Enclosed | int] = [0] * len(boxes)
        pending = np.arange(len(boxes))
        while pending.size:
            try:
                with np.errstate(over="ignore", invalid="ignore"):
                    frames = self._frames(self._maps(boxes[pending]))
                    if self.units is not None:
                        frames = frames.entrywise(self._ratios(self.units, boxes[pending], frames))
            except UnresolvedError as error:
                # Those without a bound are divided, and the others are tried again without them.
                unbounded = np.broadcast_to(error.cells, pending.shape)
                numbers = np.broadcast_to(error.number, pending.shape)
                for i, number in zip(pending[unbounded], numbers[unbounded], strict=True):
                    enclosed[i] = self._side_of(boxes[i], int(number))
                pending = pending[~unbounded]
                continue
            frames = frames.in_cells((len(self.rows), pending.size))
            due = self._due(boxes[pending])
            for index, i in enumerate(pending.tolist()):
                terms, rest = frames.terms[:, :, index], frames.rest[:, index]
                matrices = Polynomials(terms, rest, frames.numbers, frames.order)
                enclosed[i] = Enclosed(boxes[i], matrices, due[index])
            break
        return enclosed

    def _due(self, cells: np.ndarray) -> np.ndarray:
        """How much of what is left out of blocks and gains is due to each of the wide sides,
        `(cells, sides)`."""
        numbers = int((cells[0, 0] < cells[0, 1]).sum())
        due = np.zeros((len(cells), numbers))
        for loop in dict.fromkeys(loop for loop, _ in self.ticks):
            reads = monomials(numbers, loop.order)[0] > 0
            for terms, rest in loop.over(cells).parts():
                moves = np.moveaxis(terms, 0, -1) @ reads
                size = np.maximum(terms.sum(0) * moves.sum(-1), NEXT_TO_ZERO)
                due += (rest / size)[..., None] * moves
        return due

    def _side_of(self, box: np.ndarray, number: int) -> int:
        """The side along which a box without a bound is divided: the wide one of this index, for -1
        the one to which most of what is left out of blocks and gains is due."""
        if number < 0:
            try:
                number = int(np.argmax(self._due(box[None])[0]))
            except UnresolvedError as error:  # not even these have a bound
                number = int(np.max(error.number))
        return int(np.flatnonzero(box[0] < box[1])[number])

    def _maps(self, cells: np.ndarray) -> Polynomials:
        """The maps of all kinds of ticks without drift, `(kinds, cells, n, n)`."""
        changes = []
        blocks: dict[Any, BlockModel] = {}
        for loop, places in groupby(self.ticks, lambda pair: pair[0]):
            model = loop.over(cells, blocks)
            for _, tick in places:
                changes.append(model.tick(tick.loop, tick.place, tick.held, tick.exact))
        # "Every kind of tick is a Taylor model": those of all kinds as one.
        E = without_drift(_stacked(changes), self.drift, self.copies)
        return E + E.identity()

    def _ratios(self, units: np.ndarray, cells: np.ndarray, frames: Polynomials) -> Polynomials:
        """By what the entries of frames change with the units of the states: exponentials of sums
        over the sides, whose series in each side are known."""
        wide = np.flatnonzero(cells[0, 0] < cells[0, 1])
        order = frames.order
        low, high = np.swapaxes(cells, 0, 1)
        middle = (low + high) / 2
        half = np.maximum(high - middle, middle - low) * (1 + 4 * UNIT_ROUNDING)
        exponents = units[:, :, None] - units[:, None]
        at_middle = np.exp(np.tensordot(middle - self.about, exponents, 1))
        moves = half[:, wide, None, None] * exponents[wide]
        terms = np.broadcast_to(at_middle, (len(frames.terms), *at_middle.shape)).copy()
        factorials = np.cumprod([1.0, *range(1, order + 1)])
        for number, powers in enumerate(monomials(wide.size, order)[0].T):
            factor = factorials[powers][:, None, None, None]
            terms *= moves[:, number] ** powers[:, None, None, None] / factor
        # Of an exponential of the size h what is above the order is below `exp(h) h^(order+1)/(order+1)!`.
        size = np.abs(moves).sum(1)
        beyond = (size / (order + 1)) * size**order / factorials[-1]
        sizes = np.abs(units)
        largest = sizes[:, :, None] + sizes[:, None]
        of_middle = np.tensordot(np.abs(middle) + np.abs(self.about), largest, 1)
        rounding = 8 * UNIT_ROUNDING * ((order + 2) * (wide.size + 1) + of_middle)
        rest = at_middle * np.exp(size) * (beyond + rounding)
        return Polynomials(terms[:, None], rest[None], frames.numbers, order)

    def _frames(self, maps: Polynomials) -> Polynomials:
        """The frames over cells, by the maps of the kinds of ticks: `S T_k ... T_2 T_1` of a row of
        ticks T and the sample S that ends it.

        They are those of the states that the frames of the first cells do not forget, which are
        `kept`. Errors: UnresolvedError for cells without a bound, or whose frames do not forget another
        state.
        """
        unbounded = ~np.isfinite(maps.whole).all((0, -1, -2))
        if unbounded.any():
            raise UnresolvedError(unbounded)
        products = _Products(maps)
        for row in sorted(set(self.rows), key=len):
            products.of(row)  # which the products of longer rows take
        before = _stacked([products.of(row) for row in self.rows])
        frames = maps.of(list(self.samples)) @ before
        sizes = np.moveaxis(frames.whole, 1, 0)
        every = np.arange(self.states)
        not_forgotten = [set(alive((of_cell > 0).any(0), every).tolist()) for of_cell in sizes]
        if not self.kept:
            self.kept.extend(sorted(set.union(*not_forgotten)))
        within_kept = np.array([states <= set(self.kept) for states in not_forgotten])
        _below(frames).refuse(~(within_kept & np.isfinite(sizes).all((1, 2, 3))))
        return frames.at(self.kept, self.kept).times(self.scale)


@dataclass(frozen=True, slots=True, eq=False)
class _Products:
    """The products of rows of ticks, the first tick of a row first; what repeats is multiplied
    once.

    powers: by a kind of tick and how often it runs in a row. rows: by the kinds of their ticks.
    """

    ticks: Polynomials
    powers: dict[tuple[int, int], Polynomials] = field(default_factory=dict)
    rows: dict[tuple[int, ...], Polynomials] = field(default_factory=dict)

    def of(self, row: tuple[int, ...]) -> Polynomials:
        """The product of a row."""
        if not row:
            return self.ticks.of(0).identity()
        if row not in self.rows:
            self.rows[row] = self._joined(row)
        return self.rows[row]

    def _joined(self, row: tuple[int, ...]) -> Polynomials:
        if row[:-1] in self.rows:
            return self.ticks.of(row[-1]) @ self.rows[row[:-1]]
        runs = [(kind, len(list(run))) for kind, run in groupby(row)]
        if len(runs) == 1:
            return self._power(*runs[0])
        # In halves, since what is left out grows with the depth.
        half = 1 << (len(runs) - 1).bit_length() - 1
        first = sum(length for _, length in runs[:half])
        return self.of(row[first:]) @ self.of(row[:first])

    def _power(self, kind: int, count: int) -> Polynomials:
        if (kind, count) not in self.powers:
            tick = self.ticks.of(kind)
            if count == 1:
                product = tick
            elif count % 2:
                product = tick @ self._power(kind, count - 1)
            else:
                product = self._power(kind, count // 2) @ self._power(kind, count // 2)
            self.powers[kind, count] = product
        return self.powers[kind, count]


def constant_frames(
    loop: Loops,
    sides: Sequence[Side],
    box: np.ndarray,
    highest_order: int = ORDERS[1],
    radius: float = 1.0,
    pieces: int = 1,
) -> FramesOver:
    """Return the frames of a loop whose frames are all alike over the cells of a box of sides.
    highest_order: of the order. radius: that the frames are divided by, so that it is their unit circle.
    pieces: in which a frame is given, as far as it has so many ticks, as symbols in their order."""
    inside = inside_of(box)
    values = dict(loop.values)
    for number, side in enumerate(sides):
        values[side.path] = side.number(inside[:, number])
    drawn = Loops(loop.drawing, values).drawn()
    numbers = int((box[0] < box[1]).sum())
    order = TOTAL_DEGREE
    if numbers < len(ORDERS):
        order = ORDERS[numbers]
    drift = MarginalModes.of(*Loops(loop.drawing, values).twins())

    def ticks_at(points: np.ndarray) -> tuple[Ticks, ConstantModes]:
        columns = {side.path: side.number(points[:, number]) for number, side in enumerate(sides)}
        at_points = Loops(loop.drawing, {**loop.values, **columns}).drawn()
        return drift.relative_ticks(Ticks.of(at_points, alone=True, terms=True))

    _, groups = ticks_at(inside)
    copies = groups[len(drift.constant) :]
    # Numbers are constant in time, so units of states that depend on them change no eigenvalue; but
    # factors by which states move with others are those of the loop in doubles.
    moved = []
    for lead, followers in groups:
        moved += [drift.states[number] for number in (lead, *(state for state, _ in followers))]
    own_units = []
    for block in loop.drawing.blocks:
        if not any(state.startswith(f"{block.name}.") for state in moved):
            own_units.append(block.name)
    enclosed = EnclosedLoop(loop.drawing, loop.values, sides, min(order, highest_order), own_units)
    running, kind = drawn.schedule()
    held_signals = drawn.held()
    ticks = []
    for index in range(len(running)):
        place = int(np.argmax(kind == index))
        ticks.append((enclosed, TickPlace(drawn, place, held_signals)))
    drift = lasting(drift, lambda points: ticks_at(points)[0], box)
    words = [tuple(word.tolist()) for word in np.array_split(kind, min(pieces, len(kind)))]
    scale = 1.0
    if radius != 1:  # of a radius within this one
        scale = np.nextafter((1 / radius) ** (1 / len(words)), np.inf)
    return FramesOver(
        ticks,
        drift,
        tuple(word[:-1] for word in words),
        tuple(word[-1] for word in words),
        tuple(Symbol(len(word)) for word in words),
        copies,
        scale=scale,
    )


def inside_of(box: np.ndarray) -> np.ndarray:
    """Return places in a box at which the structure of its loops is looked at, `(places,
    sides)`."""
    return np.where(box[0] < box[1], box[0] + (box[1] - box[0]) * INSIDE, box[0])


def _weighed_inverse(rows: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return the pseudoinverse of rows `(..., m, n)` known to an error `(..., m)`, in which they count
    by how well they are known, and columns alike, so that what is left out of them hardly grows."""
    unknown = error + EQUATION_ROUNDINGS * UNIT_ROUNDING * np.abs(rows).sum(-1)
    weight = np.divide(1.0, unknown, out=np.zeros_like(unknown), where=unknown > 0)
    weighed = rows * weight[..., None]
    largest = np.abs(weighed).max(-2, initial=0.0)
    unit = np.divide(1.0, largest, out=np.ones_like(largest), where=largest > 0)
    pseudoinverse = np.linalg.pinv(weighed * unit[..., None, :])
    return unit[..., None] * pseudoinverse * weight[..., None, :]


def without_drift(E: Polynomials, drift: MarginalModes, copies: Groups = ()) -> Polynomials:
    """Return changes of all kinds of ticks, `(kinds, cells, n, n)`, as changes of the states that
    remain without drift.

    A mode of a constant shape is kept by every tick: states that move with its lead by a factor are
    counted from it, and then nothing depends on the lead. Copies are counted from their source,
    since what both have in common would be cancelled. Modes whose shapes depend on the numbers,
    with the leads S and the other states R: `E_R V = -E_S` in all ticks together, and the states
    `x_R - V x_S` follow `E_RR - V E_SR`. With J near to an inverse of the rows, `V = -(J E_R)^-1 J
    E_S`.
    """
    n = E.rest.shape[-1]
    for groups in (drift.constant, copies):
        factors = np.zeros((1, 1, n, n))
        for lead, followers in groups:
            for state, factor in followers:
                factors[..., state, lead] = factor
        if factors.any():
            rounding = UNIT_ROUNDING * np.abs(factors)
            to = Polynomials.constant(np.eye(n) - factors, E.numbers, E.order)
            back = Polynomials.constant(np.eye(n) + factors, E.numbers, E.order)
            E = replace(to, rest=rounding) @ E @ replace(back, rest=rounding)
    remaining = list(drift.remaining)
    leads = list(drift.varying)
    E_RR = E.at(remaining, remaining)
    if not leads:
        return E_RR
    # "`E_R V = -E_S` of all ticks together".
    E_R = _below(E.at(range(n), remaining))
    E_S = _below(E.at(range(n), leads))
    inverse = _weighed_inverse(E_R.terms[0], E_R.rest.sum(-1) + E_S.rest.sum(-1))
    J = Polynomials.constant(inverse, E.numbers, E.order)
    # "`V = -(J E_R)^-1 J E_S` with J near to an inverse"; the sign is left off.
    minus_V = (J @ E_R).inverse() @ (J @ E_S)
    # `E_RR - V E_SR`, for the states counted from the rest.
    shift = Polynomials(minus_V.terms[:, None], minus_V.rest[None], E.numbers, E.order)
    return E_RR + shift @ E.at(leads, remaining)


def _below(E: Polynomials) -> Polynomials:
    """The rows of all kinds of ticks below each other, `(cells, kinds n, m)`."""
    kinds, cells, n, m = E.rest.shape
    terms = np.swapaxes(E.terms, 1, 2).reshape(len(E.terms), cells, kinds * n, m)
    rest = np.swapaxes(E.rest, 0, 1).reshape(cells, kinds * n, m)
    return Polynomials(terms, rest, E.numbers, E.order)


def _stacked(models: Sequence[Polynomials]) -> Polynomials:
    """Matrices in a row, `(models, cells, n, n)`."""
    cells = np.broadcast_shapes(*(model.rest.shape[:-2] for model in models))
    models = [model.in_cells(cells) for model in models]
    terms = np.stack([model.terms for model in models], 1)
    rest = np.stack([model.rest for model in models])
    return Polynomials(terms, rest, models[0].numbers, models[0].order)
