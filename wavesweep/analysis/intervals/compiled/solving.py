"""Small dense systems next to the circle, solved one after the other, for the kernel."""

from hashlib import sha256
from pathlib import Path

import numpy as np
from numba import config, njit

from wavesweep.lifted import cut


def _place():
    """A folder for compiled code that belongs to these very sources: numba looks at the file of a function alone, and not at
    those that it calls or takes constants from."""
    here, digest = Path(__file__).parent, sha256()
    for source in sorted([*here.parent.rglob("*.py"), *Path(cut.__file__).parent.glob("*.py")]):
        digest.update(source.read_bytes())
    return Path(config.CACHE_DIR or here / "__pycache__") / f"wavesweep-{digest.hexdigest()[:16]}"


PLACE = str(_place())


def compiled(function):
    """The function compiled at its first call, and kept on disk if there is a place."""
    options = {"error_model": "numpy", "nogil": True}
    before, config.CACHE_DIR = config.CACHE_DIR, PLACE
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:
        return njit(**options)(function)
    finally:
        config.CACHE_DIR = before


@compiled
def _over(a, b):
    """a/b of complex numbers, NaN for b = 0, for which numba raises an error."""
    return a / b if b != 0 else complex(np.nan, np.nan)


@compiled
def _factored(A, exchanged):
    """A in place to its factors with row exchanges and the inverses of its pivots, and the sign of the exchanges."""
    sign = 1.0
    for k in range(len(A)):
        best, at = -1.0, k
        for i in range(k, len(A)):
            size = abs(A[i, k].real) + abs(A[i, k].imag)
            if size > best:
                best, at = size, i
        exchanged[k] = at
        if at != k:
            for j in range(len(A)):
                A[k, j], A[at, j] = A[at, j], A[k, j]
            sign = -sign
        A[k, k] = _over(1.0 + 0j, A[k, k])
        for i in range(k + 1, len(A)):
            factor = A[i, k] * A[k, k]
            A[i, k] = factor
            for j in range(k + 1, len(A)):
                A[i, j] -= factor * A[k, j]
    return sign


@compiled
def _solve(A, exchanged, x):
    """x in place to `A^-1 x`, A factored."""
    for k in range(len(A)):
        at = exchanged[k]
        x[k], x[at] = x[at], x[k]
    for k in range(len(A)):
        for i in range(k + 1, len(A)):
            x[i] -= A[i, k] * x[k]
    for k in range(len(A) - 1, -1, -1):
        x[k] = x[k] * A[k, k]
        for i in range(k):
            x[i] -= A[i, k] * x[k]


@compiled
def _solve_transposed(A, exchanged, x):
    """x in place to `x A^-1`, A factored."""
    for k in range(len(A)):
        for i in range(k):
            x[k] -= A[i, k] * x[i]
        x[k] = x[k] * A[k, k]
    for k in range(len(A) - 1, -1, -1):
        for i in range(k + 1, len(A)):
            x[k] -= A[i, k] * x[i]
    for k in range(len(A) - 1, -1, -1):
        at = exchanged[k]
        x[k], x[at] = x[at], x[k]


@compiled
def _states(E, B, w, A, exchanged, x, rest):
    """Factors of `w I - E` in A, and in x the states for a unit force, refined once."""
    n = len(E)
    for i in range(n):
        for j in range(n):
            A[i, j] = -E[i, j]
        A[i, i] += w
        x[i] = B[i]
    _factored(A, exchanged)
    _solve(A, exchanged, x)
    for i in range(n):
        left = B[i] - w * x[i]
        for j in range(n):
            left += E[i, j] * x[j]
        rest[i] = left
    _solve(A, exchanged, rest)
    for i in range(n):
        x[i] += rest[i]
