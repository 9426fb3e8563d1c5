"""The stiffness felt at the ends of intervals, where a frame may not determine the state at rest."""

import numpy as np
import pytest

from wavesweep.haptics.felt import felt_at_ends


def test_a_stiffness_that_only_its_own_end_does_not_determine_follows_from_both_sides():
    """At -2 and 3 a mode is at z = 1; at 0 there is none, and another mode at 3.5."""

    def stiffness(rows, values):
        smooth = 40 * np.exp(0.3 * values) + 5 * rows
        return np.where((values == -2) | (values == 3), 1e9, smooth)

    p, omega = np.array([[-2.0, 0.0, 3.5], [3.0, 1.0, 4.0]]), np.array([[0.0, 0.0, 1.0], [0.0, 2.0, 0.0]])
    assert felt_at_ends(p, omega, stiffness) == pytest.approx(40 * np.exp(0.3 * p) + [0.0, 5.0, 10.0], rel=1e-11)
