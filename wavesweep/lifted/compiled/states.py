"""Units of states, states that ticks forget, and the range of entries in a batch, loop by loop."""

import numpy as np

from wavesweep.lifted.compiled.caching import compiled


@compiled
def units_of(size, sweeps: int):
    """Return the units of `rounding.balance`, `(matrices, n)`; size: of the entries, `(matrices, n, n)`, which is used up."""
    count, n, _ = size.shape
    units = np.ones((count, n))
    for at in range(count):
        for i in range(n):
            size[at, i, i] = 0.0
        for _ in range(sweeps):
            changed = False
            for k in range(n):
                factor = _factor(size[at], k)
                if factor != 1:
                    changed = True
                    units[at, k] *= factor
                    for i in range(n):
                        size[at, i, k] *= factor
                        size[at, k, i] /= factor
            if not changed:
                break
    return units


@compiled
def _factor(size, k):
    """Return the power of two that makes row and column k as large as each other; 1 if there is none."""
    row = column = 0.0
    for i in range(len(size)):
        row, column = row + size[k, i], column + size[i, k]
    factor = np.exp2(np.rint(np.log2(row / column) / 2))
    return factor if np.isfinite(factor) and factor > 0 else 1.0


@compiled
def forgotten(E):
    """Return of each state whether its column of `I + E` is zero, and whether its row is, `(matrices, n)` each."""
    count, n, _ = E.shape
    unread, unset = np.empty((count, n), np.bool_), np.empty((count, n), np.bool_)
    for at in range(count):
        for k in range(n):
            column = row = E[at, k, k] == -1
            for i in range(n if column else 0):
                if i != k:
                    column, row = column and E[at, i, k] == 0, row and E[at, k, i] == 0
            unread[at, k], unset[at, k] = column, row
    return unread, unset


@compiled
def extremes(E, columns: int):
    """Return the largest and the smallest sizes of entries of `I + E` in a batch, `(2, n, columns)`.

    E: `(matrices, n, at least columns)`. NaN is passed on.
    """
    count, n, _ = E.shape
    found = np.empty((2, n, columns))
    found[0], found[1] = 0.0, np.inf
    for at in range(count):
        for i in range(n):
            for j in range(columns):
                size = abs(E[at, i, j] + 1.0) if i == j else abs(E[at, i, j])
                unknown = size != size  # noqa: PLR0124 - not a number
                if unknown or size > found[0, i, j]:
                    found[0, i, j] = size
                if unknown or size < found[1, i, j]:
                    found[1, i, j] = size
    return found
