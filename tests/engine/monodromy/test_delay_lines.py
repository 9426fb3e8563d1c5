"""States that only hand on what another was a frame ago: solves without them, against solves with them."""

import numpy as np
import pytest

from wavesweep.engine._monodromy.resolvent import DelayLines
from wavesweep.engine._monodromy.unit_circle import on_circle


def random_system(seed):
    """E, B and C of a few loops, most of whose states hand on that of another, in chains, trees and rings."""
    random = np.random.default_rng(seed)
    n, loops = random.integers(1, 14), random.integers(1, 4)
    A = 0.4 * random.normal(size=(loops, n, n)) * (random.random((n, n)) < 0.6)
    B, C = random.normal(size=(loops, n, 1)), random.normal(size=(loops, 1, n))
    for row in np.flatnonzero(random.random(n) < 0.6):
        A[:, row], B[:, row] = 0, 0
        A[:, row, random.integers(n)] = 1
    return A - np.eye(n), B, C


@pytest.mark.parametrize("seed", range(20))
def test_a_solve_of_the_states_that_are_kept_is_one_of_all(seed):
    """At real and at complex angles."""
    E, B, C = random_system(seed)
    lines, random = DelayLines.of(E), np.random.default_rng(seed)
    theta = random.uniform(0.1, 3, (len(E), 5)) + (0.2j * random.normal(size=(len(E), 5)) if seed % 2 else 0)
    w = on_circle(theta)
    A = w[..., None, None] * np.eye(E.shape[-1]) - E[:, None]
    reached, read = lines.reached(E[:, None], B[:, None], w), lines.row(E[:, None], C[:, None], w)
    limit = 1e-14 * np.linalg.cond(A).max()
    for found, exact in (
        (reached, np.linalg.solve(A, B[:, None] + 0j)[..., 0]),
        (read, (C[:, None] @ np.linalg.inv(A))[..., 0, :]),
    ):
        assert np.abs(found - exact).max() <= limit * np.abs(exact).max()


def test_what_is_kept():
    """A chain of two behind state 0, to which state 0 adds; a ring; a state with an input; one that differs between loops."""
    A = np.zeros((2, 7, 7))
    A[:, 0, 0] = 0.5
    A[:, 1, 0] = A[:, 2, 1] = A[:, 3, 4] = A[:, 4, 3] = A[:, 5, 0] = A[:, 6, 5] = 1
    A[:, 2, 0], A[1, 6, 5] = -0.25, 0.5
    lines = DelayLines.of(A - np.eye(7))
    assert [1, 2] in [line.tolist() for line in lines.lines]
    assert {0, 3, 4} <= set(lines.solved)
    assert len({5, 6} & set(lines.solved)) == 1
