"""The job of a table, settled before any computing: slices in chunks, tasks for workers, columns for their records."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar, TypeVar

import numpy as np

from wavesweep.errors import IllPosedLoopError, SpecError, UsageError
from wavesweep.spec.checking import show
from wavesweep.sweep.grid import Grid, groups, is_plain
from wavesweep.sweep.pools import Task

SECONDS = 0.3  # that a chunk should take: if it takes longer, a crash loses more; if shorter, handing it out costs more
CHECKED = 100_000  # loops whose numbers are checked before anything is computed; those of more are checked chunk by chunk
FEWEST, MANY, MOST = 16, 4096, 16384  # slices of a chunk; more would leave the processor's cache
ENOUGH = 32  # chunks, from which on they may have more than MANY slices: the last ones leave no worker idle for long


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
class Job(ABC):
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
    @abstractmethod
    def identity(self) -> dict[str, object]:
        """Names and values that the records depend on besides the spec, the versions and the chunks, JSON-able."""

    def slice_of(self, combination) -> np.ndarray:
        """Number of the slice of each combination."""
        return self.grid.slice_of(combination)

    @abstractmethod
    def task(self, chunk: Chunk) -> Task:
        """The task of a worker for that chunk."""

    def columns(self, combination: np.ndarray, records: np.ndarray) -> Mapping[str, np.ndarray]:
        """The table's columns for records of these combinations, one for each record: by default the fields as they are."""
        del combination
        return {name: records[name] for name in self.dtype.names if name != "slice"}

    def slices_of(self, chunk: Chunk) -> int:
        """Number of slices of a chunk."""
        return chunk.slices

    @abstractmethod
    def certified(self, records: np.ndarray) -> int:
        """How many slices of these records are certified."""


AnyJob = TypeVar("AnyJob", bound=Job)


def cut_up(loops: int, walls: int, cost: float) -> Chunks:
    """The slices in chunks of about `SECONDS`; cost: expected s per slice."""
    slices = int(np.clip(SECONDS / cost, FEWEST, np.clip(loops * walls // ENOUGH, MANY, MOST)))
    if walls > slices:
        return Chunks(loops, walls, 1, slices)
    return Chunks(loops, walls, slices // walls, walls)


def cut_otherwise(job: AnyJob, **sizes: int) -> AnyJob:
    """The same job in chunks of other sizes (deep, wide)."""
    return replace(job, chunks=replace(job.chunks, **sizes))


@contextmanager
def naming_values(job: Job) -> Iterator[None]:
    """Put the values of the axes in front of an error of a loop without a solution, if it comes out of a chunk of the job."""
    try:
        yield
    except IllPosedLoopError as error:
        values = "" if error.chunk is None else _unsolvable(job, job.chunks[error.chunk])
        if not values:
            raise
        raise IllPosedLoopError(f"{values}: {error}") from error


def _unsolvable(job, chunk):
    """The axes' values of the first loop of a chunk that has no solution, as a text."""
    at = {"loops": chunk.loops, "walls": chunk.walls}
    for each in ("loops", "walls"):
        while len(at[each]) > 1:
            half = len(at[each]) // 2
            first = at | {each: at[each][:half]}
            at = first if _fails(job, first) else at | {each: at[each][half:]}
    if not _fails(job, at):
        return ""
    values = job.grid.loop_values(np.array(at["loops"][:1]))
    return ", ".join(f"{axis.name} = {show(values[axis.path][0].item())}" for axis in job.grid.axes if axis.path in values)


def _fails(job, ranges):
    try:
        job.task(Chunk(0, first=0, **ranges)).records()
    except IllPosedLoopError:
        return True
    return False


def resolve_all(grid: Grid, table: str = "sweep", *, rates: bool = False) -> dict:
    """The spec's values for each combination of the axes that go through the spec; rates: see `groups`.

    Errors: UsageError if a combination makes no loop.
    """
    paths = [axis.path for axis in grid.loop_axes] if rates else None
    axes = [axis for axis in grid.loop_axes if not is_plain(grid.spec, axis.path, paths)]
    resolved = {}
    for values in product(*(axis.values for axis in axes)):
        changes = {axis.path: value for axis, value in zip(axes, values, strict=True)}
        try:
            resolved[tuple(changes.items())] = dict((grid.spec.with_values(changes) if changes else grid.spec).values)
        except SpecError as error:
            named = ", ".join(f"{axis.name} = {value!r}" for axis, value in zip(axes, values, strict=True))
            raise UsageError(f"[{table}]: every combination is computed, and {named} makes no loop: {error}") from error
    if grid.spec.drawing:
        _refuse_unsuitable(grid, resolved)
    return resolved


def _refuse_unsuitable(grid: Grid, resolved: dict) -> None:
    """Raise UsageError if `some_loops` of the grid have numbers that make no loop."""
    from wavesweep.loops.from_drawing import refuse_unsuitable

    index = some_loops(grid)
    place = grid.loop_axes[0].place.location() if len(grid.loop_axes) == 1 else ""  # of several it is not known which
    for _, values in groups(grid.spec, grid.loop_values(index), index.size, resolved):
        try:
            refuse_unsuitable(grid.spec.drawing, values)
        except UsageError as error:
            raise UsageError(f"{place}: {error}" if place else str(error)) from error


def some_loops(grid: Grid) -> np.ndarray:
    """The numbers of all loops or, if they are very many, of CHECKED ones from the first to the last."""
    if grid.loops <= CHECKED:
        return np.arange(grid.loops)
    return np.unique(np.linspace(0, grid.loops - 1, CHECKED).astype(int))
