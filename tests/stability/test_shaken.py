"""What rounding may do to intervals, in frames that are made otherwise than those in which they were found."""

import numpy as np
import pytest

from wavesweep.stability.perturbation import shaken
from wavesweep.stability.stable import Intervals

END = 2.0  # of the parameter, where the eigenvalue p/2 of the frame is 1


def judged(off=0.0, growth=0.0, noise=1e-16):
    """One interval from 0 to END; off: of the eigenvalue's end here, relative; growth: of it, if the range ends it."""
    found = Intervals(
        column=np.zeros(1, int), index=np.zeros(1, int), count=np.ones(1, int),
        low=np.zeros(1), high=np.full(1, END), low_omega=np.full(1, np.nan), high_omega=np.full(1, np.nan if growth else 0.0),
        residual=np.zeros(1), doubt=np.zeros(1, int),
    )  # fmt: skip

    def errors(_, p):
        E = np.zeros((p.size, 2, 2))
        E[:, 0, 0], E[:, 1, 1] = p / (END * (1 + off)) - 1 + growth, -0.5
        return E, np.full(E.shape, noise)

    return bool(shaken(found, (0.0, 10.0), np.ones(1), errors)[0])


@pytest.mark.parametrize(
    ("given", "lost"),
    [
        ({}, False),
        ({"off": 1e-11}, False),
        ({"off": 1e-7}, True),
        ({"off": -1e-7}, True),
        ({"noise": 1e-6}, True),
    ],
)
def test_an_end_is_held_against_the_frames_that_are_given(given, lost):
    assert judged(**given) == lost


def test_a_verdict_is_held_against_the_frames_that_are_given():
    """All of the interval is clearly unstable here."""
    assert judged(growth=2.0)
