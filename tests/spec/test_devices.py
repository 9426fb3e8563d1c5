"""A preset stands in for what a spec does not give itself, in the simulation alone."""

import pytest

from wavesweep.spec import load
from wavesweep.spec.devices import DEVICES

LOOP = {"controller": {"kind": "pmw"}}


@pytest.mark.parametrize("name", DEVICES)
def test_a_device_fills_in_what_is_not_given(name):
    device = DEVICES[name]
    spec = load(LOOP | {"simulate": {"preset": name}})
    simulated = spec.as_simulated()
    assert (simulated.values["device.mass"], simulated.values["device.damping"]) == (device.mass, device.damping)
    assert {key: simulated.simulate[key] for key in device.beyond_the_model()} == device.beyond_the_model()
    assert spec.values["device.mass"] == 0.1
    assert device.published
    assert device.assumed


def test_what_is_given_stands_before_the_device():
    own = {"device": {"mass": 0.1}, "simulate": {"preset": "phantom-omni", "friction": 0.0}}
    simulated = load(LOOP | own).as_simulated()
    assert (simulated.values["device.mass"], simulated.values["device.damping"]) == (0.1, 0.5)
    assert (simulated.simulate["friction"], simulated.simulate["resolution"]) == (0.0, 0.055e-3)


def test_the_resolved_tables_load_to_the_same_simulation():
    spec = load(LOOP | {"simulate": {"preset": "novint-falcon", "input": "stepped-sine", "frequency_hz": [1, 2]}})
    simulated = spec.as_simulated()
    again = load(simulated.tables()).as_simulated()
    assert again.tables() == simulated.tables()
    assert again.sha256 == simulated.sha256
