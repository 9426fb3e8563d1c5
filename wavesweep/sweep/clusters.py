"""Workers of a cluster: those of a dask scheduler, or of ray.

A worker that dies has its chunks done by others. A scheduler that is gone, or without workers for ALONE seconds, is an error.
"""

import logging
import os
import re
import signal
import socket
import time
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from importlib import import_module

from wavesweep.errors import UsageError, WavesweepError
from wavesweep.sweep.pools import DIED, Pool, unheard

EXTRAS = {"dask": "distributed", "ray": "ray"}  # backend, also the name of our extra -> the package that it needs
PATIENCE = 10.0  # s for a scheduler to answer
ALONE = 20.0  # s that a dask scheduler may be without workers
TOGETHER = 8  # chunks at most in a task: dask's scheduler takes 2 to 4 ms for one, whatever its size
AGAIN = 3  # times that a chunk whose ray worker died is done again
OTHERS = "one that is ended has its chunks done by others"


@contextmanager
def dask(workers):
    """The workers of a dask scheduler."""
    distributed = imported("dask")
    with _quiet("distributed", "asyncio"), ExitStack() as opened:
        client = _client(distributed, workers.scheduler, opened)
        name = f"the dask scheduler {client.scheduler.address}"
        executor = client.get_executor(pure=False)
        seen = time.monotonic()

        def threads():
            return client.sync(client.scheduler.ncores, callback_timeout=PATIENCE)  # a frozen scheduler never answers

        def look():
            nonlocal seen
            if client.status != "running":
                raise WavesweepError(f"{name} is lost")
            try:
                found = threads()
            except TimeoutError:
                return f"{name}, which does not answer"
            if found:
                seen = time.monotonic()
            if time.monotonic() - seen > ALONE:
                raise WavesweepError(f"{name} has had no workers for {ALONE:g} s")
            return f"{len(found)} workers of {name}; {OTHERS}"

        try:
            yield Pool(executor.submit, max(workers.count, sum(threads().values())), look, TOGETHER)
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
    _reach(address, "dask", "tcp|tls|wss?", "tcp://host:8786")
    try:
        return opened.enter_context(distributed.Client(address, timeout=PATIENCE, set_as_default=False))
    except (OSError, ValueError) as error:
        raise UsageError(f"scheduler {address}: no dask scheduler answers there ({error})") from error


@contextmanager
def ray(workers):
    """Ray's tasks, on the cluster at the given address or at RAY_ADDRESS, or on one of its own that ends with the run."""
    module = imported("ray")
    with _quiet("ray"), ExitStack() as opened:
        if not module.is_initialized():
            before = signal.getsignal(signal.SIGTERM)
            os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
            opened.callback(module.shutdown)
            _start(module, workers)
            signal.signal(signal.SIGTERM, before)  # ray's own handler would end this process at once
        remote = module.remote(max_retries=AGAIN)(_called)
        count = max(workers.count, int(module.cluster_resources().get("CPU", 0)))
        try:
            yield Pool(lambda *call: remote.remote(*call).future(), count, lambda: f"{count} ray workers; {OTHERS}", TOGETHER)
        except module.exceptions.RayError as error:
            if isinstance(error, module.exceptions.RayTaskError):
                raise error.cause from error
            raise WavesweepError(DIED) from error


def _start(module, workers):
    """Connect this process to a cluster, or begin one."""
    address = workers.scheduler or os.environ.get("RAY_ADDRESS")
    given = {"address": address} if address else {"address": "local", "num_cpus": workers.count, "include_dashboard": False}
    if address and address != "auto":
        _reach(address, "ray", "", "host:6379, or auto")
    try:
        with unheard():
            module.init(**given, log_to_driver=False, configure_logging=False)
    except (OSError, ValueError, RuntimeError, SystemExit) as error:
        if not address:
            raise WavesweepError(f"backend ray: no cluster can be started here ({error})") from error
        token = "" if os.environ.get("RAY_AUTH_MODE") else "; if it wants a token, set RAY_AUTH_MODE=token"
        raise UsageError(f"scheduler {address}: no ray cluster answers there ({error}){token}") from error


def _reach(address, backend, schemes, example):
    """Raise UsageError unless something listens at the address; if nobody is there, libraries say so late, in many lines."""
    found = re.fullmatch(rf"(?:(?:{schemes})://)?(\[[^\]]+\]|[^][:/\s]+):(\d{{1,5}})/?", address)
    if not found:
        raise UsageError(f"scheduler {address}: expected an address such as {example}")
    try:
        socket.create_connection((found[1].strip("[]"), int(found[2])), PATIENCE).close()
    except (OSError, ValueError, OverflowError) as error:
        raise UsageError(f"scheduler {address}: no {backend} scheduler answers there ({error})") from error


def _called(function, *arguments):
    """Ray names its tasks after their functions, and wants to know them beforehand."""
    return function(*arguments)


def imported(backend):
    """The package of a cluster. Raises UsageError if it is missing."""
    try:
        return import_module(EXTRAS[backend])
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
