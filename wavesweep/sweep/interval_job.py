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
from wavesweep.spec.drawing import name_of, path_of
from wavesweep.sweep.grid import FAST, Grid, groups, make_grid, selected
from wavesweep.sweep.job import CHECKED, Chunk, Job, cut_up, resolve_all, some_loops
from wavesweep.sweep.tasks import HAND_RECORD, RECORD, IntervalTask, Task

if TYPE_CHECKING:
    from wavesweep.sweep.hands import Guarantee

# Seconds per slice and squared order, measured: one polynomial per slice; arcs, which crowded poles of high order need;
# panels, along any parameter but the wall.
BY_POLYNOMIAL, BY_ARCS, BY_PANELS = 0.4e-6, 30e-6, 15e-6
CROWDED = 24  # states
VARIED = 1.001  # times its own value, another one of a number that varies
STRUCTURES = 8  # of a sweep's loops, whose way is looked for


@dataclass(frozen=True, slots=True, eq=False)
class IntervalJob(Job):
    """Stable intervals along `axis` for every slice of the grid, cut into chunks.

    guarantee: the hands for which the intervals are guaranteed; if None, they are those of the spec's own loop. bounds: the
    values of the axis between which the loop exists. exact: whether the axis is one scalar gain of a frame, as the wall is;
    None if it is so in some loops.
    """

    axis: Axis
    cut: Cut | None = None
    guarantee: "Guarantee | None" = None
    bounds: tuple[float, float] = (-np.inf, np.inf)
    exact: bool | None = False
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
        parts = groups(self.grid.spec, changes, len(chunk.loops), self.resolved, rates=True)
        walls = self.grid.wall_values(np.arange(chunk.walls.start, chunk.walls.stop))
        checked = self.grid.loops <= CHECKED
        own = task_over(self.grid.drawing, self.axis, self.bounds, parts, walls, self.cut, checked=checked)
        return own if self.guarantee is None else self.guarantee.task(own)

    def columns(self, combination: np.ndarray, records: np.ndarray) -> dict[str, np.ndarray]:
        """The axes, `along`, and the fields of the records."""
        found = {name: np.ascontiguousarray(records[name]) for name in records.dtype.names if name != "slice"}
        found["doubt"] = words(found["doubt"])
        leading = self.grid.axis_columns(combination)
        return leading | {"along": np.full(records.size, self.axis.name, dtype=object)} | found


def task_over(drawing, axis: Axis, bounds, parts, walls: dict, cut: Cut | None = None, *, checked: bool = False) -> Task:
    """The task for loops (`parts`, see `groups`), each closed with every wall.

    drawing: see `loop_of`; a loop that has one has no further walls. checked: whether its numbers are known to make loops.
    """
    span = (float(axis.start), float(axis.stop))
    if drawing is None:
        return IntervalTask(axis.path, span, bounds, tuple(parts), walls, cut)
    from wavesweep.sweep.drawn_task import DrawnTask

    return DrawnTask(drawing, axis.path, span, bounds, tuple(parts), checked=checked)


def job_of(spec: Spec, along: str | None = None) -> IntervalJob:
    """The job of a spec's [sweep]. Raises UsageError if it cannot be done, before anything is computed."""
    axis, others = sweep_axes(spec, along)
    return job_over(make_grid(spec, others, axis.path), axis)


def job_over(grid: Grid, axis: Axis, cut: Cut | None = None) -> IntervalJob:
    """The job of a grid; cut: its compiled loop, if it has only one."""
    if axis.structural and grid.spec.builds(axis.path, [axis.path, *(each.path for each in grid.loop_axes)]):
        raise UsageError(no_axis(grid.spec, axis.name))
    resolved = resolve_all(grid, rates=True)
    if axis.path == FAST:
        grid.spec.with_values({FAST: float(axis.start)})
    if grid.drawing:
        return _job_of_drawing(grid, axis, resolved)
    ends = [next(iter(resolved.values())), *list(resolved.values())[-1:]]
    order = cut.order if cut else max(_order(*identity(values)) for values in ends)
    cost = expected_cost(order, axis.path in WALL)
    bounds = bounds_within(grid.spec, None, axis)
    chunks = cut_up(grid.loops, grid.walls, cost)
    return IntervalJob(grid, chunks, resolved, axis, cut, bounds=bounds, exact=axis.path in WALL)


@lru_cache(maxsize=64)
def _order(_, items):
    """States of a loop, see `identity`."""
    return cut_at_wall(draw(dict(items))).order


@lru_cache(maxsize=64)
def _order_of_drawing(drawing, path, items):
    """States of a loop, and whether the number is one scalar gain of its frame."""
    from wavesweep.sweep.drawn_loops import drift_of, frames
    from wavesweep.sweep.open_loops import exact_cut

    values = {path: np.array(v) if isinstance(v, tuple) else v for path, v in items}
    cut = exact_cut(drawing, values, name_of(path))
    if cut is not None:
        return cut.order, True
    return frames(drawing, values, drift_of(drawing, values)).shape[-1], False


def _job_of_drawing(grid: Grid, axis: Axis, resolved: dict) -> IntervalJob:
    """The job of a drawn loop: the range in which it exists is found."""
    from wavesweep.diagram.assembly import unsuitable
    from wavesweep.sweep.drawn_loops import refuse_singular

    spec, span = grid.spec, (float(axis.start), float(axis.stop))
    refuse_singular(spec, grid.drawing)
    if spec.drawing is None or unsuitable(grid.drawing, {**spec.values, axis.path: np.array(span)}).any():
        for end in span:
            spec.with_values({axis.path: end})
    index = some_loops(grid)
    parts = list(groups(spec, grid.loop_values(index), index.size, resolved=resolved))
    bounds = bounds_within(spec, grid.drawing, axis, parts, checked=True)
    ours = (selected(values, [0]) for _, values in parts[:STRUCTURES])
    costs, ways = zip(*(cost_of(spec, grid.drawing, axis, values) for values in ours), strict=True)
    exact = ways[0] if len({*ways}) == 1 else None
    return IntervalJob(grid, cut_up(grid.loops, 1, costs[0]), resolved, axis, bounds=bounds, exact=exact)


def bounds_within(spec: Spec, drawing, axis: Axis, parts=(), *, checked: bool = False) -> tuple[float, float]:
    """The values of the axis between which loops exist; drawing: see `loop_of`; parts: see `groups`; checked: see `task_over`.

    For a controller whose rates divide, the task looks at its loops itself.
    """
    span = (float(axis.start), float(axis.stop))
    if spec.drawing is None:
        below, above = bounds_of(axis.path, span)
        if drawing and axis.path.endswith("cutoff_hz"):
            rate = min(float(np.min(values["rates.fast_hz"])) for _, values in parts)
            above = min(above, (span[1] + rate / 2) / 2)
        return below, above
    from wavesweep.diagram.assembly import refuse_unsuitable
    from wavesweep.diagram.domain import domain

    for _, values in () if checked else parts:
        refuse_unsuitable(drawing, values)
    below, above = zip(*(domain(drawing, values, axis.path, span) for _, values in parts), strict=True)
    return max(below), min(above)


def bounds_of(path, span):
    """Values of the key between which the drawing exists; a gain may go a little below zero, and a cutoff to zero."""
    key, (low, high) = KEYS[path], span
    below = 0.0 if path.endswith("cutoff_hz") else low / 2 if key.above_low or key.low != 0 else -np.inf
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
    values = _like_own(values, spec) if spec.drawing else values
    order, exact = _order_of_drawing(drawing, axis.path, items_of(values))
    return expected_cost(order, exact), exact


def _like_own(values, spec):
    """Values of a loop, those of the spec in place of others of the same sign, which have the same structure as a rule.

    A compiled loop is asked about other values again and again.
    """
    kept, found = {path_of(name) for name in spec.drawing.shaping}, dict(values)
    for path, value in values.items():
        own, one = spec.values[path], value[0] if np.ndim(value) else value
        if path not in kept and isinstance(own, float) and (one > 0, one < 0) == (own > 0, own < 0):
            found[path] = own * np.array([1.0, VARIED]) if np.ndim(value) else own
    return found
