"""Pools of workers on this machine: processes, or threads.

A process gets its tasks by its stdin and gives its results to its stdout, one pickle after the other. Its pipes are its own, so
they end with it, be it in the middle of a result, and no semaphore or file is left by a kill. It leaves Ctrl-C to this process,
ends when it ends, and runs nothing of the current folder.
"""

import atexit
import os
import pickle
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from queue import SimpleQueue

from wavesweep.arithmetic import ONE_THREAD
from wavesweep.errors import WavesweepError
from wavesweep.sweep.tasks import settle_in
from wavesweep.system import MASKS, STOPPING, block, block_only

# Of processes that are started here: one BLAS thread each, since the matrices are small and the workers many; and no module
# of the current folder, which Python would otherwise prefer to the standard library.
CHILDREN = dict.fromkeys(ONE_THREAD, "1") | {"PYTHONSAFEPATH": "1"}
BEGIN = "import pickle, sys; sys.path[:] = pickle.load(sys.stdin.buffer); from wavesweep.sweep import pools; pools.serve()"
IDLE = 60.0  # s after which a process ends if nothing follows
DIED = "a worker process died (killed, or out of memory); fewer --jobs take less memory"


@dataclass(frozen=True, slots=True)
class Pool:
    """`submit(function, *arguments)` gives a future; `count` workers.

    look: says who works, and what helps if they do not; raises WavesweepError if the pool is lost. together: so many chunks
    may be handed out at once.
    """

    submit: Callable
    count: int
    look: Callable[[], str]
    together: int = 1


class RemoteError(Exception):
    """The traceback of an error in a worker, as the cause of that error here."""


class Worker:
    """A process that computes for this one."""

    def __init__(self):
        waiting = block(STOPPING) if MASKS else ()  # a terminal sends Ctrl-C to all its processes
        try:
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
            self._process = subprocess.Popen([sys.executable, "-c", BEGIN], env=os.environ | CHILDREN, **pipes)  # noqa: S603 - our own
        finally:
            if MASKS:
                block_only(waiting)
        self._free = time.monotonic()
        with suppress(OSError):
            for each in (sys.path, os.getpid()):
                pickle.dump(each, self._process.stdin)
            self._process.stdin.flush()

    @property
    def ready(self) -> bool:
        """Whether it lives, and will go on waiting for a while."""
        return self._process.poll() is None and time.monotonic() - self._free < IDLE / 2

    def work(self, tasks: SimpleQueue) -> None:
        """Have it do the tasks, each a future and a pickled call, until there comes None."""
        for future, call in iter(tasks.get, None):
            try:
                pickle.dump(call, self._process.stdin)
                self._process.stdin.flush()
                found, error, where = pickle.load(self._process.stdout)  # noqa: S301 - of our own process
            except Exception as failed:  # noqa: BLE001 - raised where the result is awaited
                torn = isinstance(failed, OSError | EOFError | pickle.UnpicklingError)
                error, where = WavesweepError(DIED) if torn else failed, None
            if error is None:
                future.set_result(found)
            else:
                error.__cause__ = where and RemoteError(where)
                future.set_exception(error)
        self._free = time.monotonic()

    def end(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError, ValueError):  # a task that is still to be written, or a thread that reads
                pipe.close()


_FREE: list[Worker] = []  # of finished runs, for the next one


@atexit.register
def _end_free() -> None:
    while _FREE:
        _FREE.pop().end()


@contextmanager
def processes(workers):
    """Processes of this machine; those of the last run, if it was a moment ago."""
    tasks, team, hands = SimpleQueue(), [], []

    def submit(function, *arguments):
        future = Future()
        tasks.put((future, pickle.dumps((function, arguments), pickle.HIGHEST_PROTOCOL)))
        return future

    try:
        while len(team) < workers.count:
            team.append(_FREE.pop() if _FREE else _started())
            if not team[-1].ready:
                team.pop().end()
        # A future's lock that an interrupt left locked keeps a thread for ever; the end of this process does not wait for it.
        hands += [threading.Thread(target=each.work, args=(tasks,), daemon=True) for each in team]
        for each in hands:
            each.start()
        yield Pool(submit, len(team), lambda: f"{len(team)} processes; one that is stopped goes on after kill -CONT")
    except BaseException:
        for each in team:
            each.end()
        team.clear()
        raise
    finally:
        for _ in hands:
            tasks.put(None)
    for each in hands:
        each.join()
    _FREE.extend(team)


def _started():
    try:
        return Worker()
    except OSError as error:
        raise WavesweepError(f"no worker processes can be started here ({error}); --jobs 1 needs none") from error


def serve() -> None:
    """Be a worker: do the tasks that stdin brings, until it ends. Whatever else is printed goes nowhere."""
    tasks, results = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    settle_in(pickle.load(tasks))  # noqa: S301 - of the process that started this one
    while True:
        patience = threading.Timer(IDLE, os._exit, [0])
        patience.daemon = True
        patience.start()
        try:
            call = pickle.load(tasks)  # noqa: S301
        except EOFError:
            return
        patience.cancel()
        results.write(_answer(call))
        results.flush()


def _answer(call: bytes) -> bytes:
    """The result of a pickled call, pickled: what it gave, or the error and its traceback."""
    try:
        function, arguments = pickle.loads(call)  # noqa: S301
        return pickle.dumps((function(*arguments), None, None), pickle.HIGHEST_PROTOCOL)
    except BaseException as error:  # noqa: BLE001 - it is raised where the call came from
        where = traceback.format_exc()
        try:
            return pickle.dumps((None, error, where))
        except Exception:  # noqa: BLE001 - an error that cannot be sent is told
            return pickle.dumps((None, WavesweepError(f"{type(error).__name__}: {error}"), where))


@contextmanager
def threads(workers):
    executor = ThreadPoolExecutor(workers.count)
    try:
        yield Pool(executor.submit, workers.count, lambda: f"{workers.count} threads of this process")
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
