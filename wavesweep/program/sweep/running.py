"""A run: jobs computed chunk by chunk on workers, kept in checkpoints, and from there the rows
of a table."""

import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, fields
from functools import partial
from numbers import Integral
from os import PathLike
from pathlib import Path
from types import NoneType
from typing import TypedDict

import numpy as np

from wavesweep.engine.arguments import boolean
from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import nearest
from wavesweep.program.columns import Columns, joined
from wavesweep.program.platform_compat import one_thread, versions
from wavesweep.program.store.checkpoint import DamagedError, FileCheckpoint, MemoryCheckpoint
from wavesweep.program.sweep.estimates import SLOW_SLICE, expected_seconds, refuse_full_disk
from wavesweep.program.sweep.job import Job, naming_values
from wavesweep.program.sweep.progress_bar import Progress, reporting
from wavesweep.program.sweep.workers import WORTH, Workers, choose, results

# combinations of a block of rows; 13 columns of them take some 15 MB, 22 of responses 25 MB
ROWS_OF_BLOCK = 1 << 17


class WorkOptions(TypedDict, total=False):
    """The arguments of a call that say how its run is done, see `Work`."""

    jobs: int | None
    backend: str | None
    scheduler: str | None
    progress: Progress | bool | None
    checkpoint: Path | str | None
    force: bool
    part: str


@dataclass(frozen=True, slots=True)
class Work:
    """How a run is done.

    jobs: number of worker processes if the work is worth them. backend: one of `BACKENDS`, which is
    then used in any case. scheduler: address of a dask scheduler. progress: is called with the
    number of slices done, of all slices, and of certified ones, None if no slice can be; True shows
    a bar. checkpoint: file for finished chunks, from which a run of the same spec goes on; by default they
    stay in memory. force: begin anew, whatever it holds. part: of the checkpoint, if several runs
    keep their chunks in one. Errors: UsageError.
    """

    jobs: int | None = None
    backend: str | None = None
    scheduler: str | None = None
    progress: Progress | bool | None = None
    checkpoint: Path | str | None = None
    force: bool = False
    part: str = ""

    @staticmethod
    def of(given: Mapping[str, object]) -> "Work":
        """Return the work that the arguments of a caller describe."""
        names = [field.name for field in fields(Work)]
        if unknown := [name for name in given if name not in names]:
            meant = nearest(unknown[0], names)
            hint = f"; did you mean {meant}?" if meant else ""
            raise UsageError(
                f"{unknown[0]}: expected one of the arguments {', '.join(names)}, found an unknown one{hint}"
            )
        return Work(**given)

    def __post_init__(self):
        integral = isinstance(self.jobs, Integral) and not isinstance(self.jobs, bool)
        if self.jobs is not None and not (integral and self.jobs >= 1):
            raise UsageError(f"jobs: expected a whole number >= 1, found {self.jobs!r}")
        if self.scheduler is not None and self.backend != "dask":
            raise UsageError(
                f'scheduler: expected backend = "dask" beside it, found {self.backend!r}'
            )
        if not isinstance(self.checkpoint, (str, PathLike, NoneType)):
            raise UsageError(f"checkpoint: expected a file, found {self.checkpoint!r:.60}")
        object.__setattr__(self, "force", boolean("force", self.force))
        object.__setattr__(self, "checkpoint", self.checkpoint and Path(self.checkpoint))


@dataclass(slots=True)
class RunCounts:
    """Counts of slices, of those taken from a checkpoint, of certified ones and of records, and
    the seconds of the workers."""

    done: int = 0
    kept: int = 0
    certified: int = 0
    records: int = 0
    seconds: float = 0.0

    def add(
        self, job: Job, records: np.ndarray, seconds: float = 0.0, *, kept: bool = False
    ) -> None:
        """Count a chunk; kept: whether it was in the checkpoint."""
        # of each slice, by which they are sorted
        first = np.diff(records["slice"], prepend=-1) != 0
        self.done += int(first.sum())
        self.kept += int(first.sum()) * kept
        self.certified += int((records["certified"] & first).sum()) if job.kind.certifies else 0
        self.records += len(records)
        self.seconds += seconds


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Jobs whose chunks are all finished, with their checkpoints and counts; the keys are the
    names of the jobs."""

    jobs: Mapping[str, Job]
    stores: Mapping[str, object]
    tallies: Mapping[str, RunCounts]
    workers: Workers
    seconds: float
    warnings: list[str]

    @property
    def certified(self) -> int:
        """Number of certified slices."""
        return sum(tally.certified for tally in self.tallies.values())

    @property
    def rows(self) -> int:
        """Number of rows of all jobs; those of a slice are repeated for each combination of axes
        that it does not depend on."""
        return sum(
            self.tallies[name].records * job.size // job.slices
            for name, job in self.jobs.items()
            if job.slices
        )

    @property
    def timings(self) -> dict[str, float]:
        """Seconds of the run and in the workers, the number of workers of the last job, and
        slices of earlier runs."""
        return {
            "compute_s": self.seconds,
            "processor_s": sum(tally.seconds for tally in self.tallies.values()),
            "workers": self.workers.count,
            "slices_from_checkpoint": sum(tally.kept for tally in self.tallies.values()),
        }

    def blocks(self, name: str) -> Iterator[Columns]:
        """Yield the rows of a job in blocks."""
        return blocks(self.jobs[name], self.stores[name])

    def forget(self) -> None:
        """Remove the checkpoint, or of one that holds another run as well the chunks of this
        one."""
        for store in self.stores.values():
            try:
                store.remove()
            except OSError as error:
                self.warnings.append(
                    f"{store.place}: {error.strerror}; the next run removes this checkpoint"
                )


def run(jobs: Mapping[str, Job], work: Work = Work()) -> Run:
    """Compute jobs one after the other; their names are those in the checkpoint.

    Raises UsageError (disk, workers), CheckpointError (of another run), WavesweepError (a worker
    process died).
    """
    started = time.perf_counter()
    refuse_full_disk(work.checkpoint, jobs.values())
    total = sum(job.slices for job in jobs.values())
    tallies = {}
    stores = {}
    warnings: list[str] = []
    workers = None
    for name, job in jobs.items():
        stores[name] = checkpoint_of(job, work.checkpoint, work.force, warnings, work.part + name)
        tallies[name] = kept_of(
            job, stores[name]
        )  # of all jobs first: what is kept is not done in no time later on
        if stores[name].place and len(jobs) > 1:
            stores[name].close()  # one of them at a time has the file open
    with reporting(work.progress) as report:
        for name, job in jobs.items():
            others = [tally for other, tally in tallies.items() if other != name]
            report_job = report and _continued(report, total, others)
            begun = stores[name], tallies[name], report_job
            workers = choose(
                work.jobs,
                work.backend,
                work.scheduler,
                len(job.chunks),
                partial(_expected, job, *begun),
            )
            compute(job, stores[name], workers, report_job, tallies[name])
    return Run(jobs, stores, tallies, workers, time.perf_counter() - started, warnings)


def in_memory(job: Job, progress: Progress | None = None) -> Columns:
    """The table of a job, computed in this process."""
    store = MemoryCheckpoint()
    with one_thread():
        compute(job, store, Workers(1, None, None, "as a library"), progress)
    return joined(blocks(job, store))


def checkpoint_of(
    job: Job, place: Path | None, force: bool, warnings: list[str], name: str = ""
) -> MemoryCheckpoint | FileCheckpoint:
    """The checkpoint of a job: in the file `place`; without one, or for a single chunk, in memory
    or a file without a name.

    force, warnings, name and errors: see `FileCheckpoint`. Chunks of runs that differ in any part
    of their identity are never mixed.
    """
    chunks = job.chunks
    # Bytes of records, about; more go to a file without a name.
    small = place is None and job.kind.rows * job.slices * job.dtype.itemsize <= 1 << 26
    if small or len(chunks) < 2:
        return MemoryCheckpoint()
    identity = {"layout": 5, "spec_sha256": job.grid.spec.sha256, **versions()}
    identity |= {"chunks": [chunks.loops, chunks.points, chunks.deep, chunks.wide], **job.identity}
    return FileCheckpoint(place, name, identity, job.dtype, force, warnings)


def _expected(job, store, tally, report):
    """Seconds of work; not more than there are, and not measured, if already these are worth
    workers. Chunks of one slice are measured by computing the first two, which are kept."""
    least = 1e-6 * job.slices - job.kind.ready  # s of a slice: none takes less
    if least > WORTH:
        return least
    if job.chunks.deep * job.chunks.wide > 1:
        return expected_seconds(job) - job.kind.ready
    finished = set(store.finished())
    missing = [each for each in job.chunks.spread(range(len(job.chunks))) if each not in finished]
    here = Workers(1, None, None, "measured")
    seconds = 0.0
    measured = 0
    # Two chunks of one slice tell the time of the others; the first also loads what these find
    # loaded.
    for number in missing[:2]:
        before = tally.seconds
        compute(job, store, here, report, tally, range(number, number + 1))
        seconds = tally.seconds - before
        measured += 1
        if seconds > SLOW_SLICE:
            break
    return seconds * (len(missing) - measured) - job.kind.ready


def _continued(progress, total, others):
    """The reports of one job as reports of all of them; others: the tallies of the others,
    finished or what is kept of them."""
    done, certified = sum(tally.done for tally in others), sum(tally.certified for tally in others)
    return lambda now, _, proved: progress(
        done + now, total, None if proved is None else certified + proved
    )


def compute(
    job: Job,
    store,
    workers: Workers,
    progress: Progress | None = None,
    tally: RunCounts | None = None,
    numbers: range | None = None,
) -> None:
    """Compute every chunk that the checkpoint `store` does not have yet, and save it there.

    tally: of what is kept, see `kept_of`, which these are added to. numbers: of the chunks, by
    default all.
    """
    numbers, tally = range(len(job.chunks)) if numbers is None else numbers, tally or RunCounts()
    finished = set(store.finished())
    missing = (number for number in job.chunks.spread(numbers) if number not in finished)

    def report():
        if progress:
            progress(
                min(tally.done, job.slices),
                job.slices,
                tally.certified if job.kind.certifies else None,
            )

    computed = results(workers, missing, lambda number: job.task(job.chunks[number]))
    with resumable(job, store, tally), closing(computed), naming_values(job):
        report()
        for number, records, seconds in computed:
            store.save(number, records)
            tally.add(job, records, seconds)
            report()


def kept_of(
    job: Job, store, numbers: range | None = None, tally: RunCounts | None = None
) -> RunCounts:
    """The tally of what the checkpoint `store` has of a job, without the chunks of it that are
    damaged.

    numbers: of the chunks, by default all. tally: that of other chunks of the job, which these are
    added to.
    """
    numbers, tally = range(len(job.chunks)) if numbers is None else numbers, tally or RunCounts()
    for number in (chunk for chunk in store.finished() if chunk in numbers):
        try:
            tally.add(job, store.load(number), kept=True)
        except DamagedError as error:
            store.set_aside(number, error)
    return tally


@contextmanager
def resumable(job: Job, store, tally: RunCounts) -> Iterator[None]:
    """Say in an error which part of the job the checkpoint keeps, once; remove a checkpoint of a
    request that is refused.

    A request that is refused has finished nothing.
    """
    try:
        yield
    except BaseException as error:
        if isinstance(error, UsageError) and not tally.done:
            with suppress(OSError):
                store.remove()
        elif (
            tally.done
            and store.place
            and store.place.is_file()
            and not getattr(error, "__notes__", ())
        ):
            told = f"{min(tally.done, job.slices)} of {job.slices} {job.kind.noun} are kept in {store.place}"
            error.add_note(f"{told}; the same command goes on from there.")
        with suppress(OSError):
            store.close()
        raise


def records_of(job: Job, store, number: int) -> np.ndarray:
    """The records of a finished chunk; if it was damaged meanwhile, it is computed again."""
    try:
        return store.load(number)
    except DamagedError as error:
        store.set_aside(number, error)
        store.save(number, job.task(job.chunks[number])())
        return store.load(number)


def blocks(job: Job, store) -> Iterator[Columns]:
    """Yield the table's columns for consecutive combinations; store: a checkpoint in which all
    chunks are finished."""
    for combination in stretches(job.size):
        index, records = gather(job, store, job.slice_of(combination))
        yield job.columns(combination[index], records)


def stretches(size: int) -> Iterator[np.ndarray]:
    """Yield the numbers of the combinations of each block."""
    return (
        np.arange(start, min(start + ROWS_OF_BLOCK, size))
        for start in range(0, size, ROWS_OF_BLOCK)
    )


def gather(job: Job, store, slices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For the records of the slices, in their order, the index of the slice in `slices`; and the
    records.

    If neighbouring rows are in different chunks, each chunk is read again for every block that has
    rows of it: from the page cache, at a cost far below that of computing it.
    """
    if len(job.chunks) == 1 and np.array_equal(slices, np.arange(job.slices)):
        records = records_of(job, store, 0)
        return records["slice"], records
    owner = job.chunks.of(slices)
    order = np.argsort(owner, kind="stable")
    index, chunks_of_records = [], []
    for members in np.split(order, np.flatnonzero(np.diff(owner[order])) + 1):
        chunk = job.chunks[int(owner[members[0]])]
        records = records_of(job, store, chunk.number)
        first, end = (
            np.searchsorted(records["slice"], slices[members] - chunk.first, side=side)
            for side in ("left", "right")
        )
        rows = end - first
        index.append(np.repeat(members, rows))
        if np.array_equal(first[1:], end[:-1]):  # neighbours, which need no copy
            chunks_of_records.append(records[first[0] : end[-1]])
            continue
        chunks_of_records.append(
            records[np.repeat(first - (np.cumsum(rows) - rows), rows) + np.arange(rows.sum())]
        )
    index = np.concatenate(index)
    records = np.concatenate(chunks_of_records)
    if (np.diff(index) >= 0).all():
        return index, records
    back = np.argsort(index, kind="stable")
    return index[back], records[back]
