"""Step responses, held against the simulation tick by tick, python-control and the bounds that come with them."""

from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest

import wavesweep
from wavesweep.program.analyses.steps import routes_of, step_at, step_between

MOTOR = wavesweep.load(Path(__file__).parents[3] / "sweeps" / "templates" / "drive.toml")


@pytest.mark.slow
def test_samples_and_what_follows_are_those_of_a_march():
    route = routes_of(MOTOR)[0]
    step = step_between(MOTOR, route)
    ticks = 2 * step.value.size
    spec = wavesweep.load(MOTOR.tables() | {"simulate": {"from": route[0]}})
    marched = wavesweep.compile(spec).simulate(np.ones(ticks))[route[1]].to_numpy()
    shown, later = np.split(marched, 2)
    assert np.abs(step.value - shown).max() <= step.error + 1e-14 * np.abs(shown).max() < 1e-8
    last = step.value[-step.frame :]
    assert np.abs(later.reshape(-1, step.frame) - last).max() <= step.tail + step.error + 1e-14
    assert abs(marched[-step.frame :].mean() - step.final) <= step.error + step.tail


def test_rise_overshoot_and_settling_are_those_of_python_control():
    step = step_between(MOTOR, ("ref", "speed"))
    known = control.step_info(step.value, T=step.time_s, yfinal=step.final)
    first, second = step.rise_s
    assert second - first == pytest.approx(known["RiseTime"], abs=1e-12)
    assert 100 * step.overshoot == pytest.approx(known["Overshoot"], rel=1e-12)
    assert step.peak_s == pytest.approx(known["PeakTime"], abs=1e-12)
    assert step.settling_s == pytest.approx(known["SettlingTime"], abs=step.period)
    downwards = replace(step, value=-step.value, final=-step.final)
    for number in ("rise_s", "overshoot", "peak_s", "settling_s"):
        assert getattr(downwards, number) == getattr(step, number)


def test_a_step_that_is_added_to_a_signal_comes_back_as_the_closed_loop():
    """Of `y[k+1] = a y[k] + (k_p/c)(s[k] - y[k])` with a delay of a sample: the same sums, written out."""
    spec = wavesweep.load(
        {
            "rates": {"tick_hz": 100},
            "numbers": {"k": 3.0},
            "block": {"plant": {"type": "tf", "num": [1], "den": [1, 2]}, "hold": {"type": "hold", "every": 4}},
            "wire": {"hold.u": "-k*plant.y", "plant.u": "hold.y"},
        }
    )
    step, decay, y, s = step_at(spec, "hold.y"), np.exp(-2 * 0.01), 0.0, 0.0
    for k, value in enumerate(step.value[:200]):
        s = -3.0 * y if k % 4 == 0 else s
        assert value == pytest.approx(s, abs=1e-13)
        y = decay * y + (1 - decay) / 2 * (s + 1)
    assert step.final == pytest.approx(-1.5 / 2.5)
