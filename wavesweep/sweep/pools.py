"""Pools of workers on this machine: processes of loky, or threads.

Processes that are started here leave Ctrl-C to this one, end when it ends, and run nothing of the current folder.
"""

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass

from wavesweep.arithmetic import ONE_THREAD
from wavesweep.errors import WavesweepError
from wavesweep.sweep.tasks import settle_in
from wavesweep.system import HANGUP, KILL, MASKS, STOPPING, block, block_only

# Of processes that are started here: one BLAS thread each, since the matrices are small and the workers many; and no module
# of the current folder, which Python would otherwise prefer to the standard library and to joblib.
CHILDREN = dict.fromkeys(ONE_THREAD, "1") | {"PYTHONSAFEPATH": "1"}
ENDING = 3.0  # s for loky's threads to end, whose other locks a signal may have left locked as well
IDLE = 60  # s after which loky's workers end if nothing follows
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


@contextmanager
def loky(workers):
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
        return f"{workers.count} processes; one that is stopped goes on after kill -CONT"

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
        after.enter_context(unheard())
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
def unheard():
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
def threads(workers):
    executor = ThreadPoolExecutor(workers.count)
    try:
        yield Pool(executor.submit, workers.count, lambda: f"{workers.count} threads of this process")
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
