"""[ports] inputs and outputs of a drawn loop, and which of them [bode] and [simulate] are about."""

import tomllib

import pytest
from support.drawn import DRIVE

from wavesweep.engine.errors import UsageError
from wavesweep.program.spec import load


def tables(**changes):
    return tomllib.loads(DRIVE) | changes


def test_ports_are_read_with_and_without_units():
    spec = load(tables())
    assert spec.drawing.inputs == (("ref", "ref", "rad/s"), ("load", "load", "N*m"))
    assert [(name, unit) for name, _, unit in spec.drawing.outputs][2:] == [("torque", "N*m"), ("twice", "")]
    assert spec.tables()["ports"]["outputs"]["twice"] == {"signal": "2*motor.v + error", "unit": ""}
    assert load(spec.tables()).sha256 == spec.sha256


def test_an_input_whose_signal_is_no_signal_is_shown_how_to_name_the_one_that_wires_read():
    for wrong in ("command", {}):
        with pytest.raises(UsageError, match=r'inputs\.ref: expected .*, as ref = "ref", found'):
            load(tables(ports={"inputs": {"ref": wrong}}))


def test_all_pairs_are_asked_for_unless_bode_names_an_end():
    spec = load(tables())
    assert len(spec.routes) == 8
    assert load(tables(bode={"from": "load", "to": "speed"})).routes == (("load", "speed"),)
    assert load(tables(), ["bode.to=angle"]).routes == (("ref", "angle"), ("load", "angle"))
    with pytest.raises(UsageError, match=r"to: expected an output in \[ports\] .*; did you mean `speed`"):
        spec.routes_between(None, "spede")


@pytest.mark.parametrize(
    ("source", "output", "unit"),
    [("ref", "speed", "ratio"), ("ref", "angle", "rad/(rad/s)"), ("load", "speed", "(rad/s)/(N*m)"), ("load", "twice", "")],
)
def test_the_unit_of_a_response_is_that_of_the_output_over_that_of_the_input(source, output, unit):
    assert load(tables()).unit_between(source, output) == unit


def test_an_output_of_a_body_of_several_axes_has_no_unit():
    """Its masses are rows, of which no number shows whether it turns."""
    plate = {"type": "mass_matrix", "mass": [[0.1, 0.2]], "damping": [[1.0, 2.0]]}
    wires = {"plate.fx": "push", "plate.fy": "push"}
    loop = {"rates": {"tick_hz": 100}, "block": {"plate": plate}, "wire": wires, "ports": {"inputs": {"push": "push"}}}
    assert load(loop, ["bode.to=plate.x"]).unit_between("push", "plate.x") == ""
