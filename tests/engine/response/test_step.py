"""Times and overshoot of a step response that is known."""

from dataclasses import replace

import numpy as np
import pytest

from wavesweep.engine._response.step import Step


def test_times_and_overshoot_are_those_of_a_decay_whatever_its_size():
    """`c (1 - (-r)^k)` is largest in its first tick after 0, by r of its final value."""
    r, period, ticks = 0.8, 1e-3, np.arange(200)
    unit = Step(ticks * period, 1 - (-r) ** ticks, period, 1, 1.0, 0.0, r**200)
    settled = np.ceil(np.log(0.02) / np.log(r))  # the first tick that is within 2 %
    for c in (0.01, -0.3, 1.0, 40.0):
        step = replace(unit, value=c * unit.value, final=c, tail=abs(c) * unit.tail)
        assert step.settling_s == pytest.approx(settled * period)
        assert step.overshoot == pytest.approx(r)
        assert step.peak_s == pytest.approx(period)
