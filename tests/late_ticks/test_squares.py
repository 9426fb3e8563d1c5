"""Symmetric squares: what they do to products of states, and their control points and bounds, held against the definition."""

import numpy as np
from scipy.special import comb

from wavesweep.late_ticks.squares import enclosed_square, square_of_curves, squared


def products_of(x):
    """The products of a state's entries, in which squares of matrices act."""
    i, j = np.triu_indices(len(x))
    return np.where(i == j, 1, np.sqrt(2)) * x[i] * x[j]


def test_the_square_of_a_matrix_moves_products_as_the_matrix_moves_states():
    rng = np.random.default_rng(0)
    A, x = rng.standard_normal((4, 4)), rng.standard_normal(4)
    assert np.allclose(squared(A) @ products_of(x), products_of(A @ x), rtol=1e-13)


def test_a_surface_of_squares_is_the_square_of_the_surface_and_its_bounds_hold_all_that_is_known():
    rng = np.random.default_rng(1)
    A = rng.standard_normal((2, 3, 4, 3, 3))
    dA = 1e-3 * rng.random(A.shape)

    def at(points, s, t):
        k, l = points.shape[0] - 1, points.shape[2] - 1
        of_s = [comb(k, i) * s**i * (1 - s) ** (k - i) for i in range(k + 1)]
        of_t = [comb(l, j) * t**j * (1 - t) ** (l - j) for j in range(l + 1)]
        return np.einsum("i,j,imjab->mab", of_s, of_t, points)

    value, error = enclosed_square(A, dA)
    for s, t in rng.random((5, 2)):
        assert np.allclose(at(square_of_curves(A), s, t), squared(at(A, s, t)), rtol=1e-12)
        off = rng.choice([-1, 1], A.shape) * dA
        assert (np.abs(squared(at(A + off, s, t)) - at(value, s, t)) <= at(error, s, t)).all()
    assert (error < 1e-2 * (1 + np.abs(value))).all()
