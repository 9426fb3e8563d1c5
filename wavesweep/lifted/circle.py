"""The unit circle in delta form, and solves next to it."""

import numpy as np


def on_circle(theta):
    """`w = exp(j theta) - 1`, without cancellation at small angles."""
    half = np.sin(theta / 2)
    return -2 * half * half + 1j * np.sin(theta)


def solve(A, b):
    """Batched solve; a matrix that is exactly singular (a pole at this very point) gives a huge state, not an error."""
    try:
        return np.linalg.solve(A, b)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(A)[0] == 0
        nudge = np.finfo(float).eps * np.maximum(np.abs(A).max((-1, -2)), 1) * singular
        return np.linalg.solve(A + nudge[..., None, None] * np.eye(A.shape[-1]), b)
