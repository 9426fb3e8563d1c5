"""The workers that a sweep runs on: none, processes of this machine, or those of a dask cluster.

A worker that dies is an error within seconds. Processes that are started here leave Ctrl-C to this
one, end when it ends, and run nothing of the current folder.
"""

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from contextlib import closing
from dataclasses import dataclass
from itertools import islice
from tempfile import TemporaryDirectory

import numpy as np

from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.platform_compat import processors, versions, why_no_processes
from wavesweep.program.sweep.pools import (
    AHEAD,
    attested,
    folder_of_chunks,
    in_parallel,
    left_in,
    timed,
)

STARTED = "loky"  # the backend whose workers share the processors of this machine
THREADS = "threading"
BACKENDS = ("dask", STARTED, THREADS)
TASK, TINY = 1.0, 1e-3  # s that a task on a cluster should take, and that it takes at least
LOOK_AT_POOL = 2.0  # s between two looks at a pool
SILENT = 20.0  # s without a result after which the run says so
PROCESSES = 2  # by default
LOGGER = logging.getLogger(
    "wavesweep"
)  # Python writes its warnings to stderr, unless somebody listens
# s of work; two new processes, joblib here and the process that keeps their semaphores take some 2.5 s of processor
# time until their first chunks are done: two processors save nothing below this
WORTH = 2.5


@dataclass(frozen=True, slots=True)
class Workers:
    """`count` workers of a backend, or this process (count 1, backend None), and why these were
    chosen."""

    count: int
    backend: str | None
    scheduler: str | None
    why: str


def refuse_backend(backend: str | None) -> None:
    """Raise UsageError for a backend that is unknown, whose package is missing, or that cannot
    keep its promises."""
    if backend == "multiprocessing":
        raise UsageError(
            "backend multiprocessing: its pool never notices that a worker has died; use loky"
        )
    if backend is not None and backend not in BACKENDS:
        raise UsageError(f"backend {backend}: expected one of {', '.join(BACKENDS)}")
    if backend == "dask":
        from wavesweep.program.sweep.clusters import imported

        imported()


def excess(jobs: int, backend: str | None) -> str:
    """A sentence if fewer workers are used than `jobs`, otherwise an empty text."""
    if backend not in (None, STARTED) or jobs <= max(PROCESSES, processors()):
        return ""
    return f"--jobs {jobs}: this machine has {processors()} processors for wavesweep, and no more workers are used"


def choose(
    jobs: int | None,
    backend: str | None,
    scheduler: str | None,
    chunks: int,
    seconds: Callable[[], float],
) -> Workers:
    """Decide which workers compute `chunks` chunks.

    jobs: largest number of workers, PROCESSES if None; no more than there are processors are used.
    seconds: estimates the time in this process, called only if it matters. Raises UsageError for a
    backend that cannot be used.
    """
    refuse_backend(backend)
    jobs = jobs or PROCESSES
    useful = max(1, min(jobs, processors()))
    if backend is not None:
        return Workers(
            jobs if backend == "dask" else useful,
            backend,
            scheduler,
            f"the backend {backend} was asked for",
        )
    if jobs == 1:
        return Workers(1, None, None, "one job was asked for")
    if chunks < 2:
        return Workers(1, None, None, "a single chunk of work")
    if useful < 2:
        return Workers(1, None, None, "a single processor")
    expected = seconds()
    if expected < WORTH:
        return Workers(1, None, None, f"work below {WORTH:g} s is faster without workers")
    if alone := why_no_processes():
        return Workers(1, None, None, alone)
    why = f"estimated {max(1, round(expected))} s of work"
    return Workers(min(useful, chunks), STARTED, None, why)


def results(workers: Workers, numbers: Iterable[int], task_of: Callable) -> Iterator[tuple]:
    """Yield (number, records, seconds) of every chunk as it is finished, in no particular order.

    task_of(number): what computes the chunk's records, made when it is handed out. Raises
    UsageError for a backend that cannot be used, WavesweepError if a worker dies, has other
    versions, or a cluster is lost. Closing the generator ends the workers.
    """
    calls = ((number, task_of(number)) for number in numbers)
    if workers.backend is None:
        for call in calls:
            yield timed(*call)
        return
    refuse_backend(workers.backend)
    elsewhere = {STARTED: _on_machine, THREADS: _in_threads}.get(workers.backend, _on_cluster)
    yield from elsewhere(workers, calls)


def _on_machine(workers, calls):
    """The results of new processes of this machine."""
    with TemporaryDirectory(dir=folder_of_chunks(), ignore_cleanup_errors=True) as folder:
        calls = ((left_in, folder, timed, *call) for call in calls)
        with closing(in_parallel(workers.count, calls)) as answers:
            for answer in answers:
                file, number, seconds = _of_our_version(*answer)
                records = np.load(file)
                file.unlink()
                yield number, records, seconds


def _in_threads(workers, calls):
    """The results of threads of this process, which share its interpreter: of use where no
    process can be started."""
    from joblib import Parallel, delayed

    ahead = AHEAD * workers.count
    run = Parallel(workers.count, THREADS, return_as="generator_unordered", pre_dispatch=ahead)
    with closing(run(delayed(timed)(*call) for call in calls)) as answers:
        yield from answers


def _on_cluster(workers, calls):
    """The results of the workers of a dask scheduler, to which quick chunks go several at a
    time."""
    from wavesweep.program.sweep.clusters import CHUNKS_OF_TASK, dask

    with dask(workers) as pool:
        silence, size = Silence(), 1

        def handed_out(count):
            batches = (list(islice(calls, size)) for _ in range(count))
            return {pool.submit(attested, each_of, timed, batch) for batch in batches if batch}

        waiting = handed_out(AHEAD * pool.count)
        while waiting:
            done, waiting = wait(waiting, LOOK_AT_POOL, FIRST_COMPLETED)
            if done:
                silence.end()
            else:
                silence.go_on(f"{len(waiting)} tasks are with {pool.look()}")
            for future in done:
                waiting |= handed_out(1)
                results = _of_our_version(*future.result())
                seconds = sum(taken_s for *_, taken_s in results)
                size = max(1, min(CHUNKS_OF_TASK, int(TASK * len(results) / max(TINY, seconds))))
                yield from results


def each_of(function: Callable, calls: list[tuple]) -> list:
    """The results of a function for the arguments of each call."""
    return [function(*call) for call in calls]


def _of_our_version(results, theirs):
    """What a worker has computed. Raises WavesweepError if it has other versions, on which the
    last digits depend."""
    if theirs != versions():
        ours, their_words = (
            f"wavesweep {version['tool_version']} and numpy {version['numpy_version']}"
            for version in (versions(), theirs)
        )
        raise WavesweepError(f"expected workers with {ours}, found one with {their_words}")
    return results


class Silence:
    """Says that nothing finishes, once after SILENT seconds, and then only if it lasts twice as
    long as at the last word.

    clock: gives the time in seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._since, self._next = clock, clock(), SILENT

    def end(self) -> None:
        """Something has finished."""
        self._since = self._clock()

    def go_on(self, who: str) -> None:
        """Nothing has finished since the last call; who: has the rest."""
        seconds = self._clock() - self._since
        if seconds >= self._next:
            self._next = 2 * seconds
            words = "nothing has finished for %.0f s; %s. If no processor is busy with them, Ctrl-C stops the run"
            LOGGER.warning(words, seconds, who)
