"""The slowest and the least damped mode in a verdict."""

import pytest

import wavesweep

# Two springs and masses that do not act on each other, m x'' + d x' + k x = 0, and a filter that only watches.
APART = {
    "rates": {"tick_hz": 500},
    "block": {
        "one": {"type": "mass", "mass": 1.0, "damping": 0.8, "stiffness": 400.0},
        "two": {"type": "mass", "mass": 2.0, "damping": 8.0, "stiffness": 20000.0},
        "watch": {"type": "lowpass", "a": 0.25, "every": 2},
    },
    "wire": {"one.f": "0", "two.f": "0", "watch.u": "one.x"},
}


def test_check_names_the_states_of_the_slowest_mode_and_of_the_least_damped():
    found = wavesweep.verdict(APART)
    assert found["slowest"]["states"][0].startswith("one")
    assert found["least_damped"] is None or found["least_damped"]["damping_ratio"] <= found["slowest"]["damping_ratio"]
    heavy = {**APART, "block": APART["block"] | {"two": {"type": "mass", "mass": 2.0, "damping": 2.0, "stiffness": 20000.0}}}
    found = wavesweep.verdict(heavy)
    assert (found["slowest"]["states"][0][:3], found["least_damped"]["states"][0][:3]) == ("one", "two")
    assert found["least_damped"]["damping_ratio"] == pytest.approx(0.005, rel=1e-6)
