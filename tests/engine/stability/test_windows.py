"""Windows about crossings of a loop with a long delay: those that meet are one, as far as the widest reaches."""

from types import SimpleNamespace

import numpy as np
import pytest

from wavesweep.engine._stability.reduced_equation import WINDOW_OF_ERRORS, _windows


@pytest.mark.parametrize("wide", [0, 1, 2])
def test_windows_that_meet_reach_as_far_as_the_widest(wide):
    values = np.array([1.0, 1.1, 1.2, 5.0])
    moved = np.full(4, 0.01)
    moved[wide] = 0.5
    panels = SimpleNamespace(middle=np.zeros(1), half=np.ones(1), column=np.zeros(1, int))
    zero = np.zeros(4, int)
    crossings = SimpleNamespace(panel=zero, x=values, moved=moved / WINDOW_OF_ERRORS, theta=zero + 1.0)
    found = _windows(panels, crossings, (0.0, 10.0), lambda value: 1e-6 * value)
    assert found.low.tolist() == pytest.approx([values[wide] - 0.5, 4.99])
    assert found.high.tolist() == pytest.approx([values[wide] + 0.5, 5.01])
