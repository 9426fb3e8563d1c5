"""Return differences of torn ports, and losses of frames, loop by loop."""

from math import prod

import numpy as np

from wavesweep.diagram.block import KEPT, LARGEST_LOSS
from wavesweep.lifted.compiled.caching import compiled


def inverses(loop, sizes, reached, refined: int):
    """Return the inverses of matrices, their determinants and condition numbers; see `connect`.

    loop: `(..., n, n)`; sizes: of the terms of their entries. reached: entries of the inverse that are not zero by structure.
    refined: number of steps of refinement.
    """
    n, batch = loop.shape[-1], loop.shape[:-2]
    whole, sizes = (
        np.ascontiguousarray(np.broadcast_to(part, loop.shape)).reshape(prod(batch), n, n) for part in (loop, sizes)
    )
    inverse, pivot, condition = np.empty_like(whole), np.empty(len(whole), whole.dtype), np.empty(len(whole))
    _inverses(whole, sizes, reached, refined if n > 1 else 0, inverse, pivot, condition)
    return inverse.reshape(loop.shape), pivot.reshape(batch), condition.reshape(batch)


@compiled
def _inverses(loop, sizes, reached, refined, inverse, pivot, condition):
    """See `inverses`."""
    n = loop.shape[1]
    left, change, power = np.empty((n, n), loop.dtype), np.empty((n, n), loop.dtype), np.empty((2, n, n))
    for at in range(len(loop)):
        pivot[at] = _inverse(loop[at], left, inverse[at])
        for _ in range(refined):
            _refine(loop[at], inverse[at], left, change)
        for i in range(n):
            for j in range(n):
                inverse[at, i, j] = inverse[at, i, j] if reached[i, j] else 0.0
                power[0, i, j] = abs(inverse[at, i, j])
        _product(power[0], sizes[at], power[1])
        condition[at] = _condition(power)


@compiled
def _refine(loop, inverse, left, change):
    """Add `inverse (1 - loop inverse)` to the inverse; left, change: memory."""
    n = len(loop)
    _product(loop, inverse, left)
    for i in range(n):
        for j in range(n):
            left[i, j] = (1.0 if i == j else 0.0) - left[i, j]
    _product(inverse, left, change)
    for i in range(n):
        for j in range(n):
            inverse[i, j] += change[i, j]


@compiled
def _condition(power):
    """Return the condition number from the second of two matrices, both of which are used up; see `connect._condition`."""
    n, largest = power.shape[1], 0.0
    for _ in range(3 if n > 1 else 0):
        _product(power[1], power[1], power[0])
        power[1] = power[0]
    for i in range(n):
        total = power[1, i].sum()
        if np.isnan(total):
            return np.inf
        largest = max(largest, total)
    return largest**0.125 if n > 1 else largest


@compiled
def _product(A, B, found):
    """Store A B."""
    n = len(A)
    for i in range(n):
        for j in range(n):
            total = A[i, 0] * B[0, j]
            for k in range(1, n):
                total += A[i, k] * B[k, j]
            found[i, j] = total


@compiled
def _inverse(matrix, left, found):
    """Store the inverse, infinite if there is none, and return the determinant; left: memory."""
    n, pivot = len(matrix), matrix[0, 0] * 0 + 1
    for i in range(n):
        for j in range(n):
            left[i, j], found[i, j] = matrix[i, j], 1.0 if i == j else 0.0
    for k in range(n):
        row = _largest(left, k)
        size = abs(left[row, k].real) + abs(left[row, k].imag)
        if not size > 0:  # or not a number
            found[:] = np.inf if size == 0 else np.nan
            return pivot * (0.0 if size == 0 else np.nan)
        if row != k:
            pivot = -pivot
        for j in range(n if row != k else 0):
            left[k, j], left[row, j] = left[row, j], left[k, j]
            found[k, j], found[row, j] = found[row, j], found[k, j]
        pivot *= left[k, k]
        _cleared(left, found, k)
    return pivot


@compiled
def _largest(left, k):
    """Return the row, from k on, whose entry in column k is the largest, or one that is not a number."""
    best, row = -1.0, k
    for i in range(k, len(left)):
        size = abs(left[i, k].real) + abs(left[i, k].imag)
        if not size <= best:
            best, row = size, i
    return row


@compiled
def _cleared(left, found, k):
    """Make column k that of the identity, in steps of Gauss and Jordan."""
    n, back = len(left), 1 / left[k, k]
    for j in range(n):
        left[k, j], found[k, j] = left[k, j] * back, found[k, j] * back
    for i in range(n):
        factor = left[i, k]
        for j in range(n if i != k else 0):
            left[i, j] -= factor * left[k, j]
            found[i, j] -= factor * found[k, j]


def losses(E, tick, ratio: int) -> np.ndarray:
    """Return `block.loss` of frames, `(...)`; E: less identity; tick: the same of their ticks, ratio: their number."""
    n, batch = E.shape[-1], E.shape[:-2]
    found = np.empty(prod(batch))
    _losses(*(np.ascontiguousarray(part).reshape(found.size, n, n) for part in (E, tick)), float(ratio), found)
    return found.reshape(batch)


@compiled
def _losses(E, tick, ratio, found):
    """See `losses`."""
    n = E.shape[1]
    pairs, kept = np.empty((n, n)), np.empty(n, np.bool_)
    for at in range(len(E)):
        for i in range(n):
            for j in range(i, n):
                pairs[i, j] = pairs[j, i] = abs(E[at, i, j] * E[at, j, i])
        for i in range(n):
            kept[i] = abs(1 + E[at, i, i]) >= KEPT
            for j in range(n):
                kept[i] |= i != j and pairs[i, j] >= KEPT**2
        largest = 1.0
        for i in range(n):
            for j in range(i, n if kept[i] else i):
                of_terms = ratio * abs(tick[at, i, j]) * (ratio * abs(tick[at, j, i]))
                if kept[j] and of_terms > 0:
                    share = of_terms / pairs[i, j]
                    largest = max(largest, share) if share == share else largest  # noqa: PLR0124 - not a number
        found[at] = min(np.sqrt(largest), LARGEST_LOSS)
