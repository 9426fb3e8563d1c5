"""Stable intervals of a run of loops, each closed with every wall: the piece of work that a worker does."""

from dataclasses import fields

import numpy as np

from wavesweep.analysis.intervals import Intervals, stable_intervals
from wavesweep.diagram import WALL, draw
from wavesweep.lifted import Cut, cut_at_wall
from wavesweep.sweep.grid import Grid
from wavesweep.sweep.groups import groups

SYMBOL = dict(zip(WALL, ("K_VE", "B_VE"), strict=True))


def solve_loops(grid: Grid, along: str, span, index, cut: Cut | None = None) -> Intervals:
    """Stable intervals along the path `along` within span = (low, high), for the loops `index` of the grid.

    cut: the compiled loop, where the grid has a single one. Columns of the result are numbered
    `position in index * grid.walls + wall`.
    """
    index = np.asarray(index)
    other = next(path for path in WALL if path != along)
    fixed, parts = grid.wall_values()[other], []
    for members, values in groups(grid.spec, grid.loop_values(index), index.size):
        loops = with_batch(cut or cut_at_wall(draw(values)), members.size)
        found = stable_intervals(loops, SYMBOL[along], span, np.broadcast_to(fixed, (members.size, grid.walls)))
        parts.append((found, members[found.column // grid.walls] * grid.walls + found.column % grid.walls))
    return joined(parts)


def with_batch(cut: Cut, size: int) -> Cut:
    """The cut as a batch of `size` loops; one that nothing varied is repeated."""
    return cut if cut.batch else cut.at(np.newaxis).at(np.zeros(size, int))


def joined(parts) -> Intervals:
    """Intervals of several groups as one, sorted by column; parts: (intervals, their columns' new numbers) pairs."""
    column = np.concatenate([columns for _, columns in parts])
    order = np.argsort(column, kind="stable")
    whole = {f.name: np.concatenate([getattr(part, f.name) for part, _ in parts])[order] for f in fields(Intervals)}
    return Intervals(**(whole | {"column": column[order]}))
