"""The joblib backends: found, told their limits, and refused in words for users where they are not there."""

import os
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack, contextmanager

from wavesweep.errors import UsageError

EXTRAS = {"dask": "distributed", "ray": "ray"}  # backend, also the name of our extra -> the package that it needs
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
PATIENCE = "10s"  # for a dask scheduler to answer


def enter(workers, opened: ExitStack) -> None:
    """Make the workers' backend joblib's own for as long as `opened` is open. Raises UsageError where that cannot be."""
    import joblib

    opened.enter_context(_one_blas_thread())
    if workers.backend == "ray":
        _import("ray", "ray.util.joblib").register_ray()
    options = {"client": _client(workers.scheduler, opened)} if workers.backend == "dask" else {}
    # The others say no to it, and inherit the environment.
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
