"""Built-in loops whose motors are late, against equations of their own in ball arithmetic."""

import numpy as np
import pytest
from support import exact
from support.certified import Witness
from support.specs import KINDS, nested, values_of

import wavesweep
from wavesweep.core.analyses.assumptions import assumes
from wavesweep.core.spec import load
from wavesweep.simulation.from_spec import simulated

SPAN = (0.0, 3000.0)


def values(kind, late, **more):
    more = {"ratio": 6, "delay": 2, "Kp": 4.0, "B_VE": 0.8, "K_LM": 60.0, "mass": 0.07, "lp1_cutoff_hz": 40.0, **more}
    return values_of(kind, **more) | {"device.delay": late}


@pytest.mark.slow
@pytest.mark.parametrize("late", [1, 7])
@pytest.mark.parametrize("kind", KINDS)
def test_intervals_of_every_controller_are_those_of_its_equations_with_the_force_late(kind, late):
    own = values(kind, late)
    found = wavesweep.compile(nested(own)).stable_intervals("K_VE", SPAN)
    assert found.certified.all()
    truth = [r for r in Witness(own).regions("K_VE", SPAN, own["environment.B_VE"]) if r.unstable == 0]
    ends = [[float(end.mid()) for end in (region.low, region.high)] for region in truth]
    np.testing.assert_allclose(found[["low", "high"]][found.intervals > 0], np.reshape(ends, (-1, 2)), rtol=1e-9, atol=1e-7)
    assert f"amplifier late by {late} tick" in assumes(load(nested(own)))


@pytest.mark.parametrize("kind", KINDS)
def test_a_simulation_is_the_march_of_these_equations(kind):
    """`f_m` is the force of the motors, which the hand feels."""
    own, force = values(kind, 3, K_VE=40.0), np.random.default_rng(1).normal(size=120)
    signals, expected = simulated(load(nested(own)), force).signals, exact.march(own, force)
    for name in ("x", "f_m"):
        np.testing.assert_allclose(signals[name], expected[name], rtol=0, atol=1e-10 * np.abs(expected[name]).max())


def test_in_series_with_the_delay_of_a_held_force_only_the_sum_counts():
    one, other = (values("dc-slow", late, delay=delay) for late, delay in ((0, 5), (3, 2)))
    ends = [wavesweep.compile(nested(each)).stable_intervals("K_VE", SPAN).high[0] for each in (one, other)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)
    swept = wavesweep.stability_region(
        nested(other) | {"sweep": {"along": "K_VE", "K_VE": {"start": 0, "stop": 3000}, "device.delay": [0, 3]}}
    )
    assert swept["high"][1] == pytest.approx(ends[1], rel=1e-12)


@pytest.mark.parametrize("late", [0, 2])
def test_the_passive_wall_is_that_of_its_sampling_and_its_delay(late):
    """`d/(T/2 + delay)`, on both sides of it."""
    own = values("dc", late, B_VE=0.0, damping=1.2)
    own["environment.K_VE"] = 1.2 * own["rates.fast_hz"] / (0.5 + late)
    for share, passive in ((1 - 1e-6, True), (1 + 1e-6, False)):
        table = wavesweep.compile(nested(own)).passivity(K_VE=share * own["environment.K_VE"])
        assert bool(table.port_passive[0]) is passive
