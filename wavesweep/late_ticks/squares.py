"""Symmetric squares of matrices: what a matrix A does to the products `x_i x_j` of a state's entries.

A quadratic form of these products is one of degree four in x. If it decreases for the squares of
some matrices, their products decay, which no quadratic form of x may show: an oscillation that is
little damped, whose stiffness changes twice in a turn, needs them (G. Blekherman, P. A. Parrilo,
R. R. Thomas, Semidefinite Optimization and Convex Algebraic Geometry, SIAM 2013).
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from math import comb

import numpy as np

from wavesweep.engine.doubles import UNIT_ROUNDING
from wavesweep.engine.switched import acting

ROUNDINGS = 64  # of a product in an entry of a square and of its bound, beside those of sums


def squared(X: np.ndarray) -> np.ndarray:
    """Return the symmetric squares of matrices `(..., n, n)`."""
    return square_of_curves(X[None, ..., None, :, :])[0, ..., 0, :, :]


def square_of_curves(A: np.ndarray) -> np.ndarray:
    """Return the control points of the squares of Bezier surfaces: `(k, ..., l, n, n)`, with k
    control points in one direction and l in the other, to `(2 k - 1, ..., 2 l - 1, N, N)`.

    If all entries are bounds, so are those that it gives.
    """
    k, *several, l, n, _ = A.shape
    vectors = np.moveaxis(A, 0, -4).reshape(*several, k * l, n * n)
    weights = _weights(k, l)
    pairs = vectors.mT[..., None, :, :] @ (weights @ vectors[..., None, :, :])
    pairs = (pairs + pairs.mT) / 2
    acts = acting(pairs.reshape(-1, n**4), n)
    surface = acts.reshape(*several, 2 * k - 1, 2 * l - 1, *acts.shape[-2:])
    return np.moveaxis(surface, -4, 0)


def enclosed_square(A: np.ndarray, dA: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return `square_of_curves` of matrices that are known within dA, and bounds on its errors."""
    size = np.abs(A)
    largest = square_of_curves(size + dA)
    terms = (A.shape[0] * A.shape[-3]) ** 2
    rounding = (ROUNDINGS + 4 * terms) * UNIT_ROUNDING * largest
    return square_of_curves(A), largest - square_of_curves(size) + rounding


@lru_cache(maxsize=16)
def _weights(k, l):
    """How much products of two control points of a surface are of those of its square, `((2 k - 1) (2
    l - 1), k l, k l)`: the binomials of Bernstein's polynomials."""
    weights = np.zeros((2 * k - 1, 2 * l - 1, k, l, k, l))
    for i, p, j, q in product(range(k), range(l), range(k), range(l)):
        of_k = comb(k - 1, i) * comb(k - 1, j) / comb(2 * k - 2, i + j)
        of_l = comb(l - 1, p) * comb(l - 1, q) / comb(2 * l - 2, p + q)
        weights[i + j, p + q, i, p, j, q] = of_k * of_l
    return weights.reshape(-1, k * l, k * l)
