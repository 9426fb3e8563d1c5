"""Semidefinite programmes whose solutions are eigenvalues."""

import numpy as np
import pytest

from wavesweep.engine.switched import Inequality, minimised


def test_the_largest_t_below_some_matrices_is_the_least_of_their_eigenvalues():
    """`A_i - t I >= 0`, one unknown for all, as the largest t of `-t`."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(3, 4, 4))
    A = A + A.mT
    below = Inequality(A, np.broadcast_to(-np.eye(4), (3, 1, 4, 4)), np.zeros((3, 1), int))
    (t,) = minimised(np.array([-1.0]), [below], np.zeros((0, 1)), np.zeros(0))
    assert t == pytest.approx(np.linalg.eigvalsh(A).min(), rel=1e-9)


def test_an_inequality_that_nothing_meets_has_no_solution():
    least = Inequality(np.array([[[-1.0]]]), np.array([[[[1.0]]]]), np.array([[0]]))
    one = np.ones((1, 1))
    assert minimised(np.ones(1), [least], one, np.array([2.0])) == pytest.approx(1.0, rel=1e-9)
    assert np.isnan(minimised(np.ones(1), [least], one, np.array([0.5]))).all()
