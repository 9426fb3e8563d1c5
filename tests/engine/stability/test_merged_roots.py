"""Roots of the polynomial of crossings that Newton's method takes to one angle leave their column without a proof."""

import numpy as np

from wavesweep.engine._stability.crossings import _merged


def test_columns_are_named_whose_roots_have_become_one_and_no_others():
    """Of three columns the second one has two roots, the nearest to each other, whose polished angles are alike."""
    column = np.array([0, 1, 1, 1, 2, 2])
    seed = np.array([0.3, 0.9, 0.5, 0.50001, 0.3, 0.300001])
    polished = seed.copy()
    polished[3] = polished[2] * (1 + 2e-16)
    assert _merged(column, seed, seed).size == 0
    assert _merged(column, seed, polished).tolist() == [1]
