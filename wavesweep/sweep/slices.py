"""Stable intervals of a run of loops, each closed with every wall: the piece of work that a worker does."""

from dataclasses import fields

import numpy as np

from wavesweep.analysis.intervals import Intervals, stable_anywhere, stable_intervals
from wavesweep.diagram import WALL, draw
from wavesweep.lifted import Cut, close, cut_at_wall
from wavesweep.spec import KEYS
from wavesweep.sweep.grid import Grid
from wavesweep.sweep.groups import groups

BLOCK = 4096  # columns that are computed together: large enough for numpy, small enough for the cache
TINY = 1e-300  # stands in for a zero that would take a state out of the loop
SYMBOL = dict(zip(WALL, ("K_VE", "B_VE"), strict=True))


def solve_loops(grid: Grid, along: str, span, index, cut: Cut | None = None) -> Intervals:
    """Stable intervals along the path `along` within span = (low, high), for the loops `index` of the grid.

    cut: the compiled loop, where the grid has a single one. Columns of the result are numbered
    `position in index * grid.walls + wall`.

    Loops are computed in blocks whose borders are multiples of `block_loops`, whatever index is: numpy rounds the last bit
    differently in batches of another size, and a table's bytes must not depend on who computed which part of it. A
    sweep that hands out whole blocks gets the same bits however it does so.
    """
    index = np.asarray(index)
    borders = np.flatnonzero(np.diff(index // block_loops(grid))) + 1
    parts = []
    for block in np.split(np.arange(index.size), borders):
        parts += [(found, block[0] * grid.walls + column) for found, column in _block(grid, along, span, index[block], cut)]
    return joined(parts)


def block_loops(grid: Grid) -> int:
    """How many consecutive loops, from a multiple of their number on, are computed together."""
    return max(1, BLOCK // grid.walls)


def _block(grid, along, span, index, cut):
    solve = _along_wall if along in WALL else _along_number
    for members, values in groups(grid.spec, grid.loop_values(index), index.size):
        found = solve(grid, along, span, values, members.size, cut)
        yield found, members[found.column // grid.walls] * grid.walls + found.column % grid.walls


def _along_wall(grid, along, span, values, size, cut):
    """Exactly, the wall being one scalar of the cut loop."""
    loops = with_batch(cut or cut_at_wall(draw(values)), size)
    other = next(path for path in WALL if path != along)
    fixed = np.broadcast_to(grid.wall_values()[other], (size, grid.walls))
    return stable_intervals(loops, SYMBOL[along], span, fixed)


def _along_number(grid, along, span, values, size, _):
    """Through eigenvalues: the loop is compiled anew at every point that is asked for, once for all walls."""
    walls = grid.wall_values()

    def evaluate(column, p):
        loop, wall = np.divmod(column, grid.walls)
        points, back = np.unique(loop + 1j * np.where(p == 0, TINY, p), return_inverse=True)
        at = points.real.astype(int)
        varied = {path: v[at] if np.ndim(v) else v for path, v in values.items()} | {along: points.imag}
        cuts = with_batch(cut_at_wall(draw(varied)), points.size).at(back.reshape(-1))
        return close(cuts, walls[WALL[0]][wall], walls[WALL[1]][wall])

    rate = np.broadcast_to(np.asarray(values["rates.fast_hz"], float), (size,))
    ticks = 1 if values["controller.kind"] == "dc" else values["rates.ratio"]
    return stable_anywhere(evaluate, span, size * grid.walls, np.repeat(ticks / rate, grid.walls), bounds_of(along, span))


def bounds_of(path, span):
    """Beyond which values of the key there is no loop; a gain may be looked at a little below zero."""
    key, (low, high) = KEYS[path], span
    below = low / 2 if key.above_low or key.low != 0 else -np.inf
    return below, np.inf if key.high is None else (high + key.high) / 2


def with_batch(cut: Cut, size: int) -> Cut:
    """The cut as a batch of `size` loops; one that nothing varied is repeated."""
    return cut if cut.batch else cut.at(np.newaxis).at(np.zeros(size, int))


def joined(parts) -> Intervals:
    """Intervals of several groups as one, sorted by column; parts: (intervals, their columns' new numbers) pairs."""
    column = np.concatenate([columns for _, columns in parts])
    order = np.argsort(column, kind="stable")
    whole = {f.name: np.concatenate([getattr(part, f.name) for part, _ in parts])[order] for f in fields(Intervals)}
    return Intervals(**(whole | {"column": column[order]}))
