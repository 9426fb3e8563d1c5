"""The frames of loops over cells of a box of numbers: ticks as Taylor models, and their products.

Which blocks run in which tick, and what drifts, follow from the loop in doubles, and are the same
in all cells. The proof is "Unknown numbers" in docs/proof.md, whose symbols are used here.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby

import numpy as np

from wavesweep.engine.blocks import MultirateLoop
from wavesweep.engine.frames import MarginalModes, Ticks
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import (
    UNIT,
    EnclosedLoop,
    Polynomials,
    Side,
    TaylorModel,
    UnresolvedError,
    monomials,
)
from wavesweep.for_all.folded import lasting
from wavesweep.for_all.loop_frames import Symbol, alive

ORDER = 5  # total degree of the polynomials
ORDERS = (
    8,
    10,
    8,
    6,
    6,
)  # the same for so many numbers where frames are all alike, whose forms are of that degree too
ROUNDINGS = 16.0  # of its terms, that a row of equations is known to at best
INSIDE = np.array(
    [[0.3], [0.7]]
)  # places in a box at which the structure of its ticks is looked at


Groups = Sequence[tuple[int, Sequence[tuple[int, float]]]]
"""States that are counted from others: of each of these its followers, with factors."""


@dataclass(frozen=True, slots=True, eq=False)
class TickPlace:
    """A tick of a loop in doubles: the one at a place of its frame. held, exact: see `LoopModel.tick`."""

    loop: MultirateLoop
    place: int
    held: Mapping[str, Sequence[str]]
    exact: Collection[str] = ()


@dataclass(frozen=True, slots=True, eq=False)
class FramesOver:
    """The frames of a loop over cells of a box of sides.

    ticks: of each kind, with the loop that it is a tick of; those of one loop stand together. drift: what drifts in it.
    copies: see `relative_ticks`. rows, samples, symbols: see `LoopFrames`. units: `(sides, k)` exponents; the k states x that
    are kept are replaced by `exp(units' (s - about)) x` at the sides s. kept: the states that not every frame forgets, once
    known.
    """

    ticks: Sequence[tuple[EnclosedLoop, TickPlace]]
    drift: MarginalModes
    rows: tuple[tuple[int, ...], ...]
    samples: tuple[int, ...]
    symbols: tuple[Symbol, ...]
    copies: Groups = ()
    units: np.ndarray | None = None
    about: np.ndarray | None = None
    kept: list[int] = field(default_factory=list)

    @property
    def states(self) -> int:
        """The number of states without drift, including those that every frame forgets."""
        return len(self.drift.remaining)

    def at(self, cell: np.ndarray) -> Polynomials | int:
        """Return the matrices of all symbols in a cell `(2, sides)`, or the side along which it has to be divided first."""
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                frames = self._frames(self._maps(cell))
                if self.units is None:
                    return frames
                return frames.entrywise(self._ratios(cell, frames))
        except UnresolvedError as error:
            if error.number is None:
                return int(np.argmax(np.ptp(cell, 0)))
            wide = np.flatnonzero(cell[0] < cell[1])
            return int(wide[error.number])

    def unresolved(self, cell: np.ndarray) -> np.ndarray:
        """Return how much of what is left out of blocks and gains in a cell is due to each of its wide sides, `(sides,)`,
        relative to the blocks and gains themselves."""
        due = np.zeros(int((cell[0] < cell[1]).sum()))
        for loop in dict.fromkeys(loop for loop, _ in self.ticks):
            reads = monomials(due.size, loop.order)[0] > 0
            for terms, rest in loop.over(cell).parts():
                moves = terms @ reads
                if moves.any():
                    due += rest / terms.sum() * moves / moves.sum()
        return due

    def _maps(self, cell):
        """The maps of all kinds of ticks without drift, `(kinds, n, n)`."""
        changes = []
        known = {}
        for loop, places in groupby(self.ticks, lambda pair: pair[0]):
            model = loop.over(cell, known)
            for _, each in places:
                changes.append(model.tick(each.loop, each.place, each.held, each.exact))
        # "Every kind of tick is a Taylor model": those of all kinds as one.
        E = without_drift(_stacked(changes), self.drift, self.copies)
        identity = np.broadcast_to(np.eye(self.states), E.rest.shape)
        return E + Polynomials.constant(identity, E.numbers, E.order)

    def _ratios(self, cell, frames):
        """By what the entries of frames change with the units of the states."""
        wide = np.flatnonzero(cell[0] < cell[1])
        sides = []
        for at in range(cell.shape[1]):
            low = float(cell[0, at])
            high = float(cell[1, at])
            side = low
            if low < high:
                index = int(np.searchsorted(wide, at))
                side = TaylorModel.side(index, low, high, frames.numbers, frames.order)
            sides.append(side - float(self.about[at]))
        units = []
        for exponents in self.units.T:
            pairs = zip(sides, exponents, strict=True)
            total = sum((side * float(exponent) for side, exponent in pairs), 0.0)
            if isinstance(total, TaylorModel):
                units.append(total.exp())
            else:
                units.append(np.exp(total))
        n = len(units)
        inverses = [1 / unit for unit in units]
        own = [[unit] for unit in units]
        column = Polynomials.of_entries(own, (n, 1), frames.numbers, frames.order)
        row = Polynomials.of_entries([inverses], (1, n), frames.numbers, frames.order)
        ratio = column @ row
        shape = frames.rest.shape
        terms = np.broadcast_to(ratio.terms[:, None], (len(ratio.terms), *shape))
        return Polynomials(terms, np.broadcast_to(ratio.rest, shape), frames.numbers, frames.order)

    def _frames(self, maps):
        if not np.isfinite(maps.whole).all():
            raise UnresolvedError(None)
        powers = {}
        joined_rows = {}

        def power(kind, count):
            if (kind, count) not in powers:
                tick = maps.of(kind)
                if count == 1:
                    powers[kind, count] = tick
                elif count % 2:
                    powers[kind, count] = tick @ power(kind, count - 1)
                else:
                    powers[kind, count] = power(kind, count // 2) @ power(kind, count // 2)
            return powers[kind, count]

        def joined(row):
            if row in joined_rows:
                return joined_rows[row]
            runs = [(kind, len(list(run))) for kind, run in groupby(row)]
            if row[:-1] in joined_rows:
                found = maps.of(row[-1]) @ joined_rows[row[:-1]]
            elif len(runs) == 1:
                found = power(*runs[0])
            else:
                # In halves, since what is left out grows with the depth, and what repeats is
                # multiplied once.
                half = 1 << (len(runs) - 1).bit_length() - 1
                first = sum(length for _, length in runs[:half])
                found = joined(row[first:]) @ joined(row[:first])
            joined_rows[row] = found
            return found

        # "Frames are products of ticks."
        identity = Polynomials.constant(np.eye(self.states), maps.numbers, maps.order)
        products = {(): identity}
        for row in sorted(set(self.rows), key=len):
            if row:
                products[row] = joined(row)
        before = _stacked([products[row] for row in self.rows])
        frames = maps.of(list(self.samples)) @ before
        states = alive((frames.whole > 0).any(0), np.arange(self.states))
        if not self.kept:
            self.kept.extend(states.tolist())
        known = set(states.tolist()) <= set(self.kept)
        if not known or not np.isfinite(frames.whole).all():
            raise UnresolvedError(frames.widest())
        return frames.at(self.kept, self.kept)


def constant_frames(
    loop: Loops, sides: Sequence[Side], box: np.ndarray, most: int = ORDERS[1]
) -> FramesOver:
    """Return the frames of a loop whose frames are all alike over the cells of a box of sides. most: of the order."""
    inside = inside_of(box)
    values = dict(loop.values)
    for at, side in enumerate(sides):
        values[side.path] = side.number(inside[:, at])
    drawn = Loops(loop.drawing, values).drawn()
    numbers = int((box[0] < box[1]).sum())
    order = ORDER
    if numbers < len(ORDERS):
        order = ORDERS[numbers]
    enclosed = EnclosedLoop(loop.drawing, loop.values, sides, min(order, most))
    running, kind = drawn.schedule()
    held = drawn.held()
    ticks = []
    for index in range(len(running)):
        place = int(np.argmax(kind == index))
        ticks.append((enclosed, TickPlace(drawn, place, held)))
    drift = MarginalModes.of(*Loops(loop.drawing, values).twins())

    def ticks_at(points):
        columns = {side.path: side.number(points[:, at]) for at, side in enumerate(sides)}
        at_points = Loops(loop.drawing, {**loop.values, **columns}).drawn()
        return drift.relative_ticks(Ticks.of(at_points, alone=True, terms=True))

    _, groups = ticks_at(inside)
    copies = groups[len(drift.constant) :]
    drift = lasting(drift, lambda points: ticks_at(points)[0], box)
    *row, sample = kind.tolist()
    symbol = Symbol(len(kind))
    return FramesOver(ticks, drift, (tuple(row),), (sample,), (symbol,), copies)


def inside_of(box: np.ndarray) -> np.ndarray:
    """Return places in a box at which the structure of its loops is looked at, `(places, sides)`."""
    return np.where(box[0] < box[1], box[0] + (box[1] - box[0]) * INSIDE, box[0])


def without_drift(E: Polynomials, drift: MarginalModes, copies: Groups = ()) -> Polynomials:
    """Return changes of all kinds of ticks, `(kinds, n, n)`, as changes of the states that remain without drift.

    A mode of a constant shape is kept by every tick: states that move with its lead by a factor are counted from it, and then
    nothing depends on the lead. Copies are counted from their source, since what both have in common would be cancelled. Modes
    whose shapes depend on the numbers, with the leads S and the other states R: `E_R V = -E_S` in all ticks together, and the
    states `x_R - V x_S` follow `E_RR - V E_SR`. With J near to an inverse of the rows, `V = -(J E_R)^-1 J E_S`.
    """
    n = E.rest.shape[-1]
    for groups in (drift.constant, copies):
        factors = np.zeros((1, n, n))
        for lead, followers in groups:
            for state, factor in followers:
                factors[0, state, lead] = factor
        if factors.any():
            rounding = UNIT * np.abs(factors)
            to = Polynomials.constant(np.eye(n) - factors, E.numbers, E.order)
            back = Polynomials.constant(np.eye(n) + factors, E.numbers, E.order)
            E = replace(to, rest=rounding) @ E @ replace(back, rest=rounding)
    remaining = list(drift.remaining)
    leads = list(drift.varying)
    own = E.at(remaining, remaining)
    if not leads:
        return own
    # "`E_R V = -E_S` of all ticks together".
    E_R = _below(E.at(range(n), remaining))
    E_S = _below(E.at(range(n), leads))
    # Rows count by how well they are known, and columns alike, so that what is left out of them hardly grows.
    rounding = ROUNDINGS * UNIT * np.abs(E_R.terms[0]).sum(-1)
    unknown = E_R.rest.sum(-1) + E_S.rest.sum(-1) + rounding
    weight = np.divide(1.0, unknown, out=np.zeros_like(unknown), where=unknown > 0)
    weighed = E_R.terms[0] * weight[:, None]
    most = np.abs(weighed).max(0, initial=0.0)
    unit = np.divide(1.0, most, out=np.ones_like(most), where=most > 0)
    inverse = unit[:, None] * np.linalg.pinv(weighed * unit) * weight
    J = Polynomials.constant(inverse, E.numbers, E.order)
    # "`V = -(J E_R)^-1 J E_S` with J near to an inverse"; the sign is left off.
    minus_V = (J @ E_R).inverse() @ (J @ E_S)
    # `E_RR - V E_SR`, for the states counted from the rest.
    shift = Polynomials(minus_V.terms[:, None], minus_V.rest[None], E.numbers, E.order)
    return own + shift @ E.at(leads, remaining)


def _below(E):
    """The rows of all kinds of ticks below each other."""
    terms = E.terms.reshape(len(E.terms), -1, E.rest.shape[-1])
    return Polynomials(terms, E.rest.reshape(-1, E.rest.shape[-1]), E.numbers, E.order)


def _stacked(models: Sequence[Polynomials]) -> Polynomials:
    """Matrices in a row, `(models, n, n)`."""
    terms = np.stack([each.terms for each in models], 1)
    rest = np.stack([each.rest for each in models])
    return Polynomials(terms, rest, models[0].numbers, models[0].order)
