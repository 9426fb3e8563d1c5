"""A class of blocks is drawn once and used several times: as if drawn one by one, mistakes at its own lines."""

import pathlib

import pytest

import wavesweep
from wavesweep.program.spec import load

TWO = (pathlib.Path(__file__).parent / "mistakes" / "classes.toml").read_text(encoding="utf-8")
ONE_BY_ONE = {
    "rates": {"tick_hz": 1000},
    "numbers": {"k": 80.0, "kp": 200.0},
    "block": {
        "a": {"type": "mass", "mass": 0.2, "damping": 0.5},
        "fa": {"type": "lowpass", "cutoff_hz": 200},
        "b": {"type": "mass", "mass": 0.3, "damping": 0.7, "stiffness": 5.0},
        "fb": {"type": "lowpass", "cutoff_hz": 200},
    },
    "wire": {
        "fa.u": "a.v",
        "a.f": "-kp*a.x - 3*fa.y + k*(b.x - a.x) + push",
        "fb.u": "b.v",
        "b.f": "2*kp*(a.x - b.x) - 3*fb.y + k*(a.x - b.x)",
    },
    "ports": {"hand": {"force": "push", "displacement": "a.x"}},
    "sweep": {"along": "kp", "kp": {"start": 0, "stop": 40000}, "k": [0, 80]},
}


def test_two_blocks_of_a_class_are_its_blocks_with_their_names(write):
    spec = load(write(TWO))
    assert [block.name for block in spec.drawing.blocks] == ["left.motor", "left.filter", "right.motor", "right.filter"]
    assert [name for name, *_ in spec.drawing.numbers] == ["k", "left_kp", "left_kd", "left_J", "right_kd", "right_J"]
    assert spec.names.keys["numbers.right_kd"].unit == "N*m*s/rad"
    assert load(spec.tables()).sha256 == spec.sha256
    found, expected = (wavesweep.compile(each).stable_intervals() for each in (spec, ONE_BY_ONE))
    assert found.certified.all()
    assert found[["low", "high"]].to_numpy() == pytest.approx(expected[["low", "high"]].to_numpy(), rel=1e-10)
    responses = (wavesweep.compile(each).response([0.0, 1.0, 30.0]) for each in (spec, ONE_BY_ONE))
    one, other = (each[["admittance_re", "admittance_im"]].to_numpy() for each in responses)
    assert one == pytest.approx(other, rel=1e-10)


def test_numbers_of_a_block_are_set_and_swept_by_their_names(write):
    spec = load(
        write(TWO),
        ["block.left.J=0.25", "right_kd=4", "block.right.filter.cutoff_hz=90", 'sweep."block.left.motor.damping"=[0.1, 0.2]'],
    )
    assert (spec.values["numbers.left_J"], spec.values["numbers.right_kd"]) == (0.25, 4.0)
    assert spec.tables()["block"]["right.filter"]["cutoff_hz"] == 90
    assert [axis.path for axis in spec.sweep] == ["numbers.left_kp", "numbers.k", "block.left.motor.damping"]
