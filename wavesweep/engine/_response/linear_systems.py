"""Linear systems with bounds on the errors of their solutions, entry by entry."""

from typing import NamedTuple

import numpy as np

from wavesweep.engine._monodromy.unit_circle import solve
from wavesweep.engine.doubles import SHORT_SUM_ROUNDING

INVERSE_ERROR = 0.1  # relative error of an inverse up to which it bounds the error of what it gives


class LinearSystem(NamedTuple):
    """`A X = b`, `(..., n, n)` and `(..., n, k)`, with bounds dA and db on the errors of the
    entries."""

    A: np.ndarray
    dA: np.ndarray
    b: np.ndarray
    db: np.ndarray


def solved(
    A: np.ndarray, dA: np.ndarray, b: np.ndarray, db: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return `X` of `A X = b` `(..., n, k)` and a bound on its error, entry by entry; dA, db:
    bounds on the errors of A and b.

    Rows and columns are scaled to a largest entry of 1. The inverse and the solution are refined,
    which makes the backward error small in every entry (Skeel 1980); the bound is `|A^-1|
    (|residual| + dA |X| + db)`. The bound is infinite if the inverse is not accurate enough.
    """
    column = 1 / _largest(A, -2)  # factors that give A a largest entry of 1 in each row and column
    row = 1 / _largest(A * column[..., None, :], -1)
    column = column / _largest(A * row[..., :, None] * column[..., None, :], -2)
    S = A * row[..., :, None] * column[..., None, :]
    unsure = dA * row[..., :, None] * column[..., None, :]
    b = b * row[..., None]
    db = db * row[..., None]
    eye = np.eye(A.shape[-1])
    inverse = solve(S, np.broadcast_to(eye, S.shape))
    inverse = inverse + inverse @ (
        eye - S @ inverse
    )  # so that small rows are right as well, and bound small unknowns
    X = inverse @ b
    for _ in range(2):
        X = X + inverse @ (b - S @ X)
    left = (
        np.abs(b - S @ X)
        + (SHORT_SUM_ROUNDING * np.abs(S) + unsure) @ np.abs(X)
        + SHORT_SUM_ROUNDING * np.abs(b)
        + db
    )
    off = np.abs(eye - inverse @ S).sum(-1).max(-1, initial=0)[..., None, None]
    error = np.where(off <= INVERSE_ERROR, np.abs(inverse) @ left * (1 + 2 * off), np.inf)
    return X * column[..., None], error * column[..., None]


def _largest(A, axis):
    size = np.abs(A).max(axis, initial=0)
    return np.where(size > 0, size, 1)
