"""The mode that is in the way, and the value at which it is said."""

import numpy as np
import pytest

from wavesweep.program.analyses.mode_in_the_way import mode_in_the_way
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

INTEGRATOR = {
    "rates": {"tick_hz": 10},
    "numbers": {"K": 1.0},
    "block": {"p": {"type": "integrator", "method": "explicit"}},
    "wire": {"p.u": "-K*p.y"},
}


def near_to(value):
    """What is nearest if the eigenvalue less 1 has to be this."""

    def beyond(delta, _, __):
        return np.abs(delta - value)

    return mode_in_the_way(own_loop(load(INTEGRATOR)), "numbers.K", (0.0, 40.0), beyond)["value"]


def test_the_nearest_value_is_one_at_which_the_loop_is_stable():
    """z = 1 - K/10, stable up to K = 20; a value beyond may come nearer to what is required."""
    assert near_to(-1.0) == pytest.approx(10, abs=1)
    assert near_to(-3.5) == pytest.approx(20, abs=1.2)
    assert near_to(-3.5) < 20


def test_without_a_stable_value_the_nearest_one_is_said():
    """z = 1 + (K + 1)/10 grows at every value."""
    growing = INTEGRATOR | {"wire": {"p.u": "(K + 1)*p.y"}}

    def beyond(delta, _, __):
        return np.abs(delta - 2.1)

    found = mode_in_the_way(own_loop(load(growing)), "numbers.K", (0.0, 40.0), beyond)
    assert found["value"] == pytest.approx(20, abs=1.2)
