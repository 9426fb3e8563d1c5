"""Forms for proof files at single values, by numpy: P - A'PA = U with Stein's equation."""

import numpy as np

from wavesweep.checker import balls, file


def matrix_of(family: file.Family, kind: str = "") -> np.ndarray:
    """A frame at a point, in doubles."""
    (part,) = family.matrix(kind, balls.Cell({})).parts.values()
    return np.array([[x / balls.ONE for x in row] for row in part])


def form_of(A: np.ndarray) -> tuple[dict, int]:
    """A cell with a form of a matrix, and how many of its modes are outside."""
    left = np.eye(len(A) ** 2) - np.kron(A.T, A.T)
    units = abs(np.diag(np.linalg.solve(left, np.eye(len(A)).ravel()).reshape(A.shape)))
    P = np.linalg.solve(left, np.diag(units).ravel()).reshape(A.shape)
    scale = 1 / np.sqrt(abs(np.diag(P)))
    values, vectors = np.linalg.eigh((P + P.T) / 2 * scale * scale[:, None])
    L = (np.sqrt(abs(values)) * vectors).T / scale
    L /= abs(L).max()
    cell = {"L": [[f"{x:.17g}" for x in row] for row in L], "signs": "".join("+" if x > 0 else "-" for x in values)}
    return cell, int((values < 0).sum())
