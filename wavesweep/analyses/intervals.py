"""The job of stable intervals along an axis."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from wavesweep.analyses.bound import Bound
from wavesweep.analyses.interval_records import RECORD, certified_slices
from wavesweep.analyses.interval_search import DrawnTask, SeveralTasks
from wavesweep.analyses.loops import drift_of, frames, frames_of, refuse_singular
from wavesweep.analyses.open_loops import exact_cut
from wavesweep.analyses.proving import ALL, OPERATIONS
from wavesweep.columns import Columns
from wavesweep.errors import UsageError
from wavesweep.loops.common_tick import with_common_tick
from wavesweep.loops.domain import domain
from wavesweep.loops.from_drawing import unsuitable
from wavesweep.spec import Axis, Require, Spec, no_axis, sweep_axes
from wavesweep.spec.drawing import name_of, path_of
from wavesweep.stability.certificate import words
from wavesweep.sweep.grid import FAST, Grid, drawing_for, drawn_groups, groups, items_of, make_grid, own_loop, read_by, selected
from wavesweep.sweep.job import CHECKED, Chunk, Job, cut_up, resolve_all, some_loops
from wavesweep.sweep.pools import Task

if TYPE_CHECKING:
    from wavesweep.analyses.for_all import ForAllGuarantee
    from wavesweep.analyses.hands import Guarantee

# Seconds per slice and squared order, measured: one polynomial per slice; panels, along any
# parameter but the wall, and for crowded poles of high order.
BY_POLYNOMIAL, BY_PANELS = 0.2e-6, 15e-6
BY_DISCS = 0.1  # s per slice, measured, of a damping ratio, or of loops that conserve
CROWDED = 24  # states
VARIED = 1.001  # times its own value, another one of a number that varies
STRUCTURES = 8  # of a sweep's loops, whose way is looked for
FEW = 1000  # loops of several structures, up to which a call for each takes longer than states that fill them up


@dataclass(frozen=True, slots=True, eq=False)
class IntervalJob(Job):
    """Stable intervals along `axis` for every slice of the grid, cut into chunks.

    guarantee: the hands or numbers for which the intervals are guaranteed; None: those of the spec's own loop. exact: whether
    the axis is one scalar gain of a frame, as the wall is; None if it is so in some loops. require: of every mode, in place of
    stability alone. order: see `SeveralTasks`.
    """

    axis: Axis
    guarantee: "Guarantee | ForAllGuarantee | None" = None
    exact: bool | None = False
    require: Require | None = None
    order: int = 0
    rows: ClassVar[float] = 1.2  # some slices have several intervals
    row_bytes: ClassVar[int] = 160  # 130 in the CSV and 30 in the Parquet file, measured on sweeps of millions of rows

    @property
    def dtype(self) -> np.dtype:
        """Guarantees for hands have more fields."""
        return RECORD if self.guarantee is None else self.guarantee.dtype

    @property
    def identity(self) -> dict[str, object]:
        """The axis and the guarantee."""
        along = {"along": self.axis.name} | ({"require": self.require.written()} if self.require else {})
        return along if self.guarantee is None else along | {"guarantee": repr(self.guarantee)}

    def certified(self, records: np.ndarray) -> int:
        """How many slices are certified."""
        return certified_slices(records)

    def task(self, chunk: Chunk) -> Task:
        """The task of a worker for that chunk."""
        changes = self.grid.loop_values(np.arange(chunk.loops.start, chunk.loops.stop))
        if self.guarantee is not None:
            spec, along = self.grid.spec, self.axis.path
            parts = groups(spec, changes, len(chunk.loops), self.resolved, rates=True)
            whole = ((members, drawing_for(spec, values, along), values) for members, values in parts)
            return self.guarantee.task(along, _span(self.axis), tuple(whole))
        loops = self.grid.loops
        prove = min(OPERATIONS, ALL / loops)
        options = {"checked": loops <= CHECKED, "prove": prove, "require": self.require, "order": self.order}
        return task_over(self.grid.spec, self.axis, changes, len(chunk.loops), self.resolved, **options)

    def columns(self, combination: np.ndarray, records: np.ndarray) -> dict[str, np.ndarray]:
        """The axes, `along`, and the fields of the records."""
        found = {name: np.ascontiguousarray(records[name]) for name in records.dtype.names if name != "slice"}
        found["doubt"] = words(found["doubt"])
        leading = self.grid.axis_columns(combination)
        return leading | {"along": np.full(records.size, self.axis.name, dtype=object)} | found


def task_over(
    spec: Spec,
    axis: Axis,
    changes,
    size: int,
    resolved=None,
    *,
    ties=(),
    felt=True,
    checked=False,
    prove=0.0,
    require: Require | None = None,
    order=0,
) -> Task:
    """The task for `size` loops of the spec.

    changes: path -> value of each loop; resolved: see `groups`. ties: paths of numbers that follow the axis, whose values are
    factors of it. felt, checked, prove: see `DrawnTask`. require: see `IntervalJob`. order: see `SeveralTasks`.
    """
    parts: dict = {}
    for members, values in groups(spec, changes, size, resolved, rates=True):
        drawing = drawing_for(spec, values, axis.path)
        bound = require and Bound.of(require).over(frames_of(drawing, values))
        parts.setdefault((drawing, bound), []).append((members, read_by(drawing, values)))
    tasks = []
    for (drawing, bound), groups_of in parts.items():
        drawn = drawing.tied(axis.path, ties) if ties else drawing
        known = checked or not spec.drawing
        tasks.append(DrawnTask(drawn, axis.path, _span(axis), tuple(groups_of), felt, known, prove, bound))
    return tasks[0] if len(tasks) == 1 and not order else SeveralTasks(tuple(tasks), order)


def _span(axis):
    return float(axis.start), float(axis.stop)


def job_of(spec: Spec, along: str | None = None) -> IntervalJob:
    """The job of a spec's [sweep]. Raises UsageError if it cannot be done, before anything is computed."""
    axis, others = sweep_axes(spec, along)
    return job_over(make_grid(spec, others, axis.path), axis, require=spec.require)


def job_over(grid: Grid, axis: Axis, *, require: Require | None = None) -> IntervalJob:
    """The job of a grid; require: see `IntervalJob`. Errors: UsageError or SpecError if it cannot be done."""
    spec = grid.spec
    if axis.structural and spec.builds(axis.path, [axis.path, *(each.path for each in grid.loop_axes)]):
        raise UsageError(no_axis(spec, axis.name))
    resolved = resolve_all(grid, rates=True)
    for end in _span(axis):
        wrong = spec.drawing and unsuitable(spec.drawing, {**spec.values, axis.path: np.array([end])}).any()
        if wrong or spec.uneven or axis.path == FAST:
            spec.with_values({axis.path: end})
    if spec.drawing:
        refuse_singular(spec, spec.drawing)
    if spec.drawing and not spec.for_all:
        spec = replace(spec, drawing=with_common_tick(spec.drawing, resolved.values()))
        grid = replace(grid, spec=spec)
    index = some_loops(grid)
    changes = grid.loop_values(index)
    parts = list(drawn_groups(spec, changes, index.size, resolved, rates=True, along=axis.path))
    for _, drawing, values in parts:
        if require and require.settling and name_of(axis.path) in drawing.rating:
            raise UsageError(f"{axis.name} changes the time of a frame: require radius along it, and not settling")
        domain(drawing, values, axis.path, _span(axis))
    ours = ((drawing, selected(values, [0])) for _, drawing, values in parts[:STRUCTURES])
    orders, ways = zip(*(_order_of(spec, drawing, axis, values) for drawing, values in ours), strict=True)
    exact = ways[0] if len({*ways}) == 1 else None
    cost = BY_DISCS if _takes_discs(require) else expected_cost(orders[0], ways[0])
    order = max(orders) if len(orders) > 1 and exact and not require and grid.loops <= FEW else 0
    return IntervalJob(grid, cut_up(grid.loops, 1, cost), resolved, axis, exact=exact, require=require, order=order)


@lru_cache(maxsize=64)
def _order_of_drawing(drawing, path, items):
    """States of a loop, and whether the number is one scalar gain of its frame."""
    values = {path: np.array(v) if isinstance(v, tuple) else v for path, v in items}
    cut = exact_cut(drawing, values, name_of(path))
    if cut is not None:
        return cut.order, True
    return frames(drawing, values, drift_of(drawing, values)).shape[-1], False


def expected_cost(order: int, wall: bool) -> float:
    """Seconds that a slice of a loop with `order` states takes, roughly; wall: along K_VE or B_VE.

    A fixed rule and no measurement, so that a run that goes on finds the chunks of the one that was stopped.
    """
    share = BY_POLYNOMIAL if wall and order <= CROWDED else BY_PANELS
    return share * max(order, 2) ** 2


def cost_of(spec: Spec, axis: Axis) -> tuple[float, bool]:
    """Expected s per slice of the spec along the axis, and whether it goes the exact way."""
    drawing, values = own_loop(spec, axis.path)
    order, exact = _order_of(spec, drawing, axis, values)
    return expected_cost(order, exact), exact


def _order_of(spec, drawing, axis, values):
    return _order_of_drawing(drawing, axis.path, items_of(_like_own(values, spec, drawing)))


def _like_own(values, spec, drawing):
    """Values of a loop, those of the spec in place of others of the same sign, which have the same structure as a rule.

    A compiled loop is asked about other values again and again.
    """
    kept, found = {path_of(name) for name in drawing.shaping}, dict(values)
    for path, value in values.items():
        own, one = spec.values.get(path), value[0] if np.ndim(value) else value
        if path not in kept and isinstance(own, float) and (one > 0, one < 0) == (own > 0, own < 0):
            found[path] = own * np.array([1.0, VARIED]) if np.ndim(value) else own
    return found


def at_points(
    spec: Spec,
    axis: Axis,
    points: Mapping[str, np.ndarray],
    ties: tuple[str, ...] = (),
    felt: bool = True,
    require: Require | None = None,
) -> Columns:
    """Stable intervals along `axis` at single points, as the records of a table, with the column `slice`: the point's number.

    points: path -> value at each point, `(n,)`; no two points are the same. ties: paths of numbers that follow the axis; their
    values are the factors. felt: compute the felt stiffness at the ends too, which is missing otherwise. require: see
    `IntervalJob`.
    """
    count = len(next(iter(points.values())))
    records = task_over(spec, axis, points, count, ties=ties, felt=felt, checked=True, require=require).records()
    return {name: np.ascontiguousarray(records[name]) for name in RECORD.names} | {"doubt": words(records["doubt"])}


EXACT = "crossings of the unit circle from one real polynomial, proved by signs or discs, polished in state space"
DISCS = "discs about the frame's eigenvalues against {}, on panels halved down to the ends"
PANELS = "eigenvalues off the unit circle by dominance in eigenvectors, on Chebyshev panels of the frame's entries"


def method(job: IntervalJob) -> str:
    """How the intervals of a job are found, in a line."""
    found = EXACT if job.exact else PANELS
    if job.exact is None:
        found = f"{EXACT}, in loops of which the axis is one scalar gain of a frame; {PANELS}, in others"
    if job.require and Bound.of(job.require).of_size:
        found += "; of frames over the required radius, whose unit circle is its circle"
    if not _takes_discs(job.require):
        return found
    discs = DISCS.format("each other and the unit circle" if job.require.bounded else "the spiral of the damping ratio")
    return f"{discs}; and {found}" if Bound.of(job.require).of_size else discs


def _takes_discs(require):
    return bool(require and (require.damping_ratio or require.bounded))
