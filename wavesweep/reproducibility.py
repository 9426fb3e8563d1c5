"""What the last digits of results depend on: the threads of numerical libraries, and the versions of this program and numpy."""

ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")  # variables of libraries


def versions() -> dict[str, str]:
    """The versions of this program and of numpy."""
    import numpy as np

    from wavesweep import __version__

    return {"tool_version": __version__, "numpy_version": np.__version__}
