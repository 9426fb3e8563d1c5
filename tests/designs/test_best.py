"""The specs of designs that a search found."""

import tomllib
from pathlib import Path

import pytest

from wavesweep.designs.best import text_of
from wavesweep.program.spec import load

pytestmark = pytest.mark.asks("for_all")

SPEC = {
    "controller": {"kind": "pmw"},
    "design": {
        "vary": {"b": {"start": 5.0, "stop": 80.0}},
        "wish": {"z_width": {}},
    },
    "for_all": {"device.mass": [0.08, 0.125], "operator.stiffness": [0.0, 1000.0]},
}


def test_the_walls_are_those_of_the_stiffest_one():
    wishes = {"transparency": {"at_most": 1, "B_VE": [10]}, "z_width": {"B_VE": [0, 1]}}
    row = {"b": 18.0, "z_width": 844.2, "transparency": 0.5}
    text = text_of(load(SPEC | {"design": SPEC["design"] | {"wish": wishes}}), row, 20000.0)
    assert "B_VE = [0.0, 1.0]" in text


def test_what_sets_the_worst_is_held_for_if_it_lies_between_the_listed_values():
    row = {"b": 18.0, "z_width": 844.2, "z_width_scenario": "device.mass=0.1025, operator.stiffness=1000"}
    found = load(tomllib.loads(text_of(load(SPEC), row, 20000.0)))
    assert {axis.path: axis.values for axis in found.for_all.axes} == {
        "device.mass": (0.08, 0.1025, 0.125),
        "operator.stiffness": (0.0, 1000.0),
    }


@pytest.mark.asks("for_all", "simulation")
def test_what_it_holds_for_all_of_stays_in_for_all_and_the_device_keeps_its_encoder_frames_and_wishes():
    frames = [20, {"ticks": 21, "delay": 3}]
    simulate = {"resolution": 2e-5, "frames": frames, "duration_s": 0.5}
    spec = load(SPEC | {"for_all": {"device.damping": {"start": 1.0, "stop": 2.0}}, "simulate": simulate})
    found = load(tomllib.loads(text_of(spec, {"b": 18.0, "z_width": 844.2}, 20000.0)))
    assert [axis.path for axis in found.for_all.axes] == ["device.damping"]
    assert "device.damping" not in [axis.path for axis in found.sweep]
    assert found.simulate["resolution"] == 2e-5
    assert found.simulate["frames"] == spec.simulate["frames"]
    assert found.simulate["duration_s"] == 0.5
    assert found.asking("design").design == spec.asking("design").design


@pytest.mark.asks("simulation")
def test_a_drawn_loop_is_looked_along_its_number_sweeps_no_other_that_was_chosen_and_keeps_its_experiment():
    ranges = {"kv": {"start": 5, "stop": 200}, "kp": {"start": 0.1, "stop": 10}}
    spec = load(Path(__file__).parents[2] / "sweeps/templates/position-loop.toml")
    spec = load(spec.asking("simulate").tables() | {"design": {"vary": ranges, "wish": {"settling": {"at_most": 0.1}}}})
    found = load(tomllib.loads(text_of(spec, {"kv": 20.0, "kp": 1.5, "settling": 0.05}, 0.0)))
    assert ([axis.name for axis in found.sweep], found.along) == (["kv"], "kv")
    assert (found.values["numbers.kp"], found.simulate["input"], found.simulate["duration_s"]) == (1.5, "step", 0.5)


def test_a_channel_is_written_as_it_stands_without_a_table_for_all():
    drawn = {
        "rates": {"tick_hz": 100},
        "numbers": {"k": 1.0},
        "block": {"x": {"type": "mass", "mass": 1.0, "damping": 1.0}, "net": {"type": "channel", "lost": 1}},
        "wire": {"net.u": "-k*x.x", "x.f": "net.y"},
        "design": {"vary": {"k": {"start": 0.5, "stop": 2}}, "wish": {"damping_ratio": {}}},
    }
    found = load(tomllib.loads(text_of(load(drawn), {"k": 0.7, "damping_ratio": 0.4}, 1.0)))
    assert found.values["numbers.k"] == 0.7
    assert found.drawing.channels
