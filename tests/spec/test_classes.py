"""A class of blocks is drawn once and used several times: as if drawn one by one, mistakes at its own lines."""

import pytest

import wavesweep
from wavesweep.errors import SpecError
from wavesweep.spec import load

TWO = """
[rates]
tick_hz = 1000

[numbers]
k = { value = 80.0, unit = "N*m/rad", description = "between the joints" }

[type.joint.numbers]
kp = 200.0
kd = { value = 3.0, unit = "N*m*s/rad", description = "damping of the controller" }
J = 0.2

[type.joint.block.motor]
type = "mass"
mass = "J"
damping = 0.5

[type.joint.block.filter]
type = "lowpass"
cutoff_hz = 200

[type.joint.signals]
error = "target - motor.x"

[type.joint.wire]
"filter.u" = "motor.v"
"motor.f" = "kp*error - kd*filter.y + torque"

[type.joint.ports]
inputs = ["target", "torque"]
outputs = { angle = "motor.x" }

[block.left]
type = "joint"

[block.right]
type = "joint"
kp = "2*left_kp"
J = 0.3
motor = { damping = 0.7, stiffness = 5.0 }

[wire]
"left.target" = "0"
"left.torque" = "k*(right.angle - left.angle) + push"
"right.target" = "left.angle"
"right.torque" = "k*(left.motor.x - right.angle)"

[ports]
hand = { force = "push", displacement = "left.angle" }

[sweep]
along = "left_kp"
left_kp = { start = 0, stop = 40000 }
k = [0, 80]
"""
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


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            '"target - motor.x"',
            '"target - motor.pos"',
            "23:9: signals.left.error: expected an output of left.motor: left.motor.v or left.motor.x, found",
        ),
        (
            'mass = "J"',
            'mass = "I"',
            '15:9: block.left.motor.mass: expected the name of a number in [numbers], found an unknown name "I"',
        ),
        (
            "damping = 0.5",
            "dampin = 0.5",
            "16:1: block.left.motor.dampin: expected one of type, mass, damping, stiffness, every, phase, found",
        ),
        ("J = 0.3", "I = 0.3", "39:1: block.right.I: expected one of type, J, kd, kp, filter, motor, found an unknown key"),
        (
            '"left.target" = "0"\n',
            "",
            '34:8: block.left.target: expected a wire to this input, "left.target" = "..." in [wire], found none',
        ),
        (
            'type = "joint"\n\n[block.right]\ntype = "joint"',
            'type = "mass"\nmass = 1\n\n[block.right]\ntype = "mass"',
            "8:2: type.joint: expected a type that a block has, found one that none has",
        ),
        (
            "[type.joint.ports]\ninputs",
            "[type.joint.ports]\ninputt",
            "30:1: type.joint.ports.inputt: expected one of inputs, outputs, found an unknown key; did you mean `inputs`?",
        ),
        (
            "[type.joint.signals]",
            "[type.joint.signal]",
            "23:1: type.joint.signal.error: expected one of numbers, block, signals, wire, ports, found an unknown key",
        ),
        (
            "[numbers]",
            "[numbers]\nleft_J = 1",
            'a.toml:6:1: numbers.left_J: expected another name than that of a part of left, found "left_J"',
        ),
        ("joint", "mass", 'type.mass: expected a name that no type of block has, found "mass"'),
    ],
)
def test_a_mistake_in_a_class_is_at_its_line(old, new, message, write):
    with pytest.raises(SpecError) as error:
        load(write(TWO.replace(old, new)))
    assert any(message in line for line in str(error.value).splitlines()), str(error.value)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (3, "type: expected a table, found 3"),
        ({"j": 3}, "type.j: expected a table, found 3"),
        ({"j": {"block": 3}}, "type.j.block: expected a table, found 3"),
        ({"j": {"wire": "u"}}, 'type.j.wire: expected a table, found "u"'),
        ({"j": {"ports": {"inputs": "u"}}}, 'type.j.ports.inputs: expected a list of names, found "u"'),
        ({"j": {"ports": {"inputs": [3]}}}, "type.j.ports.inputs: expected a list of names, found a list"),
        ({"j": {"ports": {"outputs": "u"}}}, 'type.j.ports.outputs: expected a table, found "u"'),
        ({"j": {"numbers": {"k-k": 3}}}, "numbers.b_k-k: expected a name of letters, digits and _"),
        ({"j": {"block": {"m": 3}}}, "block.b.m: expected a table, found 3"),
        ({"j": {}}, "block: expected at least one block, [block.NAME], found none"),
    ],
)
def test_what_is_no_class_is_refused(table, message):
    with pytest.raises(SpecError) as error:
        load({"rates": {"tick_hz": 10}, "type": table, "block": {"b": {"type": "j"}}})
    assert any(line.startswith(message) for line in str(error.value).splitlines()), str(error.value)
