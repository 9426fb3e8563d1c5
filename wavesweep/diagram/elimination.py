"""Elimination with exact zeros: a number counts as zero only if its terms cancel to rounding, so units may be any."""

import numpy as np

ROUNDING = 64 * np.finfo(float).eps  # of the terms of a sum, what is left of it where it is zero


def reduced_echelon(A) -> tuple[np.ndarray, dict[int, int]]:
    """Reduced row echelon form with unit pivots, and column -> row of the pivots."""
    A, size, pivots, free = A.copy(), np.abs(A), {}, list(range(A.shape[0]))
    for _ in range(min(A.shape)):
        relative = np.abs(A[free]) / np.maximum(size[free].max(1, keepdims=True), np.finfo(float).tiny)
        relative[:, list(pivots)] = 0
        if not relative.any():
            break
        at, column = np.unravel_index(np.argmax(relative), relative.shape)
        row = free.pop(at)
        A[row], size[row] = A[row] / A[row, column], size[row] / abs(A[row, column])
        factor = np.where(np.arange(A.shape[0]) == row, 0.0, A[:, column])[:, None]
        A, size = A - factor * A[row], size + np.abs(factor) * size[row]
        A[np.abs(A) <= ROUNDING * size] = 0
        pivots[int(column)] = row
    return A, pivots


def sum_or_zero(parts) -> float:
    """The sum of these numbers, 0 if they cancel to rounding."""
    parts = list(parts)
    total = sum(parts)
    return total if abs(total) > ROUNDING * sum(map(abs, parts)) else 0.0


def without_rounding(value: float) -> float:
    """The number without its rounding, if it is a small fraction but for that. None is too small: units may be any."""
    near = round(value * 12)
    return near / 12 if abs(value * 12 - near) <= ROUNDING * abs(near) else value


def first_of_batch(array) -> np.ndarray:
    """The first matrix of a batch."""
    return array[(0,) * (array.ndim - 2)].real
