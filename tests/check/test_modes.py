"""The slowest and the least damped mode in a verdict."""

import pytest
from support.drawn import APART

import wavesweep
from wavesweep.program.analyses.own_design import own_design
from wavesweep.program.spec import load


def test_check_names_the_states_of_the_slowest_mode_and_of_the_least_damped():
    found = wavesweep.verdict(APART)
    assert found["slowest"]["states"][0].startswith("one")
    assert found["least_damped"] is None or found["least_damped"]["damping_ratio"] <= found["slowest"]["damping_ratio"]
    heavy = {**APART, "block": APART["block"] | {"two": {"type": "mass", "mass": 2.0, "damping": 2.0, "stiffness": 20000.0}}}
    found = wavesweep.verdict(heavy)
    assert (found["slowest"]["states"][0][:3], found["least_damped"]["states"][0][:3]) == ("one", "two")
    assert found["least_damped"]["damping_ratio"] == pytest.approx(0.005, rel=1e-6)


def test_a_loop_without_states_is_over_within_its_frame_of_several_ticks():
    tables = {
        "rates": {"tick_hz": 100},
        "block": {"f": {"type": "gain", "k": 2.0, "every": 4}},
        "wire": {"f.u": "cmd"},
        "ports": {"inputs": {"cmd": "cmd"}, "outputs": {"y": "f.y"}},
    }
    found = own_design(load(tables))
    assert (found["stable"], found["slowest"]["time_constant_s"], found["slowest"]["states"]) == (True, 0, [])
