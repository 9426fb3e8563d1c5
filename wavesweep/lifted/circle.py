"""The unit circle in delta form, and solves next to it."""

import numpy as np


def on_circle(theta):
    """`w = exp(j theta) - 1`, without cancellation at small angles."""
    half = np.sin(theta / 2)
    return -2 * half * half + 1j * np.sin(theta)


def solve(A, b):
    """Batched solve; a matrix that is exactly singular (a pole at this very point) gives a huge state, or NaN, not an error."""
    try:
        return np.linalg.solve(A, b)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(A)[0] == 0
        nudge = np.finfo(float).eps * np.maximum(np.abs(A).max((-1, -2)), 1) * singular
        return _solved_where_possible(A + nudge[..., None, None] * np.eye(A.shape[-1]), b)


def _solved_where_possible(A, b):
    """The same where no nudge helps, as where rows differ by more decades than a double has digits: NaN there."""
    try:
        return np.linalg.solve(A, b)
    except np.linalg.LinAlgError:
        lost = (np.linalg.slogdet(A)[0] == 0)[..., None, None]
        return np.where(lost, np.nan, np.linalg.solve(np.where(lost, np.eye(A.shape[-1]), A), b))


def inverse(A):
    """Batched inverse; that of an exactly singular matrix is huge, not an error (see `solve`)."""
    try:
        return np.linalg.inv(A)
    except np.linalg.LinAlgError:
        return solve(A, np.broadcast_to(np.eye(A.shape[-1]), A.shape))


def refined(A, inverse_of_A, b):
    """`A^-1 b` with one step of iterative refinement.

    One step makes the backward error small entry by entry (R. D. Skeel, Math. Comp. 35, 1980), where that of a plain solve
    is small beside the largest entry only: states may differ in size by ten decades.
    """
    x = inverse_of_A @ b
    with np.errstate(over="ignore", invalid="ignore"):  # at a pole the state is huge, and stays so
        return x + inverse_of_A @ (b - A @ x)
