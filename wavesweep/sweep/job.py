"""The job of a table, settled before anything is computed: its question, and the slices in chunks.

A `Job` of any table has slices in chunks, tasks for workers, and columns for the records of finished chunks; the one of
stable intervals is here as well.
"""

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from wavesweep.analysis.doubt import words
from wavesweep.diagram import WALL, draw, identity, items_of
from wavesweep.errors import SpecError, UsageError
from wavesweep.lifted import Cut, cut_at_wall
from wavesweep.spec import KEYS, Axis, Spec, sweep_axes
from wavesweep.sweep.disk import free_bytes
from wavesweep.sweep.grid import Grid, groups, is_plain, make_grid
from wavesweep.sweep.tasks import HAND_RECORD, RECORD, IntervalTask, Task, certified_slices

if TYPE_CHECKING:
    from wavesweep.sweep.hands import Guarantee

SECONDS = 0.3  # that a chunk should take: if it takes longer, a crash loses more; if shorter, handing it out costs more
FEWEST, MOST = 16, 4096  # slices of a chunk; more would leave the processor's cache
# Seconds per slice and squared order, measured: one polynomial per slice; arcs, which crowded poles of high order need;
# panels, along any parameter but the wall.
BY_POLYNOMIAL, BY_ARCS, BY_PANELS = 0.4e-6, 30e-6, 15e-6
CROWDED = 24  # states


@dataclass(frozen=True, slots=True)
class Chunk:
    """The loops `loops` closed with the walls `walls` (index ranges); its slices are consecutive, from `first` on."""

    number: int
    loops: range
    walls: range
    first: int

    @property
    def slices(self) -> int:
        """Number of its slices."""
        return len(self.loops) * len(self.walls)


@dataclass(frozen=True, slots=True)
class Chunks:
    """All chunks of `loops x walls` slices, slice = loop * walls + wall; each of `deep` loops and `wide` walls at most.

    A chunk is several loops with all their walls, or a part of the walls of one loop, so its slices are consecutive. The
    results do not depend on the borders of the chunks.
    """

    loops: int
    walls: int
    deep: int
    wide: int

    def __len__(self) -> int:
        return -(-self.loops // self.deep) * self._across

    @property
    def _across(self):
        return -(-self.walls // self.wide)

    def __getitem__(self, number: int) -> Chunk:
        down, across = divmod(number, self._across)
        loops = range(down * self.deep, min((down + 1) * self.deep, self.loops))
        walls = range(across * self.wide, min((across + 1) * self.wide, self.walls))
        return Chunk(number, loops, walls, loops.start * self.walls + walls.start)

    def of(self, slices) -> np.ndarray:
        """Number of the chunk that each slice is in."""
        loop, wall = np.divmod(slices, self.walls)
        return loop // self.deep * self._across + wall // self.wide


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """Records for every slice of a grid, cut into chunks, and the columns that they make; a subclass says which.

    resolved: the spec's values for each combination of those axes that are whole numbers or that other keys derive from.
    noun: of the slices, in messages. dtype: of the records, whose field `slice` counts from 0 in the chunk. rows: of the table
    for each combination, about. row_bytes: of such a row in its files, without its axes. ready: s that workers take longer
    than usual until they are ready. proves: whether slices can be certified.
    """

    grid: Grid
    chunks: Chunks
    resolved: dict
    noun: ClassVar[str] = "slices"
    dtype: ClassVar[np.dtype]
    rows: ClassVar[float] = 1.0
    row_bytes: ClassVar[int] = 0
    ready: ClassVar[float] = 0.0
    proves: ClassVar[bool] = True

    @property
    def slices(self) -> int:
        """Number of slices that are computed."""
        return self.chunks.loops * self.chunks.walls

    @property
    def size(self) -> int:
        """Number of combinations that have rows."""
        return self.grid.size

    @property
    def identity(self) -> dict[str, object]:
        """Names and values that the records depend on besides the spec, the versions and the chunks, JSON-able."""
        raise NotImplementedError

    def slice_of(self, combination) -> np.ndarray:
        """Number of the slice of each combination."""
        return self.grid.slice_of(combination)

    def task(self, chunk: Chunk) -> Task:
        """The task of a worker for that chunk."""
        raise NotImplementedError

    def columns(self, combination: np.ndarray, records: np.ndarray) -> Mapping[str, np.ndarray]:
        """The table's columns for records of these combinations, one for each record."""
        raise NotImplementedError

    def certified(self, records: np.ndarray) -> int:
        """How many slices of these records are certified."""
        return certified_slices(records)


def cut_up(loops: int, walls: int, cost: float) -> Chunks:
    """The slices in chunks of about `SECONDS`; cost: expected s per slice (see `expected_cost`)."""
    slices = int(np.clip(SECONDS / cost, FEWEST, MOST))
    if walls > slices:
        return Chunks(loops, walls, 1, slices)
    return Chunks(loops, walls, slices // walls, walls)


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
    from wavesweep.sweep.drawn_loops import DrawnTask

    return DrawnTask(drawing, axis.path, span, bounds, tuple(parts), dict(spec.values))


def job_of(spec: Spec, along: str | None = None) -> IntervalJob:
    """The job of a spec's [sweep]. Raises UsageError if it cannot be done, before anything is computed."""
    axis, others = sweep_axes(spec, along)
    return job_over(make_grid(spec, others, axis.path), axis)


def job_over(grid: Grid, axis: Axis, cut: Cut | None = None) -> IntervalJob:
    """The job of a grid; cut: its compiled loop, if it has only one."""
    if axis.structural:
        raise UsageError(
            f"intervals along {axis.name}: expected a number that the loop varies with smoothly, found one that decides "
            f"how it is built; sweep it as values ({axis.name} = [...]) and look along another axis"
            f"{'' if grid.spec.drawing else ', such as K_VE'}"
        )
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
    from wavesweep.sweep.drawn_loops import drift_of, exact_cut, frames

    values, own = ({path: np.array(v) if isinstance(v, tuple) else v for path, v in some} for some in (items, own))
    cut = exact_cut(drawing, values, own, path.removeprefix("numbers."))
    if cut is not None:
        return cut.order, True
    return frames(drawing, values, drift_of(drawing, values, own)).shape[-1], False


CHECKED = 100_000  # loops whose numbers are checked before anything is computed; those of more are checked chunk by chunk


def _job_of_drawing(grid: Grid, axis: Axis, resolved: dict) -> IntervalJob:
    """The job of a drawn loop: its numbers are checked, and the range in which it exists is found."""
    from wavesweep.sweep.drawn_loops import refuse_singular

    spec, span = grid.spec, (float(axis.start), float(axis.stop))
    refuse_singular(spec, grid.drawing)
    for end in span:
        spec.with_values({axis.path: end})
    index = np.unique(np.linspace(0, grid.loops - 1, min(grid.loops, CHECKED)).astype(int))
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
    from wavesweep.diagram.assembly import domain, refuse_unsuitable

    bounds = []
    for _, values in groups(spec, changes, size, resolved=resolved):
        refuse_unsuitable(drawing, values)
        bounds.append(domain(drawing, values, axis.path, span))
    below, above = zip(*bounds, strict=True)
    return max(below), min(above)


def resolve_all(grid: Grid, table: str = "sweep") -> dict:
    """The spec's values for each combination of the axes that go through the spec. Raises UsageError if one makes no loop."""
    axes = [axis for axis in grid.loop_axes if not is_plain(grid.spec, axis.path)]
    resolved = {}
    for values in product(*(axis.values for axis in axes)):
        changes = {axis.path: value for axis, value in zip(axes, values, strict=True)}
        try:
            resolved[tuple(changes.items())] = dict((grid.spec.with_values(changes) if changes else grid.spec).values)
        except SpecError as error:
            named = ", ".join(f"{axis.name} = {value!r}" for axis, value in zip(axes, values, strict=True))
            raise UsageError(f"[{table}]: every combination is computed, and {named} makes no loop: {error}") from error
    return resolved


def bounds_of(path, span):
    """Values of the key between which the drawing exists; a gain may go a little below zero."""
    key, (low, high) = KEYS[path], span
    below = low / 2 if key.above_low or key.low != 0 else -np.inf
    return below, np.inf if key.high is None else (high + key.high) / 2


def cut_otherwise(job: Job, **sizes) -> Job:
    """The same job in chunks of other sizes (deep, wide)."""
    return replace(job, chunks=replace(job.chunks, **sizes))


AXIS_BYTES = 12  # of an axis in a row of CSV and Parquet file together


def expected_bytes(job: Job) -> int:
    """Bytes of disk that the run needs at its end, before the finished chunks are removed, roughly."""
    row = job.row_bytes + AXIS_BYTES * len(job.grid.axes)
    return int(job.rows * (job.slices * job.dtype.itemsize + job.size * row))


def refuse_full_disk(folder: Path | None, jobs: Iterable[Job]) -> None:
    """Raise UsageError if the disk of `folder`, in which the jobs keep their chunks, cannot hold their results.

    Chunks of a run that was stopped are counted as part of the results.
    """
    if folder is None:
        return
    place = next(each for each in (folder, *folder.absolute().parents) if each.is_dir())
    kept = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) if place == folder else 0
    need, free = sum(map(expected_bytes, jobs)) - kept, free_bytes(place)
    if need > free:
        raise UsageError(
            f"{folder.parent}: the run needs about {need / 1e9:.3g} GB, found {free / 1e9:.3g} GB free on this disk; name "
            "another folder for the results, or sweep fewer values"
        )


PROBES = 6  # samples of the sweep
SHARE = 10  # a sample is so many times smaller than a chunk: large enough that the overhead of a batch does not decide
FEW_DRAWN = 8  # loops of a sample that share no drawing
LONGEST = 0.3  # s; no further sample after that


def expected_seconds(job: Job) -> float:
    """Seconds of work in one process for the whole job, estimated from a small part of it."""
    samples = _samples(job)
    samples[0][0].records()  # the first call of everything costs more than it will later
    started, seconds, slices = time.perf_counter(), 0.0, 0
    for sample, size in samples:
        sample.records()
        seconds, slices = time.perf_counter() - started, slices + size
        if seconds > LONGEST:
            break
    return seconds / slices * job.slices


def _samples(job):
    """Small tasks of the job and the numbers of their slices, alternately from its ends and its middle."""
    chunks = job.chunks
    enough = max(1, chunks.deep * chunks.wide // SHARE)
    wide = min(chunks.walls, enough)
    deep = max(1, enough // wide)
    if 2 * len(job.resolved) > chunks.loops:  # nearly every loop is drawn for itself, and few of them show the time
        deep = min(deep, FEW_DRAWN)
    small = cut_otherwise(job, deep=deep, wide=wide)
    shares = np.linspace(0, 1, PROBES)[[0, 3, 5, 1, 4, 2]]
    numbers = dict.fromkeys(np.rint(shares * (len(small.chunks) - 1)).astype(int).tolist())
    return [(small.task(small.chunks[number]), small.chunks[number].slices) for number in numbers]
