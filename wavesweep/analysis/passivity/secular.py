"""Extreme eigenvalues of a diagonal matrix with a few rows of mixture, at a cost linear in its size."""

import numpy as np

ROUNDS = 60
DENSE = 40  # up to this size LAPACK is quicker
BISECTIONS = 52


def largest(diagonal, weight):
    """Largest eigenvalue of `diag(d) + l l*` with `weight = |l|^2`; arrays `(..., M)`, the result `(...)`.

    It is the root beyond max d of `sum weight/(x - d) = 1`. The reciprocal of the sum is concave and rises there
    (Bunch, Nielsen, Sorensen 1978), so Newton from max(d + weight), below the root, climbs to it without a guard.
    Accuracy: rounding.
    """
    x = (diagonal + weight).max(-1)
    for _ in range(ROUNDS):
        gap = x[..., None] - diagonal
        gap = np.where((gap > 0) & (weight > 0), gap, np.inf)  # an entry without weight is an eigenvalue of its own
        share = (weight / gap).sum(-1)
        slope = (weight / gap**2).sum(-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(slope > 0, share * (share - 1) / slope, 0.0)
        x = x + np.maximum(step, 0)
        if np.all(step <= 4 * np.finfo(float).eps * np.abs(x)):
            break
    return x


def smallest_hermitian(diagonal, left, right):
    """Smallest eigenvalue of the Hermitian part of `diag(d) + left right`.

    d `(..., M)`, left `(..., M, r)`, right `(..., r, M)`, complex.
    Small matrices go to LAPACK whole. Others are bisected: with `W = [left, right*]` the mixture's
    Hermitian part is `W K W*`, K = [0 I; I 0]/2, and the number of eigenvalues below x is that of the d below x, plus
    the positive ones of `K^-1 + W* (d - x)^-1 W`, less r (Haynsworth's inertia formula): O(M r^2) a step.
    Accuracy: rounding of the largest entry.
    """
    if diagonal.shape[-1] <= DENSE:
        matrix = left @ right
        index = np.arange(diagonal.shape[-1])
        matrix[..., index, index] += diagonal
        return np.linalg.eigvalsh((matrix + np.swapaxes(matrix.conj(), -1, -2)) / 2)[..., 0]
    return _bisect(diagonal.real, left, np.swapaxes(right.conj(), -1, -2))


def _bisect(diagonal, left, right):
    rank = left.shape[-1]
    balance = (_size(right) / np.where(_size(left) > 0, _size(left), 1))[..., None, :] ** 0.25
    balance = np.where(balance > 0, balance, 1)
    W = np.concatenate([left * balance, right / balance], axis=-1)
    pairs = W.conj()[..., :, None] * W[..., None, :]
    inverse = 2 * np.roll(np.eye(2 * rank), rank, axis=0)
    reach = np.sqrt(_size(left) * _size(right)).sum(-1)
    low = diagonal.min(-1) - reach
    high = diagonal.min(-1) + reach
    floor = np.finfo(float).eps * (np.abs(diagonal).max(-1) + reach)[..., None]
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        gap = diagonal - middle[..., None]
        gap = np.where(np.abs(gap) < floor, floor, gap)  # too close to an entry to tell: within the accuracy stated
        small = inverse + (pairs / gap[..., None, None]).sum(-3)
        positive = (np.linalg.eigvalsh(small) > 0).sum(-1)
        some_below = (gap < 0).sum(-1) + positive - rank > 0
        low, high = np.where(some_below, low, middle), np.where(some_below, middle, high)
    return (low + high) / 2


def _size(columns):
    return (np.abs(columns) ** 2).sum(-2)
