"""Elimination with exact zeros: a number counts as zero only if its terms cancel to rounding, so units may be any.

Residues of a prime show whether they cancel exactly: doubles are whole numbers times powers of 2, which have residues, and 0
has the residue 0. Another number has it with a probability of 1e-38.
"""

import numpy as np

PRIME = 2**127 - 1
ROUNDING = 64 * np.finfo(float).eps  # of the terms of a sum, what is left of it where it is zero


def reduced_echelon(A, seen=None) -> tuple[np.ndarray, dict[int, int]]:
    """Reduced row echelon form with unit pivots, and column -> row of the pivots.

    seen: called after each step with the matrix and the row and column of the pivot.
    """
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
        if seen:
            seen(A, row, column)
    return A, pivots


def residue(value: float) -> int:
    """The residue of a finite double. Errors: OverflowError or ValueError for another one."""
    above, below = float(value).as_integer_ratio()
    return above * pow(below, -1, PRIME) % PRIME


def exact_echelon(A, rows) -> tuple[np.ndarray, dict[int, int], bool]:
    """`reduced_echelon`, and whether every entry that `reduced_echelon` takes for zero in any step is exactly zero.

    rows: the same matrix in residues, as column -> entry for each row; entries that are left out are 0.
    """
    rows = [{column: entry % PRIME for column, entry in row.items() if entry % PRIME} for row in rows]
    found = [_no_more_than(A, rows, range(len(rows)))]

    def eliminated(A, row, column):
        first, changed = rows[row], [row]
        inverse = pow(first.get(column, 0) or 1, -1, PRIME)
        for at, entry in first.items():
            first[at] = entry * inverse % PRIME
        for number, other in enumerate(rows):
            factor = other.get(column, 0) if number != row else 0
            if factor:
                changed.append(number)
                for at, entry in first.items():
                    other[at] = (other.get(at, 0) - factor * entry) % PRIME
                    if not other[at]:
                        del other[at]
        found.append(_no_more_than(A, rows, changed))

    return *reduced_echelon(A, eliminated), all(found)


def _no_more_than(A, rows, some):
    """Whether some of the rows of residues have no entries beside those of A."""
    return all(A[number, [*rows[number]]].all() for number in some)


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
