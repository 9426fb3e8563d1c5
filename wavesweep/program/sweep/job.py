"""A job: what a table needs of every loop of a grid, settled before any computing and cut into
chunks for workers."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError, SpecError, UsageError
from wavesweep.engine.keys import show
from wavesweep.engine.loop import Loops
from wavesweep.program.sweep.grid import Grid, groups, is_plain, own_loop
from wavesweep.program.sweep.pools import Task

# that a chunk should take: if it takes longer, a crash loses more; if shorter, handing it out costs
# more
SECONDS_OF_CHUNK = 0.3
# loops whose numbers are checked before anything is computed; those of more are checked chunk by
# chunk
CHECKED = 100_000
# slices of a chunk; each costs some 16 ms by itself, and with twice as many a worker takes 70 MB more
FEWEST, MOST = 16, 8192
MOST_DRAWN = 256  # of drawn loops
MOST_SLOW = 128  # of those by panels or with dead times: one may take 20 ms


@dataclass(frozen=True, slots=True)
class Chunk:
    """The loops `loops` at the points `points` (index ranges); its slices are consecutive, from
    `first` on."""

    number: int
    loops: range
    points: range
    first: int

    @property
    def slices(self) -> int:
        """Number of its slices."""
        return len(self.loops) * len(self.points)


@dataclass(frozen=True, slots=True)
class Chunks:
    """All chunks of `loops x points` slices, slice = loop * points + point; each of `deep` loops
    and `wide` points at most.

    A chunk is several loops with all their points, or a part of the points of one loop, so its
    slices are consecutive. The results do not depend on the borders of the chunks.
    """

    loops: int
    points: int
    deep: int
    wide: int

    def __len__(self) -> int:
        return -(-self.loops // self.deep) * self._across

    @property
    def _across(self):
        return -(-self.points // self.wide)

    def __getitem__(self, number: int) -> Chunk:
        down, across = divmod(number, self._across)
        loops = range(down * self.deep, min((down + 1) * self.deep, self.loops))
        points = range(across * self.wide, min((across + 1) * self.wide, self.points))
        return Chunk(number, loops, points, loops.start * self.points + points.start)

    def spread(self, numbers: range) -> Iterator[int]:
        """Yield numbers of chunks, the first ones far apart: slices that take longer lie together,
        and these tell of all.

        The order is that of van der Corput: 0, a half, a quarter, three quarters, ...
        """
        bits = max(len(numbers) - 1, 0).bit_length()
        for order in range(1 << bits):
            at = int(f"{order:0{bits}b}"[::-1], 2) if bits else 0
            if at < len(numbers):
                yield numbers[at]

    def of(self, slices) -> np.ndarray:
        """Number of the chunk that each slice is in."""
        loop, point = np.divmod(slices, self.points)
        return loop // self.deep * self._across + point // self.wide


def fields_of(job: "Job", combination: np.ndarray, records: np.ndarray) -> Mapping[str, np.ndarray]:
    """The fields of the records as columns."""
    del combination
    return {name: records[name] for name in job.dtype.names if name != "slice"}


@dataclass(frozen=True, slots=True)
class JobKind:
    """A kind of analysis, as functions of its jobs.

    task: gives what computes the records of a chunk. columns: those of the table, for records of
    these combinations. noun: of the slices, in messages. certifies: whether slices can be
    certified. has_rows: whether the slices are rows of a table. rows: of the table for each
    combination, about. row_bytes: of such a row in its files, without its axes. ready: s that
    workers take longer than usual until they are ready. sample: gives the job whose samples are
    timed in place of a job, and how many times as long that one takes for each slice.
    """

    task: Callable[["Job", Chunk], Task]
    columns: Callable[["Job", np.ndarray, np.ndarray], Mapping[str, np.ndarray]] = fields_of
    noun: str = "slices"
    certifies: bool = True
    has_rows: bool = True
    rows: float = 1.0
    row_bytes: int = 0
    ready: float = 0.0
    sample: Callable[["Job"], tuple["Job", float]] = lambda job: (job, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """Records for every slice of a grid, cut into chunks, and the columns that they make.

    resolved: the spec's values for each combination of those axes that are whole numbers or that
    other keys derive from. dtype: of the records, whose field `slice` counts from 0 in the chunk.
    identity: what the records depend on besides the spec, the versions and the chunks, JSON-able.
    asked: what the kind needs besides. total: number of slices if it is not that of the chunks.
    """

    kind: JobKind
    grid: Grid
    chunks: Chunks
    resolved: dict
    dtype: np.dtype
    identity: Mapping[str, object]
    asked: Any = None
    total: int | None = None

    @property
    def slices(self) -> int:
        """Number of slices that are computed."""
        if self.total is None:
            return self.chunks.loops * self.chunks.points
        return self.total

    @property
    def size(self) -> int:
        """Number of combinations that have rows."""
        if self.kind.has_rows:
            return self.grid.size * self.chunks.points
        return 0

    def slice_of(self, combination) -> np.ndarray:
        """Number of the slice of each combination, points innermost."""
        at, point = np.divmod(combination, self.chunks.points)
        return self.grid.slice_of(at) * self.chunks.points + point

    def task(self, chunk: Chunk) -> Task:
        """What computes the records of a chunk."""
        return self.kind.task(self, chunk)

    def columns(self, combination: np.ndarray, records: np.ndarray) -> Mapping[str, np.ndarray]:
        """The table's columns for records of these combinations, one for each record."""
        return self.kind.columns(self, combination, records)

    def loop_values(self, chunk: Chunk) -> dict[str, np.ndarray]:
        """Path -> values of the loops of a chunk."""
        return self.grid.loop_values(np.arange(chunk.loops.start, chunk.loops.stop))


def cut_otherwise(job: Job, **sizes: int) -> Job:
    """The same job in chunks of other sizes (deep, wide)."""
    return replace(job, chunks=replace(job.chunks, **sizes))


@contextmanager
def naming_values(job: Job) -> Iterator[None]:
    """Put the values of the axes in front of an error of a loop without a solution, if it comes out
    of a chunk of the job.

    An error for want of memory is told how large the loops are that take it.
    """
    try:
        yield
    except MemoryError as error:
        drawn = own_loop(job.grid.spec).drawn()
        slices = min(job.slices, job.chunks.deep * job.chunks.wide)
        size = f"{len(drawn.labels())} states and {drawn.ticks} ticks a frame, of which up to {slices} are computed at once"
        error.add_note(
            f"It is taken by loops of {size}; fewer values per axis, fewer --jobs, fewer ticks of delay "
            "or shorter frames take less."
        )
        raise
    except IllPosedLoopError as error:
        if error.chunk is None:
            values = ""
        else:
            values = _unsolvable(job, job.chunks[error.chunk])
        if not values:
            raise
        raise IllPosedLoopError(f"{values}: {error}") from error


def _unsolvable(job, chunk):
    """The axes' values of the first loop of a chunk that has no solution, as a text."""
    at = {"loops": chunk.loops, "points": chunk.points}

    def fails(ranges):
        try:
            job.task(Chunk(0, first=0, **ranges))()
        except IllPosedLoopError:
            return True
        return False

    for side in ("loops", "points"):
        while len(at[side]) > 1:
            half = len(at[side]) // 2
            first = at | {side: at[side][:half]}
            at = first if fails(first) else at | {side: at[side][half:]}
    if not fails(at):
        return ""
    values = job.grid.loop_values(np.array(at["loops"][:1]))
    return ", ".join(
        f"{axis.name} = {show(values[axis.path][0].item())}"
        for axis in job.grid.axes
        if axis.path in values
    )


def resolve_all(grid: Grid, table: str = "sweep", *, rates: bool = False) -> dict:
    """The spec's values for each combination of the axes that go through the spec; rates: see
    `groups`.

    Errors: UsageError if a combination makes no loop, or if numbers of `some_loops` make none.
    """
    paths = [axis.path for axis in grid.loop_axes] if rates else None
    axes = [axis for axis in grid.loop_axes if not is_plain(grid.spec, axis.path, paths)]
    resolved = {}
    for values in product(*(axis.values for axis in axes)):
        changes = {axis.path: value for axis, value in zip(axes, values, strict=True)}
        try:
            resolved[tuple(changes.items())] = dict(
                (grid.spec.with_values(changes) if changes else grid.spec).values
            )
        except SpecError as error:
            named = ", ".join(
                f"{axis.name} = {value!r}" for axis, value in zip(axes, values, strict=True)
            )
            raise UsageError(
                f"[{table}]: every combination is computed, and {named} makes no loop: {error}"
            ) from error
    if grid.spec.drawing:
        _refuse_unsuitable_loops(grid, resolved)
    return resolved


def _refuse_unsuitable_loops(grid, resolved):
    """Raise UsageError if the numbers of one of `some_loops` make no loop, with the place of the
    axis if there is only one."""

    index = some_loops(grid)
    place = grid.loop_axes[0].place.location() if len(grid.loop_axes) == 1 else ""
    for _, values in groups(grid.spec, grid.loop_values(index), index.size, resolved):
        try:
            Loops(grid.spec.drawing, values).refuse_unsuitable()
        except UsageError as error:
            raise UsageError(f"{place}: {error}" if place else str(error)) from error


def some_loops(grid: Grid) -> np.ndarray:
    """The numbers of all loops or, if they are very many, of CHECKED ones from the first to the
    last."""
    if grid.loops <= CHECKED:
        return np.arange(grid.loops)
    return np.unique(np.linspace(0, grid.loops - 1, CHECKED).astype(int))
