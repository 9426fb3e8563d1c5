"""Workers of this machine, by joblib: processes of loky, or threads."""

import os
import sys
import warnings
from collections.abc import Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import closing, contextmanager

from wavesweep.errors import WavesweepError
from wavesweep.platform_compat import MASKS, STOPPING, block, block_only, why_no_processes
from wavesweep.sweep.tasks import attested, settle_in

SAFE_PATH = "PYTHONSAFEPATH"  # no module of the current folder, which Python would otherwise prefer to the standard library
IDLE = 60  # s after which the processes end if nothing follows
AHEAD = 3  # tasks per worker that are handed out before the first is finished
DIED = "a worker process died (killed, or out of memory); fewer --jobs take less memory"


def in_parallel(backend: str, count: int, calls: Iterable[tuple]) -> Iterator[tuple]:
    """Yield what `attested` gives for each call, (function, *arguments), as it is finished, in no particular order.

    backend: "loky" or "threading" of joblib. count: of the workers. Closing the iterator ends the processes. Errors: those of
    the calls; WavesweepError if a process dies, or none can be started.
    """
    if why := why_no_processes() if backend == "loky" else "":
        raise WavesweepError(f"{why}; --jobs 1 needs none")
    from joblib import Parallel, delayed, parallel_config

    try:
        tasks, ours = (delayed(attested)(*call) for call in calls), {}
        if backend == "loky":  # one BLAS thread each, since the matrices are small and the workers many
            ours = {
                "inner_max_num_threads": 1,
                "initializer": settle_in,
                "initargs": (os.getpid(),),
                "idle_worker_timeout": IDLE,
            }
        with parallel_config(backend, **ours), _started_here():
            run = Parallel(count, return_as="generator_unordered", batch_size=1, pre_dispatch=AHEAD * count, max_nbytes=None)
            found = run(tasks)
    except OSError as error:  # no processes, no /dev/shm
        raise WavesweepError(f"no worker processes can be started here ({error}); --jobs 1 needs none") from error
    try:
        with warnings.catch_warnings(), closing(found):
            warnings.filterwarnings(
                "ignore", ".* tasks which were still being processed", UserWarning
            )  # as we are told to stop
            yield from found
    except BrokenExecutor as error:
        raise WavesweepError(DIED) from error


@contextmanager
def _started_here() -> Iterator[None]:
    """Let processes that are started meanwhile leave the signals STOPPING to this one, and run nothing of the current folder.

    A terminal sends Ctrl-C to all its processes, and a worker that was still importing would write a traceback. A signal that
    arrives meanwhile is delivered afterwards. Stdout and stderr are the null device meanwhile, so that whoever reads from this
    process waits for no other, and nobody speaks of it if this process is killed.
    """
    before, waiting = os.environ.get(SAFE_PATH), block(STOPPING) if MASKS else ()
    null, kept = os.open(os.devnull, os.O_WRONLY), {number: os.dup(number) for number in (1, 2)}
    try:
        os.environ[SAFE_PATH] = "1"
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
        for number in kept:
            os.dup2(null, number)
        yield
    finally:
        for number, own in kept.items():
            os.dup2(own, number)
            os.close(own)
        os.close(null)
        os.environ.pop(SAFE_PATH)
        os.environ.update({SAFE_PATH: before} if before is not None else {})
        if MASKS:
            block_only(waiting)
