"""The unit circle in delta form, and linear systems next to it."""

import numpy as np

from wavesweep.engine.doubles import EPS


def on_circle(theta: np.ndarray) -> np.ndarray:
    """Return `w = exp(j theta) - 1`, without cancellation at small angles."""
    half = np.sin(theta / 2)
    return -2 * half * half + 1j * np.sin(theta)


def solve(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Solve a batch of linear systems.

    A matrix that is exactly singular (at a pole) gives a huge state, or NaN, instead of an error.
    """
    try:
        return np.linalg.solve(A, b)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(A)[0] == 0
        nudge = EPS * np.maximum(np.abs(A).max((-1, -2)), 1) * singular
        A = A + nudge[..., None, None] * np.eye(A.shape[-1])
    try:
        return np.linalg.solve(A, b)
    except (
        np.linalg.LinAlgError
    ):  # as if the sizes of rows differ by more decades than a double has digits
        lost = (np.linalg.slogdet(A)[0] == 0)[..., None, None]
        return np.where(lost, np.nan, np.linalg.solve(np.where(lost, np.eye(A.shape[-1]), A), b))


def inverse(A: np.ndarray) -> np.ndarray:
    """Return the inverses of a batch of matrices; that of an exactly singular matrix is huge,
    not an error (see `solve`)."""
    try:
        return np.linalg.inv(A)
    except np.linalg.LinAlgError:
        return solve(A, np.broadcast_to(np.eye(A.shape[-1]), A.shape))
