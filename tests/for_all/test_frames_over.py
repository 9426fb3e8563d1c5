"""Frames over cells of numbers: which side a cell is divided along."""

import numpy as np
import pytest

from wavesweep.engine.sets import UnresolvedError
from wavesweep.for_all.frames_over import FramesOver


@pytest.mark.parametrize(("number", "side"), [(0, 1), (1, 3), (None, 3)])
def test_a_cell_without_a_bound_is_divided_along_a_side_that_is_wide(number, side, monkeypatch):
    """What has no bound names one of the wide sides; a side that is a point, here the first and the third, is none."""

    def no_bound(*_):
        raise UnresolvedError(number)

    monkeypatch.setattr(FramesOver, "_maps", no_bound)
    frames = object.__new__(FramesOver)
    assert frames.at(np.array([[1.0, 0.0, 2.0, 0.0], [1.0, 1.0, 2.0, 3.0]])) == side
