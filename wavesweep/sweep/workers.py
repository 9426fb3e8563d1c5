"""The workers that a sweep runs on: none, processes or threads of this machine, or those of a dask or ray cluster.

What all of them keep: a worker that dies is an error within seconds; processes that are started here leave Ctrl-C to this
one, end when it ends, and run nothing of the current folder.
"""

import logging
import os
import re
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from itertools import islice

from wavesweep.arithmetic import ONE_THREAD, versions
from wavesweep.errors import UsageError, WavesweepError
from wavesweep.sweep.tasks import attested, settle_in, timed
from wavesweep.system import HANGUP, KILL, MASKS, STOPPING, block, block_only, processors, why_no_processes

EXTRAS = {"dask": "distributed", "ray": "ray"}  # backend, also the name of our extra -> the package that it needs
# Of processes that are started here: one BLAS thread each, since the matrices are small and the workers many; and no module
# of the current folder, which Python would otherwise prefer to the standard library and to joblib.
CHILDREN = dict.fromkeys(ONE_THREAD, "1") | {"PYTHONSAFEPATH": "1"}
LOCAL = ("loky", "threading")  # backends whose workers share the processors of this machine
AHEAD = 3  # tasks per worker that are handed out before the first is finished
ENDING = 3.0  # s for loky's threads to end, whose other locks a signal may have left locked as well
IDLE = 60  # s after which loky's workers end if nothing follows
LOOK = 2.0  # s between two looks at a cluster
PATIENCE = 10.0  # s for a dask scheduler to answer
ALONE = 20.0  # s that a cluster may be without workers
DIED = "a worker process died (killed, or out of memory); fewer --jobs take less memory"
PROCESSES = 2  # by default
WORTH = 0.6  # s of work; measured: two loky workers are ready after 0.2 s, and below this they save nothing


@dataclass(frozen=True, slots=True)
class Workers:
    """`count` workers of a backend, or this process (count 1, backend None), and why these were chosen."""

    count: int
    backend: str | None
    scheduler: str | None
    why: str


def refuse_backend(backend: str | None) -> None:
    """Raise UsageError for a backend that is unknown, whose package is missing, or that cannot keep its promises."""
    if backend == "multiprocessing":
        raise UsageError("backend multiprocessing: its pool never notices that a worker has died; use loky")
    if backend is not None and backend not in BACKENDS:
        raise UsageError(f"backend {backend}: expected one of {', '.join(sorted(BACKENDS))}")
    if backend in EXTRAS:
        _import(backend, EXTRAS[backend])


def excess(jobs: int, backend: str | None) -> str:
    """A sentence if fewer workers are used than `jobs`, otherwise an empty text."""
    if backend not in (None, *LOCAL) or jobs <= max(PROCESSES, processors()):
        return ""
    return f"--jobs {jobs}: this machine has {processors()} processors for wavesweep, and no more workers are used"


def choose(jobs: int | None, backend: str | None, scheduler: str | None, chunks: int, seconds: Callable[[], float]) -> Workers:
    """Decide which workers compute `chunks` chunks.

    jobs: largest number of workers, PROCESSES if None; no more than there are processors are used. seconds: estimates the
    time in this process, called only if it matters. Raises UsageError for a backend that cannot be used.
    """
    refuse_backend(backend)
    jobs = jobs or PROCESSES
    useful = max(1, min(jobs, processors()))
    if backend is not None:
        return Workers(useful if backend in LOCAL else jobs, backend, scheduler, f"the backend {backend} was asked for")
    if jobs == 1:
        return Workers(1, None, None, "one job was asked for")
    if chunks < 2:
        return Workers(1, None, None, "a single chunk of work")
    if useful < 2:
        return Workers(1, None, None, "a single processor")
    expected = seconds()
    alone = f"work below {WORTH:g} s is faster without workers" if expected < WORTH else why_no_processes()
    if alone:
        return Workers(1, None, None, alone)
    return Workers(min(useful, chunks), "loky", None, f"estimated {max(1, round(expected))} s of work")


def results(workers: Workers, numbers, task_of: Callable) -> Iterator[tuple]:
    """Yield (number, records, seconds) of every chunk as it is finished, in no particular order.

    task_of(number): the chunk's `Task`, made when it is handed out. Raises UsageError for a backend that cannot be used,
    WavesweepError if a worker dies, has other versions, or a cluster is lost. Closing the generator ends the workers.
    """
    if workers.backend is None:
        return (timed(number, task_of(number)) for number in numbers)
    return _elsewhere(workers, numbers, task_of)


def _elsewhere(workers, numbers, task_of):
    refuse_backend(workers.backend)
    with BACKENDS[workers.backend](workers) as pool:
        calls = ((number, task_of(number)) for number in numbers)
        waiting = {pool.submit(attested, timed, *call) for call in islice(calls, AHEAD * pool.count)}
        while waiting:
            done, waiting = wait(waiting, LOOK, FIRST_COMPLETED)
            pool.look()
            for future in done:
                waiting |= {pool.submit(attested, timed, *call) for call in islice(calls, 1)}
                found, there = future.result()
                if there != versions():
                    raise WavesweepError(f"expected workers with {_named(versions())}, found one with {_named(there)}")
                yield found


def _named(found):
    return f"wavesweep {found['tool_version']} and numpy {found['numpy_version']}"


@dataclass(frozen=True, slots=True)
class Pool:
    """`submit(function, *arguments)` gives a future; `count` workers; `look` raises WavesweepError if the pool is lost."""

    submit: Callable
    count: int
    look: Callable[[], None] = lambda: None


@contextmanager
def _loky(workers):
    from joblib.externals.loky import get_reusable_executor

    try:
        with _started_here():
            executor = get_reusable_executor(
                workers.count, timeout=IDLE, initializer=settle_in, initargs=(os.getpid(),), env=CHILDREN
            )
            executor.submit(os.getpid)  # starts all workers
    except (ImportError, OSError) as error:  # no semaphores, no /dev/shm
        raise WavesweepError(f"no worker processes can be started here ({error}); --jobs 1 needs none") from error
    processes, manager = list(executor._processes.values()), executor._executor_manager_thread  # noqa: SLF001 - no public names

    def look():
        # A worker that dies while it writes a result leaves half of it in the pipe, and loky waits for the rest for ever.
        # So it does if its own thread has ended, for example by a warning that Python was told to raise.
        if any(process.exitcode for process in processes) or not manager.is_alive():
            raise WavesweepError(DIED)

    try:
        yield Pool(executor.submit, workers.count, look)
    except BaseException as error:
        _unblock(executor, processes)
        end = threading.Thread(target=executor.shutdown, kwargs={"kill_workers": True}, daemon=True)
        with _manager_unsaid():
            end.start()
            end.join(ENDING)
        if isinstance(error, BrokenExecutor):
            raise WavesweepError(DIED) from error
        raise


def _unblock(executor, processes):
    """End the workers, and take away all that loky's threads could wait for without end.

    One of them may read the rest of a result whose writer is dead, another may write tasks into a full pipe that is not read
    any more. This process has the far ends of both open as well, and closes them. A signal that arrives while this thread takes
    the lock of a result that is still to come leaves it locked.
    """
    for item in list(executor._pending_work_items.values()):  # noqa: SLF001 - no public names
        lock = item.future._condition  # noqa: SLF001
        while lock._is_owned():  # noqa: SLF001
            lock.release()
    for process in processes:
        if process.exitcode is None:
            with suppress(OSError):
                os.kill(process.pid, KILL)
    null = os.open(os.devnull, os.O_RDWR)
    for end in (executor._result_queue._writer, executor._call_queue._reader):  # noqa: SLF001 - no public names either
        with suppress(OSError):  # one that loky has closed itself
            os.dup2(null, end.fileno())  # and not closed, which loky may be about to do
    os.close(null)


@contextmanager
def _manager_unsaid():
    """Say nothing if loky's own thread fails because a task that it was about to hand out was cancelled."""
    before = threading.excepthook

    def hook(failed):
        if not (failed.exc_type is KeyError and failed.thread and failed.thread.name == "ExecutorManagerThread"):
            before(failed)

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = before


@contextmanager
def _started_here():
    """Let processes that are started meanwhile have the environment CHILDREN and leave the signals STOPPING to this one.

    A terminal sends Ctrl-C to all its processes, and a worker that was still importing would write a traceback. A signal
    that arrives meanwhile is delivered afterwards. Stdout and stderr are the null device meanwhile, so that whoever reads
    from this process waits for no other, and loky's tracker does not count semaphores aloud if this process is killed.
    """
    from joblib.externals.loky.backend import resource_tracker as of_loky

    with ExitStack() as after:
        before = {name: os.environ.get(name) for name in CHILDREN}
        after.callback(_restore, before)
        os.environ.update(CHILDREN)
        after.enter_context(_unheard())
        if MASKS:
            from multiprocessing import resource_tracker as of_python

            after.callback(block_only, block())
            block({HANGUP})
            # Python starts both trackers with the first worker. They ignore the other signals, and leave these unblocked.
            of_python.ensure_running()
            of_loky.ensure_running()
            block(STOPPING)
        yield


@contextmanager
def _unheard():
    """Make stdout and stderr the null device."""
    streams = [stream for stream in (sys.stdout, sys.stderr) if stream is not None]
    for stream in streams:
        stream.flush()
    null, kept = os.open(os.devnull, os.O_WRONLY), {number: os.dup(number) for number in (1, 2)}
    try:
        for number in kept:
            os.dup2(null, number)
        yield
    finally:
        for number, before in kept.items():
            os.dup2(before, number)
            os.close(before)
        os.close(null)


def _restore(before):
    for name, value in before.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


@contextmanager
def _threads(workers):
    executor = ThreadPoolExecutor(workers.count)
    try:
        yield Pool(executor.submit, workers.count)
    finally:
        executor.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _dask(workers):
    distributed = _import("dask", "distributed")
    with _quiet("distributed", "asyncio"), ExitStack() as opened:
        client = _client(distributed, workers.scheduler, opened)
        executor = client.get_executor(pure=False)
        seen = time.monotonic()

        def look():
            nonlocal seen
            if client.status != "running":
                raise WavesweepError(f"the dask scheduler {client.scheduler.address} is lost")
            if client.nthreads():
                seen = time.monotonic()
            if time.monotonic() - seen > ALONE:
                raise WavesweepError(f"the dask scheduler {client.scheduler.address} has had no workers for {ALONE:g} s")

        try:
            yield Pool(executor.submit, max(workers.count, sum(client.nthreads().values())), look)
        except distributed.KilledWorker as error:
            raise WavesweepError(DIED) from error
        except (CancelledError, OSError) as error:  # all that is heard of a scheduler that ended
            raise WavesweepError(f"the dask scheduler {workers.scheduler or 'of this process'} is lost") from error
        finally:
            executor.shutdown(wait=False)


def _client(distributed, address, opened):
    """A dask client of the scheduler at that address, or the one that this process has already."""
    if address is None:
        try:
            return distributed.get_client()
        except ValueError as error:
            raise UsageError("backend dask: give the scheduler's address, e.g. tcp://host:8786") from error
    found = re.fullmatch(r"(?:(?:tcp|tls|wss?)://)?(\[[^\]]+\]|[^][:/\s]+):(\d{1,5})/?", address)
    if not found:
        raise UsageError(f"scheduler {address}: expected an address such as tcp://host:8786")
    try:
        # Nobody there: dask would say so after a long time, and in many lines.
        socket.create_connection((found[1].strip("[]"), int(found[2])), PATIENCE).close()
        return opened.enter_context(distributed.Client(address, timeout=PATIENCE, set_as_default=False))
    except (OSError, ValueError, OverflowError) as error:
        raise UsageError(f"scheduler {address}: no dask scheduler answers there ({error})") from error


@contextmanager
def _ray(workers):
    """Ray's tasks, on the cluster that this process is connected to, or on one of its own that ends with the run."""
    ray = _import("ray", "ray")
    with ExitStack() as opened:
        if not ray.is_initialized():
            before = signal.getsignal(signal.SIGTERM)
            os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
            with _unheard():
                ray.init(num_cpus=workers.count, include_dashboard=False, log_to_driver=False, configure_logging=False)
            signal.signal(signal.SIGTERM, before)  # ray's own handler would end this process at once
            opened.callback(ray.shutdown)
        remote = ray.remote(max_retries=0)(_called)
        try:
            yield Pool(lambda *call: remote.remote(*call).future(), workers.count)
        except ray.exceptions.RayError as error:
            if isinstance(error, ray.exceptions.RayTaskError):
                raise error.cause from error
            raise WavesweepError(DIED) from error


def _called(function, *arguments):
    """Ray names its tasks after their functions, and wants to know them beforehand."""
    return function(*arguments)


def _import(backend, module):
    from importlib import import_module

    try:
        return import_module(module)
    except ImportError as error:
        raise UsageError(
            f"backend {backend}: the package {EXTRAS[backend]} is missing; install it with pip install 'wavesweep[{backend}]'"
        ) from error


@contextmanager
def _quiet(*names):
    """Let these loggers and those below them say nothing: an error says in one line all that they would write in many."""
    known = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in names]
    loggers = [logging.getLogger(name) for name in {*names, *known}]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


BACKENDS = {"loky": _loky, "threading": _threads, "dask": _dask, "ray": _ray}
