"""Marginal modes that leave a frame's matrix."""

import numpy as np
import pytest

from wavesweep.engine._monodromy.drift import MarginalModes, without_drift

E = np.array([[[0.0, 2.0], [0.0, -0.5]]])
SHIFT, FOLLOWS, NEVER_READ = (0, ()), (0, ((1, 0.5),)), 1


@pytest.mark.parametrize(
    ("constant", "unobserved", "remaining"),
    [((), (), E[0]), ((SHIFT,), (), [[-0.5]]), ((FOLLOWS,), (), [[-1.5]]), ((SHIFT,), (NEVER_READ,), np.zeros((0, 0)))],
)
def test_what_remains_has_the_other_eigenvalues_and_may_be_nothing(constant, unobserved, remaining):
    drift = MarginalModes(("a", "b"), constant, (), unobserved)
    np.testing.assert_array_equal(without_drift(E, drift)[0], remaining)
    assert without_drift(E, drift, np.abs(E)).shape[1:] == np.shape(remaining)
