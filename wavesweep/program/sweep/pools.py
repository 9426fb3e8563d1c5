"""What a worker computes, and the workers of this machine, processes of joblib's loky. It loads
numpy alone."""

import atexit
import os
import shutil
import signal
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack, closing, contextmanager
from functools import cache
from pathlib import Path

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError, WavesweepError
from wavesweep.program.atomic_files import scratch
from wavesweep.program.platform_compat import (
    MASKS,
    STOPPING,
    block,
    block_only,
    keep_memory,
    versions,
    why_no_processes,
)

# Of the environment of a start. Python would otherwise prefer modules of the current folder to the
# standard library.
LENT = {"PYTHONSAFEPATH": "1", "PYTHONWARNINGS": "ignore"}
_STARTING = threading.Lock()  # one start at a time: the environment is that of the whole process
AHEAD = 3  # tasks per worker that are handed out before the first is finished
DIED = "a worker process died (killed, or out of memory); fewer --jobs take less memory"


Task = Callable[[], np.ndarray]  # picklable: computes records, a structured array


def timed(number: int, task: Task) -> tuple[int, np.ndarray, float]:
    """Compute a chunk: its number, its records and the processor seconds used.

    Errors: those of the task; an IllPosedLoopError has the number.
    """
    started = time.thread_time()
    try:
        records = task()
    except IllPosedLoopError as error:
        error.chunk = number
        raise
    return number, records, time.thread_time() - started


def left_in(folder: str, compute: Callable, number: int, task: Task) -> tuple[Path, int, float]:
    """Compute a chunk as `compute` does, `timed` in general, and leave its records in a file of the
    folder: the file, the number of the chunk, and the processor seconds used.

    All workers answer through one pipe, and whoever reads it waits for the rest of a message whose
    sender was killed. This one has some hundred bytes, and a pipe divides none below PIPE_BUF, 4096.
    """
    number, records, seconds = compute(number, task)
    file = Path(folder, f"{number}.npy")
    try:
        np.save(file, records)
    except OSError as error:  # numpy's own of a full disk names no file
        raise WavesweepError(
            f"{folder}: no room for what a worker computed ({error}); TMPDIR names another folder"
        ) from None
    return file, number, seconds


@cache
def folder_of_chunks() -> Path:
    """The folder for what the workers of this process leave.

    It goes with this process or, if that is killed, with its workers; if these are killed as well,
    the next run removes it.
    """
    opened = ExitStack()
    atexit.register(opened.close)
    return opened.enter_context(scratch(Path(tempfile.gettempdir())))


def attested(function: Callable, *arguments) -> tuple[object, dict[str, str]]:
    """Call a function in a worker; its result, and the versions of the worker, on which the last
    digits depend."""
    return function(*arguments), versions()


def settle_in(parent: int, folder: Path) -> None:
    """Make this process a worker of the process `parent`: signals and warnings are left to it, and
    both end together, with the folder of what was not taken.

    Memory that is freed is kept. Stdout and stderr are the null device: a program that reads from
    the parent waits for no worker. The watch begins before the first task: if the parent was killed
    while this process was starting, a pool's worker would wait for minutes for its next task.
    """
    null = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2):
        os.dup2(null, number)
    os.close(null)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")
    keep_memory()

    def watch():
        while os.getppid() == parent:
            time.sleep(0.5)  # s between two looks at the parent
        for _ in range(2):  # the other workers may leave a file meanwhile
            shutil.rmtree(folder, ignore_errors=True)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def in_parallel(count: int, calls: Iterable[tuple]) -> Iterator[tuple]:
    """Yield what `attested` gives for each call, (function, *arguments), as it is finished, in no
    particular order.

    count: of the workers. Closing the iterator ends the processes. Errors: those of the calls;
    WavesweepError if a process dies, or none can be started.
    """
    if why := why_no_processes():
        raise WavesweepError(f"{why}; --jobs 1 needs none")
    from joblib import Parallel, delayed, parallel_config

    tasks = (delayed(attested)(*call) for call in calls)
    options = {
        "inner_max_num_threads": 1,  # of BLAS, since the matrices are small and the workers many
        "initializer": settle_in,
        "initargs": (os.getpid(), folder_of_chunks()),
        "idle_worker_timeout": 60,  # s after which the processes end if nothing follows
    }
    try:
        with parallel_config("loky", **options), started_here():
            # Arrays are never mapped: with this folder named, joblib makes none of its own, which a
            # kill would leave.
            shared = {"batch_size": 1, "max_nbytes": None, "temp_folder": tempfile.gettempdir()}
            run = Parallel(
                count, return_as="generator_unordered", pre_dispatch=AHEAD * count, **shared
            )
            answers = run(tasks)
    except OSError as error:  # no processes, no /dev/shm
        fault = f"no worker processes can be started here ({error})"
        raise WavesweepError(f"{fault}; --jobs 1 needs none") from error
    try:
        with warnings.catch_warnings(), closing(answers):
            # Closing the iterator says so of the tasks that it ends.
            said = ".* tasks which were still being processed"
            warnings.filterwarnings("ignore", said, UserWarning)
            yield from answers
    except BrokenExecutor as error:
        raise WavesweepError(DIED) from error


@contextmanager
def started_here() -> Iterator[None]:
    """Let processes that are started meanwhile leave the signals STOPPING to this one, and run
    nothing of the current folder.

    A terminal sends Ctrl-C to all its processes, and a worker that was still importing would write
    a traceback. A signal that arrives meanwhile is delivered afterwards. Joblib's tracker of
    semaphores warns of nothing if this process is killed.
    """
    with _STARTING:
        before = {name: os.environ.get(name) for name in LENT}
        waiting = block(STOPPING) if MASKS else ()
        try:
            os.environ.update(LENT)
            yield
        finally:
            for name, value in before.items():
                os.environ.pop(name)
                os.environ.update({name: value} if value is not None else {})
            if MASKS:
                block_only(waiting)
