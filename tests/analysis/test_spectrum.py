"""Units in which a matrix is balanced."""

import numpy as np

from wavesweep.analysis.spectrum import balance


def test_balancing_changes_the_units_of_states_and_no_eigenvalue():
    r = np.random.default_rng(1)
    units = 10.0 ** r.uniform(-6, 6, (50, 5))
    E = r.normal(size=(50, 5, 5))
    graded = E * units[:, None, :] / units[:, :, None]
    balanced, found = balance(graded)
    assert np.array_equal(balanced, graded * found[:, None, :] / found[:, :, None])  # powers of two
    assert np.array_equal(np.diagonal(balanced, 0, 1, 2), np.diagonal(graded, 0, 1, 2))
    assert np.abs(balanced).max() < 1e3
    for one, other in zip(np.linalg.eigvals(balanced), np.linalg.eigvals(E), strict=True):
        np.testing.assert_allclose(np.sort_complex(one), np.sort_complex(other), rtol=1e-9)
