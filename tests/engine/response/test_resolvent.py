"""What bounds a response: the resolvent through its modes, and shifts that depend on numbers, against other arithmetic."""

from types import SimpleNamespace

import numpy as np
import pytest

from wavesweep.engine._response import port
from wavesweep.engine._response.modal import Modal


def test_a_careful_bound_is_that_of_the_inverse_itself():
    """Of `|(w - E)^-1| unsure`, whose modes cancel where eigenvectors are nearly parallel."""
    r, n = np.random.default_rng(1), 4
    E = np.triu(r.normal(size=(n, n))) * 0.5 + np.diag([0.0, 0.0, 1e-3, 0.7])
    w = np.exp(1j * np.array([[0.3, 1.0, 2.9]])) - 1
    b = r.normal(size=(n, 3)) + 0j
    modes = Modal(E, np.zeros((n, n)))
    X, _, gain, off = modes.solve(w, b, 0.0)
    unsure = r.uniform(0, 1, (n, 3))
    bound = modes.careful_bound(w, unsure, gain, off)
    for point in range(3):
        inverse = np.linalg.inv(w[0, point] * np.eye(n) - E)
        assert X[:, point] == pytest.approx(inverse @ b[:, point])
        assert bound[:, point] == pytest.approx(np.abs(inverse) @ unsure[:, point], rel=1e-4)


def test_a_shift_that_depends_on_numbers_is_known_to_rounding():
    """`E_followers V = -E_leads` of two kinds of ticks, with a follower that has no part in it."""
    V = np.array([[0.3], [0.0], [-7.25e3]])
    r = np.random.default_rng(2)
    followers = r.normal(size=(2, 4, 3)) * [1.0, 1.0, 1e-4]
    E = np.concatenate([followers, -followers @ V], axis=-1)
    ticks = SimpleNamespace(maps=[SimpleNamespace(E=each, terms=(np.abs(each),)) for each in E])
    found, error = port._fixed(ticks, [0, 1, 2], [3])
    assert found == pytest.approx(V, rel=1e-12)
    assert found[1] == 0
    assert (np.abs(found - V) <= error).all()
    assert (error < 1e-11 * np.abs(V).max()).all()
