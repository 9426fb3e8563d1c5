"""The slowest and the least damped mode in a verdict."""

import pytest
from support.drawn import APART

import wavesweep


def test_check_names_the_states_of_the_slowest_mode_and_of_the_least_damped():
    found = wavesweep.verdict(APART)
    assert found["slowest"]["states"][0].startswith("one")
    assert found["least_damped"] is None or found["least_damped"]["damping_ratio"] <= found["slowest"]["damping_ratio"]
    heavy = {**APART, "block": APART["block"] | {"two": {"type": "mass", "mass": 2.0, "damping": 2.0, "stiffness": 20000.0}}}
    found = wavesweep.verdict(heavy)
    assert (found["slowest"]["states"][0][:3], found["least_damped"]["states"][0][:3]) == ("one", "two")
    assert found["least_damped"]["damping_ratio"] == pytest.approx(0.005, rel=1e-6)
