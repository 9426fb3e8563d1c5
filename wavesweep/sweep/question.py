"""One sweep's question, settled before anything is computed: intervals along what, of which columns, in which chunks."""

from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.diagram import WALL, draw
from wavesweep.errors import SpecError, UsageError
from wavesweep.lifted import Cut, cut_at_wall
from wavesweep.spec import KEYS, Axis, Spec, sweep_axes
from wavesweep.sweep.chunks import Chunk, Chunks, cut_up, expected_cost
from wavesweep.sweep.grid import Grid, make_grid
from wavesweep.sweep.groups import groups, is_plain
from wavesweep.sweep.slices import Work

if TYPE_CHECKING:
    from wavesweep.sweep.guarantees import Guarantee


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """Stable intervals along `axis` for every column of the grid, cut into chunks.

    resolved: what the whole numbers and derived keys among the axes make of the spec, per combination of theirs.
    guarantee: for whom the intervals shall hold; the loop as it is where there is none.
    """

    grid: Grid
    axis: Axis
    chunks: Chunks
    resolved: dict
    cut: Cut | None = None
    guarantee: "Guarantee | None" = None

    @property
    def columns(self) -> int:
        """How many columns are computed."""
        return self.grid.loops * self.grid.walls

    def work(self, chunk: Chunk) -> Work:
        """What a worker needs for that chunk: values and arrays."""
        changes = self.grid.loop_values(np.arange(chunk.loops.start, chunk.loops.stop))
        parts = groups(self.grid.spec, changes, len(chunk.loops), resolved=self.resolved)
        walls = {path: v[chunk.walls.start : chunk.walls.stop] for path, v in self.grid.wall_values().items()}
        span = (float(self.axis.start), float(self.axis.stop))
        given = self.axis.path, span, bounds_of(self.axis.path, span), tuple(parts), walls, self.cut
        if self.guarantee is None:
            return Work(*given)
        from wavesweep.sweep.hand_work import HandWork

        return HandWork(*given, self.guarantee)


def ask(spec: Spec, along: str | None = None) -> Question:
    """The question of a spec's [sweep]. Raises UsageError where it cannot be answered; nothing is computed before."""
    axis, others = sweep_axes(spec, along)
    return question(make_grid(spec, others, axis.path), axis)


def question(grid: Grid, axis: Axis, cut: Cut | None = None) -> Question:
    """The same for a grid; cut: its compiled loop, where it has only one."""
    if axis.structural:
        raise UsageError(
            f"intervals along {axis.name}: expected a number that the loop varies with smoothly, found one that decides "
            f"how it is built; sweep it as values ({axis.name} = [...]) and look along another axis, such as K_VE"
        )
    resolved = _resolve_all(grid)
    ends = [next(iter(resolved.values())), *list(resolved.values())[-1:]]
    order = cut.order if cut else max(cut_at_wall(draw(values)).order for values in ends)
    cost = expected_cost(order, axis.path in WALL)
    return Question(grid, axis, cut_up(grid.loops, grid.walls, cost), resolved, cut)


def _resolve_all(grid) -> dict:
    """What each combination of the axes that go through the spec makes of it; refuses one that makes no loop."""
    axes = [axis for axis in grid.loop_axes if not is_plain(grid.spec, axis.path)]
    resolved = {}
    for values in product(*(axis.values for axis in axes)):
        changes = {axis.path: value for axis, value in zip(axes, values, strict=True)}
        try:
            resolved[tuple(changes.items())] = dict((grid.spec.with_values(changes) if changes else grid.spec).values)
        except SpecError as error:
            named = ", ".join(f"{axis.name} = {value!r}" for axis, value in zip(axes, values, strict=True))
            raise UsageError(f"[sweep]: every combination is computed, and {named} makes no loop: {error}") from error
    return resolved


def bounds_of(path, span):
    """Beyond which values of the key there is no loop; a gain may be looked at a little below zero."""
    key, (low, high) = KEYS[path], span
    below = low / 2 if key.above_low or key.low != 0 else -np.inf
    return below, np.inf if key.high is None else (high + key.high) / 2


def cut_otherwise(asked: Question, **sizes) -> Question:
    """The same question in chunks of other sizes (deep, wide)."""
    return replace(asked, chunks=replace(asked.chunks, **sizes))
