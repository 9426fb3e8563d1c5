"""Workers of a cluster: those of a dask scheduler.

A worker that dies has its chunks done by others. A scheduler that is gone, or without workers for
SECONDS_WITHOUT_WORKERS seconds, is an error.
"""

import logging
import re
import socket
import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.sweep.pools import DIED

SCHEDULER_SECONDS = 10.0  # s for a scheduler to answer
SECONDS_WITHOUT_WORKERS = 20.0  # s that a dask scheduler may be without workers
# chunks at most in a task: dask's scheduler takes 2 to 4 ms for one, whatever its size
CHUNKS_OF_TASK = 8
OTHERS = "one that is ended has its chunks done by others"


@dataclass(frozen=True, slots=True)
class Pool:
    """`submit(function, *arguments)` gives a future; `count` workers. look: says who works;
    WavesweepError if all are lost."""

    submit: Callable
    count: int
    look: Callable[[], str]


@contextmanager
def dask(workers):
    """The workers of a dask scheduler."""
    distributed = imported()
    with _quiet("distributed", "asyncio", "tornado"), ExitStack() as opened:
        client = _client(distributed, workers.scheduler, opened)
        name = f"the dask scheduler {client.scheduler.address}"
        executor = client.get_executor(pure=False)
        last_seen = time.monotonic()

        def threads():
            return client.sync(
                client.scheduler.ncores, callback_timeout=SCHEDULER_SECONDS
            )  # a frozen scheduler never answers

        def look():
            nonlocal last_seen
            if client.status != "running":
                raise WavesweepError(f"{name} is lost")
            try:
                cores = threads()
            except TimeoutError:
                return f"{name}, which does not answer"
            if cores:
                last_seen = time.monotonic()
            if time.monotonic() - last_seen > SECONDS_WITHOUT_WORKERS:
                raise WavesweepError(f"{name} has had no workers for {SECONDS_WITHOUT_WORKERS:g} s")
            return f"{len(cores)} workers of {name}; {OTHERS}"

        try:
            yield Pool(executor.submit, max(workers.count, sum(threads().values())), look)
        except distributed.KilledWorker as error:
            raise WavesweepError(DIED) from error
        except (CancelledError, OSError) as error:  # all that is heard of a scheduler that ended
            raise WavesweepError(
                f"the dask scheduler {workers.scheduler or 'of this process'} is lost"
            ) from error
        finally:
            executor.shutdown(wait=False)


def _client(distributed, address, opened):
    """A dask client of the scheduler at that address, or the one that this process has already.

    Errors: UsageError unless something listens there; if nothing does, dask says so late, in many
    lines.
    """
    if address is None:
        try:
            return distributed.get_client()
        except ValueError as error:
            raise UsageError(
                "backend dask: give the scheduler's address, e.g. tcp://host:8786"
            ) from error
    place = re.fullmatch(r"(?:(?:tcp|tls|wss?)://)?(\[[^\]]+\]|[^][:/\s]+):(\d{1,5})/?", address)
    if not place:
        raise UsageError(f"scheduler {address}: expected an address such as tcp://host:8786")
    try:
        socket.create_connection((place[1].strip("[]"), int(place[2])), SCHEDULER_SECONDS).close()
        return opened.enter_context(
            distributed.Client(address, timeout=SCHEDULER_SECONDS, set_as_default=False)
        )
    except (OSError, ValueError, OverflowError) as error:
        raise UsageError(
            f"scheduler {address}: no dask scheduler answers there ({error})"
        ) from error


def imported():
    """The package of dask's clusters. Raises UsageError if it is missing."""
    try:
        import distributed
    except ImportError as error:
        needs = "the package distributed is missing; install it with pip install 'wavesweep[dask]'"
        raise UsageError(f"backend dask: {needs}") from error
    return distributed


@contextmanager
def _quiet(*names):
    """Let these loggers and those below them say nothing: an error says in one line all that
    they would write in many."""
    below = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in names]
    loggers = [logging.getLogger(name) for name in {*names, *below}]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)
