"""[ports] inputs and outputs of a drawn loop, and which of them [bode] and [simulate] are about."""

import tomllib

import pytest
from support.drawn import DRIVE, NETWORK, WALL

from wavesweep.core.drawing.block_types import RUN_COLUMNS
from wavesweep.core.errors import SpecError, UsageError
from wavesweep.core.spec import load
from wavesweep.core.tables import kind_named


def tables(**changes):
    return tomllib.loads(DRIVE) | changes


def test_ports_are_read_with_and_without_units():
    spec = load(tables())
    assert spec.drawing.inputs == (("ref", "ref", "rad/s"), ("load", "load", "N*m"))
    assert [(name, unit) for name, _, unit in spec.drawing.outputs][2:] == [("torque", "N*m"), ("twice", "")]
    assert spec.tables()["ports"]["outputs"]["twice"] == {"signal": "2*motor.v + error", "unit": ""}
    assert load(spec.tables()).sha256 == spec.sha256


def test_an_input_may_be_the_hands_force():
    spec = load(tomllib.loads(WALL.replace("[ports]", '[ports]\ninputs = { push = "hand" }\noutputs = { place = "m.x" }')))
    assert (spec.drawing.outside, spec.routes, spec.routes_between(None, None)) == (("hand",), (), ())
    assert spec.routes_between("push", None) == (("push", "place"),)


def test_all_pairs_are_asked_for_unless_bode_names_an_end():
    spec = load(tables())
    assert len(spec.routes) == 8
    assert load(tables(bode={"from": "load", "to": "speed"})).routes == (("load", "speed"),)
    assert load(tables(), ["bode.to=angle"]).routes == (("ref", "angle"), ("load", "angle"))
    with pytest.raises(UsageError, match=r"to: expected an output in \[ports\] .*; did you mean `speed`"):
        spec.routes_between(None, "spede")


@pytest.mark.parametrize(
    ("source", "output", "unit"),
    [("ref", "speed", "1"), ("ref", "angle", "rad/(rad/s)"), ("load", "speed", "(rad/s)/(N*m)"), ("load", "twice", "")],
)
def test_the_unit_of_a_response_is_that_of_the_output_over_that_of_the_input(source, output, unit):
    assert load(tables()).unit_between(source, output) == unit


def test_a_loop_without_a_hand_has_frequencies_of_its_own_rate_and_a_step():
    spec = load(tables(rates={"tick_hz": 20}, block=tables()["block"]))
    assert (spec.frequency_hz[0], spec.frequency_hz[-1], len(spec.frequency_hz)) == (pytest.approx(2e-4), 9.8, 400)
    assert (spec.simulate["input"], spec.entry) == ("step", "ref")
    assert load(tables(), ["simulate.from=load", "simulate.input=noise"]).entry == "load"


def test_a_loop_that_nothing_reaches_is_not_simulated():
    with pytest.raises(SpecError, match=r"ports: expected inputs = .*, found neither"):
        load(tomllib.loads(NETWORK)).as_simulated()


def test_no_port_has_the_name_of_a_column_of_a_simulation():
    assert {field.name for field in kind_named("simulate").fields} == RUN_COLUMNS


def test_a_signal_that_is_asked_for_is_an_output_like_a_declared_one():
    """Outputs and inputs of blocks and named signals, with the units that are known; the resolved spec declares them."""
    spec = load(tables(bode={"to": "motor.f"}, simulate={"show": ["motor.x", "control.u", "error"]}))
    asked = {name: unit for name, _, unit in spec.drawing.outputs[4:]}
    assert asked == {"motor.f": "N*m", "motor.x": "rad", "control.u": "", "error": ""}
    assert spec.routes == (("ref", "motor.f"), ("load", "motor.f"))
    again = load(spec.as_simulated().tables()).as_simulated()
    assert (again.sha256, again.drawing.outputs[4:] != ()) == (spec.as_simulated().sha256, True)
    for name in ("torque.y", "spedd"):
        with pytest.raises(SpecError, match=r"simulate.show: expected an output in \[ports\] .* or a signal BLOCK.PORT"):
            load(tables(simulate={"show": [name]}))
    with pytest.raises(SpecError, match=r"it has none"):
        load({"controller": {"kind": "pmw"}}, ["simulate.show=avatar.out"])


def test_a_mass_has_the_units_of_its_number():
    """It may turn, so that its unit is known only if that of its mass is."""
    for unit, force in (("kg", "N"), ("kg*m^2", "N*m"), ("", "")):
        text = WALL.replace("mass = 0.1", 'mass = "M"').replace("n = 3", f'n = 3\nM = {{ value = 0.1, unit = "{unit}" }}')
        spec = load(tomllib.loads(text), ["bode.to=m.f"])
        assert spec.drawing.outputs[-1][::2] == ("m.f", force)
