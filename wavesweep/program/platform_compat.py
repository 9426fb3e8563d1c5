"""Platform differences and their fallbacks; what the last digits of results depend on: threads
of libraries, and versions."""

import os
import signal
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache

# Without the first, a pipe of that name would be waited for.
_READING = ("O_NONBLOCK", "O_CLOEXEC", "O_BINARY")
READ = os.O_RDONLY | sum(getattr(os, name, 0) for name in _READING)
OPEN = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", *_READING))
STOPPING = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
HANGUP = getattr(signal, "SIGHUP", None)


def processors() -> int:
    """Number of processors that this process may use, or that there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory() -> float:
    """Bytes of memory that this machine has; infinite if it does not say."""
    has_sysconf = (
        hasattr(os, "sysconf") and {"SC_PAGE_SIZE", "SC_PHYS_PAGES"} <= os.sysconf_names.keys()
    )
    if has_sysconf:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return float("inf")


def memory_limit() -> float:
    """Bytes of address space that this process may take; infinite without a limit, or where
    there are none."""
    try:
        import resource
    except ImportError:  # Windows
        return float("inf")
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return float("inf")
    return limit


M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of malloc.h


def keep_memory() -> None:
    """Let glibc's allocator keep freed memory for the matrices of the next step; other allocators
    are left as they are.

    Otherwise it gives that memory back to the system, which clears it before it is used again: a
    fifth of the time of a sweep. It is for processes that are of this program alone.
    """
    # no glibc, or no library of this process
    with suppress(ImportError, AttributeError, OSError, TypeError):
        import ctypes

        mallopt = ctypes.CDLL(None).mallopt
        # Bytes up to which an array comes from the heap, the most that glibc allows.
        mallopt(M_MMAP_THRESHOLD, 2**25)
        # Bytes that the allocator keeps.
        mallopt(M_TRIM_THRESHOLD, 2**27)


def why_no_processes() -> str:
    """Say why no worker processes can be started here; empty if they can."""
    none = "no worker processes can be started here"
    try:
        import multiprocessing

        import joblib  # noqa: F401

        multiprocessing.get_context("fork").Lock()  # a semaphore, in /dev/shm on Linux
    except (ImportError, OSError) as error:
        return f"{none} (semaphores: {error})"
    if not tempfile.gettempdir().isascii():
        return f"{none} (TMPDIR, {tempfile.gettempdir()}: expected letters of ASCII alone)"
    return ""


MASKS = hasattr(
    signal, "pthread_sigmask"
)  # without masks of signals, workers hear those of their terminal


def block(numbers: Iterable[int] = ()) -> set[int]:
    """Block these signals in this thread and in processes that it starts; return those that were
    blocked before."""
    return signal.pthread_sigmask(signal.SIG_BLOCK, numbers)


def block_only(numbers: Iterable[int]) -> None:
    """Block these signals and no others."""
    signal.pthread_sigmask(signal.SIG_SETMASK, numbers)


# variables of libraries
ONE_THREAD = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


def versions() -> dict[str, str]:
    """The versions of this program and of numpy."""
    import numpy as np

    from wavesweep import __version__

    return {"tool_version": __version__, "numpy_version": np.__version__}


@contextmanager
def one_thread() -> Iterator[None]:
    """Compute with one thread of numerical libraries that are loaded: for small matrices several
    take many times as long."""
    if os.environ.get(ONE_THREAD[0]) == "1":  # set before they were loaded
        yield
        return
    with _libraries("scipy.linalg._flapack" in sys.modules).limit(limits=1, user_api="blas"):
        yield


@lru_cache(maxsize=2)
def _libraries(_scipy):
    """The numerical libraries that are loaded; scipy brings its own."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
