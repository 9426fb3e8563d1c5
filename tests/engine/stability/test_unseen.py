"""What leaves no trace in samples of the frame: windows between them, overflow, eigenvalues that nearly meet."""

import numpy as np
import pytest

import wavesweep
from wavesweep.engine._stability.spectrum import count_outside


@pytest.mark.slow
def test_a_window_in_which_the_tick_explodes_is_found():
    """Between 0.103 and 0.1075 kg the fast loop explodes within every frame; beside it the mode is gone after 1000 ticks."""
    loop = wavesweep.compile(
        {
            "controller": {"kind": "pmw", "b": 19.0},
            "rates": {"ratio": 1000},
            "device": {"damping": 10.0},
            "operator": {"stiffness": 1e6},
        }
    )
    found = loop.stable_intervals(along="device.mass", span=(0.02, 0.3))
    assert found.certified.all()
    assert len(found) == 2
    for end, side in ((found.high[0], 1), (found.low[1], -1)):
        inside, outside = loop.spectral_radius(**{"device.mass": [end * (1 - side * 1e-9), end * (1 + side * 1e-9)]})
        assert inside < 1 < outside
    assert loop.spectral_radius(**{"device.mass": 0.105}) > 1e4


@pytest.mark.slow
def test_what_overflows_is_not_known_and_the_rest_is():
    """From 200 N*s/m on the tick is unstable by itself; a frame of 200 ticks overflows beyond some 665 N*s/m."""
    loop = wavesweep.compile({"controller": {"kind": "pmw"}, "rates": {"ratio": 200}})
    found = loop.stable_intervals(along="b", span=(5.0, 5000.0))
    assert set(found.doubt) == {"overflow"}
    assert not found.certified.any()
    assert found.low[0] == 5.0
    assert (loop.spectral_radius(b=np.concatenate([found.low + 1e-9, found.high * (1 - 1e-9)])) < 1).all()


@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-6])
def test_two_eigenvalues_that_nearly_meet_next_to_the_circle_are_not_counted(apart):
    """A double eigenvalue keeps half of its digits: its side of the circle is anybody's guess within the root of rounding."""
    distance = 1e-9
    E = np.array([[[-distance, 1.0], [0.0, -distance - apart]]])
    assert not count_outside(E)[1][0]
    assert count_outside(1e4 * distance * np.array([[[-1.0, 1e-3], [0.0, -1.5]]]))[1][0]
