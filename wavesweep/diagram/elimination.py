"""Elimination for built-in controllers: a number counts as zero only if its terms cancel to rounding, so units may be any."""

import numpy as np

ROUNDING = 64 * np.finfo(float).eps  # of the terms of a sum, what is left of it where it is zero


def reduced_echelon(A) -> tuple[np.ndarray, dict[int, int]]:
    """Reduced row echelon form with unit pivots, and column -> row of the pivots."""
    A, size, pivots = A.copy(), np.abs(A), {}
    if not A.size:
        return A, pivots
    used, done = np.zeros(A.shape[1], bool), np.zeros(len(A), bool)
    best, where = np.zeros(len(A)), np.zeros(len(A), int)  # of each row: its largest entry, relative, and the column of that

    def look(rows):
        relative = np.abs(A[rows]) / np.maximum(size[rows].max(1, keepdims=True), np.finfo(float).tiny)
        relative[:, used] = 0
        where[rows] = relative.argmax(1)
        best[rows] = np.take_along_axis(relative, where[rows, None], 1)[:, 0]

    look(np.arange(len(A)))
    for _ in range(min(A.shape)):
        row = int(np.argmax(best))
        if best[row] <= 0:
            break
        column = int(where[row])
        A[row], size[row] = A[row] / A[row, column], size[row] / abs(A[row, column])
        factor = A[:, column].copy()
        factor[row] = 0
        rows, columns = np.flatnonzero(factor), np.flatnonzero(size[row])  # the others stay as they are
        part = np.ix_(rows, columns)
        left = A[part] - factor[rows, None] * A[row, columns]
        terms = size[part] + np.abs(factor[rows, None]) * size[row, columns]
        A[part], size[part] = np.where(np.abs(left) <= ROUNDING * terms, 0.0, left), terms
        A[row, np.abs(A[row]) <= ROUNDING * size[row]] = 0
        pivots[column], used[column], done[row], best[row] = row, True, True, -1
        changed = where == column
        changed[rows] = True
        look(np.flatnonzero(changed & ~done))
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
