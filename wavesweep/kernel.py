"""Which arithmetic computes the crossings along a wall parameter: numpy, or a kernel that numba compiles, an optional extra.

Both find and prove the same crossings by the same steps; the last digits differ, so the facts of a table and the chunks of a
run say which it was.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from importlib.util import find_spec

from wavesweep.errors import UsageError

VARIABLE = "WAVESWEEP_KERNEL"
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")  # variables of libraries
NUMPY, NUMBA = "numpy", "numba"
_given: ContextVar[str] = ContextVar("kernel", default="")


def chosen() -> str:
    """The kernel of this run: the one that `using` gave, or the environment variable's. Errors: UsageError for another word, or
    for one that is not installed."""
    word = _given.get() or os.environ.get(VARIABLE, "") or NUMPY
    if word not in (NUMPY, NUMBA):
        raise UsageError(f"{VARIABLE}={word}: expected {NUMPY} or {NUMBA}")
    if word == NUMBA and not _installed():
        raise UsageError(f"{VARIABLE}={NUMBA}: numba is not installed; pip install 'wavesweep[numba]', or unset {VARIABLE}")
    return word


@cache
def _installed() -> bool:
    return find_spec(NUMBA) is not None


@contextmanager
def using(kernel: str) -> Iterator[None]:
    """Compute with that kernel meanwhile."""
    token = _given.set(kernel)
    try:
        yield
    finally:
        _given.reset(token)


def versions() -> dict[str, str]:
    """What the last digits of a table depend on: the versions of this program and of numpy, and of another kernel."""
    import numpy as np

    from wavesweep import __version__

    found = {"tool_version": __version__, "numpy_version": np.__version__}
    if chosen() == NUMPY:
        return found
    from importlib.metadata import version

    return found | {"kernel": f"{NUMBA} {version(NUMBA)}"}
