"""A job: what a table needs of every loop of a grid, settled before any computing and cut into
chunks for workers."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.keys import show
from wavesweep.program.sweep.grid import Grid, own_loop
from wavesweep.program.sweep.pools import Task

# that a chunk should take: if it takes longer, a crash loses more; if shorter, handing it out costs
# more
SECONDS_OF_CHUNK = 0.3
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
    across: int = field(init=False)  # number of chunks of the points of a loop

    def __post_init__(self):
        object.__setattr__(self, "across", -(-self.points // self.wide))

    def __len__(self) -> int:
        return -(-self.loops // self.deep) * self.across

    def __getitem__(self, number: int) -> Chunk:
        down, across = divmod(number, self.across)
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
        return loop // self.deep * self.across + point // self.wide


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

    dtype: of the records, whose field `slice` counts from 0 in the chunk. identity: what the
    records depend on besides the spec, the versions and the chunks, JSON-able.
    asked: what the kind needs besides. slices: number of those that are computed, all of the
    chunks unless it is given.
    """

    kind: JobKind
    grid: Grid
    chunks: Chunks
    dtype: np.dtype
    identity: Mapping[str, object]
    asked: Any = None
    slices: int = 0

    def __post_init__(self):
        if not self.slices:
            object.__setattr__(self, "slices", self.chunks.loops * self.chunks.points)

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
