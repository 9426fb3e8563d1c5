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
    assert lines.steps.tolist() == [1] * lines.delayed.size
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
