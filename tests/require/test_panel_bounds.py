"""A panel is judged only if the whole disc about it lies where the loop is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from wavesweep.require.by_discs import _LoopsInDiscs
from wavesweep.require.disc_panels import GOOD, OPEN
from wavesweep.require.discs import Spiral


@pytest.mark.parametrize(
    ("low", "high", "label"), [(0.4, 0.6, GOOD), (0.0, 0.2, OPEN), (0.8, 1.0, OPEN)], ids=["inside", "below", "above"]
)
def test_a_disc_that_leaves_what_is_known_leaves_its_panel_open(low, high, label):
    frames = lambda _column, p: SimpleNamespace(pivots=np.ones((p.size, 1)))  # noqa: E731 - one line among others
    errors = lambda _column, p: (np.full((p.size, 1, 1), -0.5, complex), np.full((p.size, 1, 1), 1e-15))  # noqa: E731
    loops = _LoopsInDiscs(frames, errors, None, np.array([0]), 1, np.array([0]), Spiral(0.5))
    found = loops.label(np.array([0]), np.array([low]), np.array([high]), (np.array([0.0]), np.array([1.0])))
    assert found.tolist() == [label]
