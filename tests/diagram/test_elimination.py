"""Elimination with exact zeros."""

import numpy as np

from wavesweep.diagram.elimination import reduced_echelon


def test_a_long_chain_of_equal_states_is_reduced_to_its_head():
    n = 400
    A = np.eye(n) - np.eye(n, k=-1)
    A[0, 0], A[7] = 0, 0
    reduced, pivots = reduced_echelon(A)
    assert len(pivots) == n - 2
    free = [column for column in range(n) if column not in pivots]
    for column, row in pivots.items():
        wanted = np.zeros(n)
        wanted[column] = 1
        wanted[free[0] if column < 7 else free[1]] = -1
        assert (reduced[row] == wanted).all()
