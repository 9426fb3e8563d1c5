"""What the last digits of results depend on: the threads of numerical libraries, and the versions of this program and numpy."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")  # variables of libraries


def versions() -> dict[str, str]:
    """The versions of this program and of numpy."""
    import numpy as np

    from wavesweep import __version__

    return {"tool_version": __version__, "numpy_version": np.__version__}


@contextmanager
def one_thread() -> Iterator[None]:
    """Compute with one thread of numerical libraries that are loaded: for small matrices several take many times as long."""
    if os.environ.get(ONE_THREAD[0]) == "1":  # set before they were loaded
        yield
        return
    with _libraries("scipy.linalg" in sys.modules).limit(limits=1, user_api="blas"):
        yield


@lru_cache(maxsize=2)
def _libraries(_scipy):
    """The numerical libraries that are loaded; scipy brings its own."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
