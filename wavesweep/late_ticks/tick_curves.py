"""The ticks of a loop for all lengths that they may have, between control points.

What moves continuously does so for the true length h of a tick: `x[k+1] = x[k] + E(h) x[k] + B(h)
u[k]` with u held. All that a program computes is that of its nominal tick, and does not depend on
h. So a tick is affine in the entries of E and B of what moves, whatever number the loop is cut open
at. In a cell of lengths these entries are within R of a Bezier curve,

    E(h) = sum_j b_j(t) E_j,   b_j >= 0,   sum_j b_j = 1,

with the same t from 0 to 1 for all of them. Each tick is then a convex combination of the ticks
with E_j and B_j, the control points, up to what R does to it. A form decreases in all ticks of a
cell if it does so in its control points.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import comb
from typing import Any

import numpy as np

from wavesweep.engine.blocks import FACTOR, PRODUCT, Block, MultirateLoop
from wavesweep.engine.doubles import ENTRY_ROUNDING, UNIT_ROUNDING
from wavesweep.engine.drawing import Drawing, name_of
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.expressions import ONE, Tree
from wavesweep.engine.frames import OpenTicks, Ticks
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import EnclosedLoop, Polynomials, Side, UnresolvedError
from wavesweep.engine.switched import LoopFrames, WrittenFrames

LENGTH = "late.tick"  # path of a tick's length (s) in the drawings that are enclosed
DEGREE = 4  # of the curves
CURVE_ROUNDING = 1e-15  # of a length: more than the rounding of 1/rate and of a sum
MOST_CELLS = 64  # of lengths; curves of more are not made
WIDE = "[for_all] tick: the times of a tick differ by too much to be enclosed"
GONE_TERM = 2e-10  # of the largest entry of a row: more than entries that are set to zero can be
TWO_VALUES = np.array([0.5, 2.0])  # of a number: what differs with them depends on it
ROUNDINGS = 64.0  # of the terms of a curve in its control points

Curve = tuple[np.ndarray, np.ndarray]
"""Control points `(points, n, m)`, and how far the matrices may be from their curve, `(n, m)`."""


@dataclass(frozen=True, eq=False)
class LateTicks:
    """The ticks of a loop along a number, for lengths between two ends.

    family: the matrix of each place of a tick in its frame with each control point of each cell, in
    this order, as `LoopFrames`. lengths: those at which cells meet (s). places: of ticks in a frame.
    cells: of lengths.
    """

    family: Any
    lengths: np.ndarray
    places: int
    cells: int

    def by_place(self, A: np.ndarray) -> np.ndarray:
        """Return matrices of all symbols, `(..., symbols, n, n)`, as `(..., places, ticks, n, n)`."""
        return A.reshape(*A.shape[:-3], self.places, -1, *A.shape[-2:])

    def symbol(self, place: np.ndarray, length: np.ndarray) -> np.ndarray:
        """Return the symbols of ticks at places whose lengths are some of `lengths`, by their numbers:
        the first control point of a cell, or the last of all."""
        return place * self.cells * (DEGREE + 1) + length * (DEGREE + 1) - (length == self.cells)

    def pattern_of(self, word: Sequence[int]) -> tuple[int, ...]:
        """Return the lengths that ticks with these symbols have, by their numbers in `lengths`."""
        control = np.array(word, int) % (self.cells * (DEGREE + 1))
        return tuple((-(-control // (DEGREE + 1))).tolist())

    def at_lengths(self, x: float) -> np.ndarray:
        """Return the ticks at x that have one of `lengths`, `(places, lengths, n, n)`."""
        place = np.arange(self.places)[:, None]
        return self.family.at(x)[self.symbol(place, np.arange(self.cells + 1))]

    @cached_property
    def slots(self) -> np.ndarray:
        """The state in each slot before each place, `(places, slots)`, or their number where there
        is none: of those that are read before they are set again, and are not zero there."""
        family = self.family
        n = family.kept.size
        live = np.ones((self.places, n), bool)
        acts = np.array(family.patterns)[:, *np.ix_(family.kept, family.kept)]
        acts = np.logical_or(self.by_place(acts).any(1), bool(family.drift))
        before = ~live
        while (before != live).any():
            before = live
            read = live & (acts & np.roll(live, -1, axis=0)[:, :, None]).any(1)
            live = read & np.roll((acts & read[:, None]).any(2), 1, axis=0)
        slots = []
        slot = np.full(live.sum(1).max(), n)
        for live_of_place in live:
            slot = np.where(np.append(live_of_place, False)[slot], slot, n)
            coming = np.setdiff1d(np.flatnonzero(live_of_place), slot)
            slot[np.flatnonzero(slot == n)[: coming.size]] = coming
            slots.append(slot)
        return np.array(slots)

    def in_slots(self, A: np.ndarray) -> np.ndarray:
        """Return matrices of all symbols, `(..., symbols, n, n)`, as those of the slots, `(..., places,
        cells, points, slots, slots)`; 0 where there is no state."""
        rim = self.by_place(np.pad(A, [*[(0, 0)] * (A.ndim - 2), (0, 1), (0, 1)]))
        after = np.roll(self.slots, -1, axis=0)
        moved = []
        for place, (row, column) in enumerate(zip(after, self.slots, strict=True)):
            moved.append(rim[..., place, :, :, :][..., row[:, None], column])
        in_slots_of_places = np.stack(moved, axis=-4)
        return in_slots_of_places.reshape(
            *in_slots_of_places.shape[:-3], self.cells, -1, *in_slots_of_places.shape[-2:]
        )


def late_ticks(
    loops: Loops, along: str, interval: tuple[float, float], least_cells: int = 1
) -> LateTicks:
    """Return the ticks of a loop along a number that is one gain of it; empty for the loop at its
    own values.

    interval: the least and the largest length of a tick (s). least_cells: into which it is divided
    at least. Errors: IllPosedLoopError for an algebraic loop without a solution.
    """
    curves = []
    lengths = [interval[0]]
    ahead = list(itertools.pairwise(np.geomspace(*interval, least_cells + 1)))
    while ahead:
        low, high = ahead.pop(0)
        few = len(curves) + len(ahead) + 2 <= MOST_CELLS
        try:
            cell = _curves(loops, low, high)
            divided = few and not _is_near(cell)
        except UnresolvedError as error:
            if not few:
                raise IllPosedLoopError(WIDE) from error
            divided = True
        if divided:
            middle = np.sqrt(low * high)
            ahead[:0] = [(low, middle), (middle, high)]
        else:
            curves.append(cell)
            lengths.append(high)
    points = []
    for cell in curves:
        for j in range(DEGREE + 1):
            points.append({name: _point(both, j) for name, both in cell.items()})
    family, places = _family(loops, along, points)
    return LateTicks(family, np.array(lengths), places, len(curves))


def moving(drawing: Drawing) -> list[str]:
    """Return the names of the blocks that move continuously, plants of several as one."""
    return [plant.name for plant in drawing.plants] + [
        block.name for block in drawing.alone if block.plant
    ]


def _curves(loops, low, high) -> dict[str, tuple[Curve, Curve]]:
    """The curves of E and of B of each block that moves, for ticks from low to high."""
    drawing = loops.drawing
    plants = tuple(block for block in drawing.blocks if block.plant)
    rate = ONE / Tree.name(LENGTH)
    alone = replace(drawing, tick_hz=rate, blocks=plants, wires=(), hand=None, outputs=(), named=())
    # Both may be rounded: times and rates are given in decimals.
    low, high = low * (1 - CURVE_ROUNDING), high * (1 + CURVE_ROUNDING)
    # LENGTH has this value only until its side, the cell, takes its place.
    values = {**loops.values, LENGTH: low}
    enclosed = EnclosedLoop(alone, values, [Side(LENGTH)], order=24)
    model = enclosed.over(np.array([[low], [high]]))
    names = moving(drawing)
    return {name: (_curve(model.blocks[name].E), _curve(model.blocks[name].B)) for name in names}


def _curve(matrix: Polynomials) -> Curve:
    """The Bezier curve of a polynomial in s from -1 to 1, and what is left of it.

    With s = 2 t - 1 the powers of t have coefficients p_j, and the control points are `sum_j
    binomial(i, j)/binomial(d, j) p_j`.
    """
    if matrix.numbers == 0:
        return np.repeat(matrix.terms[:1], DEGREE + 1, axis=0), matrix.rest
    terms = matrix.terms[: DEGREE + 1]
    powers = np.zeros_like(terms)
    for k in range(DEGREE + 1):
        for j in range(k + 1):
            powers[j] += comb(k, j) * 2.0**j * (-1.0) ** (k - j) * terms[k]
    control = np.zeros_like(terms)
    for i in range(DEGREE + 1):
        for j in range(i + 1):
            control[i] += comb(i, j) / comb(DEGREE, j) * powers[j]
    left_out = np.abs(matrix.terms[DEGREE + 1 :]).sum(0)
    rounding = ROUNDINGS * UNIT_ROUNDING * (np.abs(terms).sum(0) + left_out)
    return control, matrix.rest + left_out + rounding


def _is_near(curves) -> bool:
    """Whether little is left out of the curves of a cell."""
    for both in curves.values():
        for control, rest in both:
            size = np.abs(control).max(0)
            # Of an entry, or of the largest one beside one that is nearly 0.
            if (rest > 1e-7 * size + 1e-12 * (1 + size.max(initial=0.0))).any():
                return False
    return True


def _point(curves, j):
    """E and B at a control point, each with what may be left out."""
    return [(control[j], rest) for control, rest in curves]


def _family(loops, along, points):
    """The matrices with each of these entries of what moves, and the number of ticks in a frame."""
    values = dict(loops.values)
    varied = values | ({along: TWO_VALUES} if along else {})
    whole = Loops(loops.drawing, varied).drawn()
    if along:
        cut_open = Loops(loops.drawing, values | {along: 0.0}).drawn(name_of(along))
    else:
        cut_open = whole
    drift = Loops(loops.drawing, varied).drift()

    def ticks_of(left_out):
        maps: list[Block] = []
        kinds = np.zeros(0, int)
        for entries in points:
            moved = _moved(whole, entries, left_out)
            if along:
                opened = _moved(cut_open, entries, left_out)
                ticks = OpenTicks.of(opened, moved, PRODUCT, FACTOR).ticks
            else:
                ticks = Ticks.of(moved, alone=True, terms=True)
            kinds = ticks.kind
            maps += ticks.maps
        maps_without_drift, _ = drift.relative_ticks(Ticks(tuple(maps), np.arange(len(maps))))
        return maps_without_drift.maps, kinds

    exact, kinds = ticks_of(0.0)
    uncertain, _ = ticks_of(1.0)
    maps = tuple(map(_with_sizes, exact, uncertain))
    different = len(maps) // len(points)
    symbols = [(place, point) for place in range(len(kinds)) for point in range(len(points))]
    samples = [point * different + int(kinds[place]) for place, point in symbols]
    places = np.array([place for place, _ in symbols])
    follows = (places[:, None] + 1) % len(kinds) == places
    written = WrittenFrames([()] * len(symbols), samples, tuple(symbols), follows)
    varying = drift if drift.varying else None
    ticks = Ticks(maps, np.arange(len(maps)))
    return LoopFrames.of(ticks, drift.remaining, written, varying), len(kinds)


def _moved(
    loop: MultirateLoop,
    entries: Mapping[str, Sequence[tuple[np.ndarray, np.ndarray]]],
    share: float,
) -> MultirateLoop:
    """Return a loop with other entries E and B of its blocks that move; an error of ENTRIES of
    the sizes of their terms is so much of what may be left out."""
    placed = []
    for scheduled in loop.placed:
        block = scheduled.block
        if block.name in entries:
            (E, of_E), (B, of_B) = entries[block.name]
            sizes = block.terms[2:] if block.terms else (np.abs(block.C), np.abs(block.D))
            of_moved = [
                np.abs(E) + share * of_E / ENTRY_ROUNDING,
                np.abs(B) + share * of_B / ENTRY_ROUNDING,
            ]
            block = replace(block, E=E, B=B, terms=(*of_moved, *sizes))
        placed.append(replace(scheduled, block=block))
    return replace(loop, placed=tuple(placed))


def _with_sizes(exact: Block, uncertain: Block) -> Block:
    """Return a tick with the sizes of the terms of the same tick about which less is known.

    Entries that what is left out could be are set to zero there, if they are small beside their
    row: here they stay, and are uncertain by that much.
    """
    sizes = []
    for name, size, size_of_exact in zip("EBCD", uncertain.terms, exact.terms, strict=True):
        entries = getattr(exact, name)
        gone = (getattr(uncertain, name) == 0) & (entries != 0)
        largest = np.abs(entries).max(-1, keepdims=True, initial=0.0)
        sizes.append(np.where(gone, size_of_exact + GONE_TERM * largest / ENTRY_ROUNDING, size))
    return replace(exact, terms=tuple(sizes))
