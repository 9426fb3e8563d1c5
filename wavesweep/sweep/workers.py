"""The workers that a sweep runs on: none, processes of this machine, or another backend of joblib's."""

import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import islice

from wavesweep.errors import UsageError, WavesweepError
from wavesweep.sweep.tasks import timed

EXTRAS = {"dask": "distributed", "ray": "ray"}  # backend, also the name of our extra -> the package that it needs
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
PATIENCE = "10s"  # for a dask scheduler to answer


def enter(workers, opened: ExitStack) -> None:
    """Make the workers' backend joblib's own for as long as `opened` is open. Raises UsageError if that is impossible."""
    import joblib

    opened.enter_context(_one_blas_thread())
    if workers.backend == "ray":
        _import("ray", "ray.util.joblib").register_ray()
    options = {"client": _client(workers.scheduler, opened)} if workers.backend == "dask" else {}
    # The other backends refuse it, and inherit the environment.
    limit = {"inner_max_num_threads": 1} if workers.backend == "loky" else {}
    try:
        opened.enter_context(joblib.parallel_config(workers.backend, n_jobs=workers.count, **limit, **options))
    except ValueError as error:
        known = ", ".join(sorted({*joblib.parallel.BACKENDS, *EXTRAS} - {"sequential"}))
        raise UsageError(f"--backend {workers.backend}: joblib knows no such backend, expected one of {known}") from error


def deaths(backend: str) -> tuple[type[Exception], ...]:
    """The errors by which that backend says that a worker died."""
    if backend == "dask":
        return BrokenExecutor, _import("dask", "distributed").KilledWorker
    return (BrokenExecutor,)


def _client(address, opened):
    """A dask client of the scheduler at that address, or the one that this process has already."""
    distributed = _import("dask", "distributed")
    try:
        if address is None:
            return distributed.get_client()
        return opened.enter_context(distributed.Client(address, timeout=PATIENCE, set_as_default=False))
    except (OSError, ValueError) as error:
        if address is None:
            raise UsageError("--backend dask: give the scheduler's address, --scheduler tcp://host:8786") from error
        raise UsageError(f"--scheduler {address}: no dask scheduler answers there ({error})") from error


def _import(backend, module):
    from importlib import import_module

    try:
        return import_module(module)
    except ImportError as error:
        raise UsageError(
            f"--backend {backend}: the package {EXTRAS[backend]} is missing; install it with pip install 'wavesweep[{backend}]'"
        ) from error


@contextmanager
def _one_blas_thread():
    """Let processes that are started here have one BLAS thread each: the matrices are small, the workers many."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


LOKY = "loky"
BLOCK = 4  # chunks per worker in a block, for a backend that gives results in blocks only
DIED = "a worker process died (killed, or out of memory); fewer --jobs take less memory"
PROCESSES = 2  # by default
WORTH = 0.6  # s of work; measured: two loky workers are ready after 0.2 s, and below this they save nothing


@dataclass(frozen=True, slots=True)
class Workers:
    """`count` workers of a joblib backend, or this process (count 1, backend None), and why these were chosen."""

    count: int
    backend: str | None
    scheduler: str | None
    why: str


def choose(jobs: int | None, backend: str | None, scheduler: str | None, chunks: int, seconds: Callable[[], float]) -> Workers:
    """Decide which workers compute `chunks` chunks.

    jobs: number of workers, PROCESSES if None. seconds: estimates the time in this process, called only if it matters.
    """
    jobs = jobs or PROCESSES
    if backend is not None:
        return Workers(jobs, backend, scheduler, f"the backend {backend} was asked for")
    if jobs == 1:
        return Workers(1, None, None, "one job was asked for")
    if chunks < 2:
        return Workers(1, None, None, "a single chunk of work")
    expected = seconds()
    if expected < WORTH:
        return Workers(1, None, None, f"work below {WORTH:g} s is faster without workers")
    return Workers(min(jobs, chunks), LOKY, None, f"estimated {max(1, round(expected))} s of work")


def results(workers: Workers, numbers, task_of: Callable) -> Iterator[tuple]:
    """Yield (number, records, seconds) of every chunk as it is finished, in no particular order.

    task_of(number): the chunk's `Task`, made when it is handed out. Raises UsageError for a backend that is missing,
    WavesweepError if a worker dies. Closing the generator ends the workers.
    """
    if workers.backend is None:
        return (timed(number, task_of(number), os.getpid()) for number in numbers)
    return _elsewhere(workers, numbers, task_of)


def _elsewhere(workers, numbers, task_of):
    import joblib

    with ExitStack() as opened:
        enter(workers, opened)
        calls = (joblib.delayed(timed)(number, task_of(number), os.getpid()) for number in numbers)
        try:
            yield from _unordered(joblib, calls)
        except deaths(workers.backend) as error:
            raise WavesweepError(DIED) from error


def _unordered(joblib, calls):
    try:
        pool = joblib.Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="3*n_jobs")
    except ValueError:  # ray and multiprocessing give lists only
        pool = joblib.Parallel(batch_size=1)
        while block := list(islice(calls, BLOCK * joblib.effective_n_jobs())):
            yield from pool(block)
        return
    with _deaf_children():
        finished = pool(calls)
    with _quiet_end():
        try:
            yield from finished
        finally:
            finished.close()


@contextmanager
def _deaf_children():
    """Let processes that are started here ignore Ctrl-C, which a terminal sends to all: the parent answers it.

    A worker that was still importing would write a traceback. A signal that arrives meanwhile is delivered afterwards.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    # Python's own tracker is started with the first worker, and leaves Ctrl-C unblocked when it is: so it goes first.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _quiet_end():
    """Say nothing of tasks that are cancelled when a run is stopped, which may be at any moment from here on: neither
    joblib's warning, nor the traceback of loky's own thread when a task that it was about to hand out is gone."""
    before = threading.excepthook

    def hook(failed):
        if not (failed.exc_type is KeyError and failed.thread and failed.thread.name == "ExecutorManagerThread"):
            before(failed)

    threading.excepthook = hook
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", ".*tasks? (which|have)", UserWarning, "joblib.parallel")
            yield
    finally:
        threading.excepthook = before
