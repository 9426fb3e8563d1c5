"""The job of stable intervals along an axis."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from wavesweep.analysis.doubt import words
from wavesweep.diagram import WALL, draw, identity, items_of
from wavesweep.errors import UsageError
from wavesweep.lifted import Cut, cut_at_wall
from wavesweep.spec import KEYS, Axis, Spec, no_axis, sweep_axes
from wavesweep.spec.drawing import name_of
from wavesweep.sweep.grid import Grid, groups, make_grid
from wavesweep.sweep.job import Chunk, Job, cut_up, resolve_all, some_loops
from wavesweep.sweep.tasks import HAND_RECORD, RECORD, IntervalTask, Task

if TYPE_CHECKING:
    from wavesweep.sweep.hands import Guarantee

# Seconds per slice and squared order, measured: one polynomial per slice; arcs, which crowded poles of high order need;
# panels, along any parameter but the wall.
BY_POLYNOMIAL, BY_ARCS, BY_PANELS = 0.4e-6, 30e-6, 15e-6
CROWDED = 24  # states


@dataclass(frozen=True, slots=True, eq=False)
class IntervalJob(Job):
    """Stable intervals along `axis` for every slice of the grid, cut into chunks.

    guarantee: the hands for which the intervals are guaranteed; if None, they are those of the spec's own loop. bounds: the
    values of the axis between which the loop exists. exact: whether the axis is one scalar gain of a frame, as the wall is.
    """

    axis: Axis
    cut: Cut | None = None
    guarantee: "Guarantee | None" = None
    bounds: tuple[float, float] = (-np.inf, np.inf)
    exact: bool = False
    rows: ClassVar[float] = 1.2  # some slices have several intervals
    row_bytes: ClassVar[int] = 160  # 130 in the CSV and 30 in the Parquet file, measured on sweeps of millions of rows

    @property
    def dtype(self) -> np.dtype:
        """Guarantees for hands have more fields."""
        return RECORD if self.guarantee is None else HAND_RECORD

    @property
    def identity(self) -> dict[str, object]:
        """The axis and the guarantee."""
        along = {"along": self.axis.name}
        return along if self.guarantee is None else along | {"guarantee": repr(self.guarantee)}

    def task(self, chunk: Chunk) -> Task:
        """The task of a worker for that chunk."""
        changes = self.grid.loop_values(np.arange(chunk.loops.start, chunk.loops.stop))
        parts = groups(self.grid.spec, changes, len(chunk.loops), resolved=self.resolved)
        walls = self.grid.wall_values(np.arange(chunk.walls.start, chunk.walls.stop))
        own = task_over(self.grid.spec, self.grid.drawing, self.axis, self.bounds, parts, walls, self.cut)
        return own if self.guarantee is None else self.guarantee.task(own)

    def columns(self, combination: np.ndarray, records: np.ndarray) -> dict[str, np.ndarray]:
        """The axes, `along`, and the fields of the records."""
        found = {name: np.ascontiguousarray(records[name]) for name in records.dtype.names if name != "slice"}
        found["doubt"] = words(found["doubt"])
        leading = self.grid.axis_columns(combination)
        return leading | {"along": np.full(records.size, self.axis.name, dtype=object)} | found


def task_over(spec: Spec, drawing, axis: Axis, bounds, parts, walls: dict, cut: Cut | None = None) -> Task:
    """The task for loops of the spec (`parts`, see `groups`), each closed with every wall.

    drawing: see `loop_of`; a loop that has one has no further walls.
    """
    span = (float(axis.start), float(axis.stop))
    if drawing is None:
        return IntervalTask(axis.path, span, bounds, tuple(parts), walls, cut)
    from wavesweep.sweep.drawn_task import DrawnTask

    return DrawnTask(drawing, axis.path, span, bounds, tuple(parts), dict(spec.values))


def job_of(spec: Spec, along: str | None = None) -> IntervalJob:
    """The job of a spec's [sweep]. Raises UsageError if it cannot be done, before anything is computed."""
    axis, others = sweep_axes(spec, along)
    return job_over(make_grid(spec, others, axis.path), axis)


def job_over(grid: Grid, axis: Axis, cut: Cut | None = None) -> IntervalJob:
    """The job of a grid; cut: its compiled loop, if it has only one."""
    if axis.structural:
        raise UsageError(no_axis(grid.spec, axis.name))
    resolved = resolve_all(grid)
    if grid.drawing:
        return _job_of_drawing(grid, axis, resolved)
    ends = [next(iter(resolved.values())), *list(resolved.values())[-1:]]
    order = cut.order if cut else max(_order(*identity(values)) for values in ends)
    cost = expected_cost(order, axis.path in WALL)
    bounds = bounds_within(grid.spec, None, axis, {}, grid.loops)
    chunks = cut_up(grid.loops, grid.walls, cost)
    return IntervalJob(grid, chunks, resolved, axis, cut, bounds=bounds, exact=axis.path in WALL)


@lru_cache(maxsize=64)
def _order(_, items):
    """States of a loop, see `identity`."""
    return cut_at_wall(draw(dict(items))).order


@lru_cache(maxsize=64)
def _order_of_drawing(drawing, path, items, own):
    """States of a loop, and whether the number is one scalar gain of its frame."""
    from wavesweep.sweep.drawn_loops import drift_of, frames
    from wavesweep.sweep.drawn_task import exact_cut

    values, own = ({path: np.array(v) if isinstance(v, tuple) else v for path, v in some} for some in (items, own))
    cut = exact_cut(drawing, values, own, name_of(path))
    if cut is not None:
        return cut.order, True
    return frames(drawing, values, drift_of(drawing, values, own)).shape[-1], False


def _job_of_drawing(grid: Grid, axis: Axis, resolved: dict) -> IntervalJob:
    """The job of a drawn loop: the range in which it exists is found."""
    from wavesweep.sweep.drawn_loops import refuse_singular

    spec, span = grid.spec, (float(axis.start), float(axis.stop))
    refuse_singular(spec, grid.drawing)
    for end in span:
        spec.with_values({axis.path: end})
    index = some_loops(grid)
    bounds = bounds_within(spec, grid.drawing, axis, grid.loop_values(index), index.size, resolved)
    _, first = next(groups(spec, grid.loop_values(np.arange(1)), 1, resolved=resolved))
    cost, exact = cost_of(spec, grid.drawing, axis, first)
    chunks = cut_up(grid.loops, 1, cost)
    return IntervalJob(grid, chunks, resolved, axis, bounds=bounds, exact=exact)


def bounds_within(
    spec: Spec, drawing, axis: Axis, changes: dict, size: int, resolved: dict | None = None
) -> tuple[float, float]:
    """The values of the axis between which `size` loops exist; drawing: see `loop_of`; changes: their values, see `groups`."""
    span = (float(axis.start), float(axis.stop))
    if spec.drawing is None and not axis.path.endswith("cutoff_hz"):
        return bounds_of(axis.path, span)
    if spec.drawing is None:
        rates = [np.min(values["rates.fast_hz"]) for _, values in groups(spec, changes, size, resolved=resolved)]
        below, above = bounds_of(axis.path, span)
        return below, min(above, (span[1] + float(min(rates)) / 2) / 2) if drawing else above
    from wavesweep.diagram.assembly import refuse_unsuitable
    from wavesweep.diagram.domain import domain

    bounds = []
    for _, values in groups(spec, changes, size, resolved=resolved):
        refuse_unsuitable(drawing, values)
        bounds.append(domain(drawing, values, axis.path, span))
    below, above = zip(*bounds, strict=True)
    return max(below), min(above)


def bounds_of(path, span):
    """Values of the key between which the drawing exists; a gain may go a little below zero."""
    key, (low, high) = KEYS[path], span
    below = low / 2 if key.above_low or key.low != 0 else -np.inf
    return below, np.inf if key.high is None else (high + key.high) / 2


def expected_cost(order: int, wall: bool) -> float:
    """Seconds that a slice of a loop with `order` states takes, roughly; wall: along K_VE or B_VE.

    A fixed rule and no measurement, so that a run that goes on finds the chunks of the one that was stopped.
    """
    share = BY_PANELS if not wall else BY_POLYNOMIAL if order <= CROWDED else BY_ARCS
    return share * max(order, 2) ** 2


def cost_of(spec: Spec, drawing, axis: Axis, values: dict | None = None) -> tuple[float, bool]:
    """Expected s per slice of the spec along the axis, and whether it goes the exact way.

    drawing: see `loop_of`. values: of one loop of the sweep.
    """
    values = dict(spec.values) if values is None else values
    if drawing is None:
        return expected_cost(_order(*identity(values)), axis.path in WALL), axis.path in WALL
    order, exact = _order_of_drawing(drawing, axis.path, items_of(values), items_of(spec.values))
    return expected_cost(order, exact), exact
