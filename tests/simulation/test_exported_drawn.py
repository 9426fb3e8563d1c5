"""The controller of a drawn loop in C: its blocks without the device, to the last bit."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.drawn import DRIVE, as_blocks, drive
from support.exports import COMPILERS, LEVELS, check, host_of, need, present, written

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.program.spec import load
from wavesweep.simulation.experiment import simulation_of
from wavesweep.simulation.export import exported

RECIPES = Path(__file__).parents[2] / "sweeps" / "recipes"
NAMES = ("policy", "long-delay", "teleoperation", "wheel", "hybrid-test", "controllers/pmw-lm", "controllers/dc-lm")
ARM = """
[rates]
tick_hz = 1000
[block.hand]
type = "mass"
mass = 0.2
damping = 1.0
[block.arm]
type = "mass"
mass = 0.5
damping = 3.0
[block.felt]
type = "hold"
every = 4
[block.sum]
type = "integrator"
every = 2
phase = 1
[wire]
"felt.u" = "push - 2*hand.v"
"sum.u" = "arm.x - 0.1*felt.y"
"hand.f" = "push - 30*(hand.x - arm.x)"
"arm.f" = "30*(hand.x - arm.x) - 40*arm.x - 0.5*sum.y"
[ports]
hand = { force = "push", displacement = "hand.x" }
[simulate]
input = "noise"
duration_s = 1
"""
pytestmark = pytest.mark.slow


def recipe(name):
    """The tables of a recipe, with a short run of noise."""
    tables = tomllib.loads((RECIPES / f"{name}.toml").read_text(encoding="utf-8"))
    return tables | {"simulate": {"input": "noise", "duration_s": 0.5}}


@pytest.mark.sample(4)
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", ["arm", *NAMES])
def test_no_bit_differs(name, compiler, tmp_path):
    need(compiler)
    files = written(tomllib.loads(ARM) if name == "arm" else recipe(name), tmp_path)
    rows = files["vectors.csv"].count("\n") - 1
    assert rows > 200
    assert [check(tmp_path, compiler, level) for level in LEVELS] == [rows, rows]


@pytest.mark.parametrize("name", ["arm", "controllers/pmw-lm"])
def test_the_host_closes_the_loop_as_the_simulation_does(name, tmp_path):
    need("gcc")
    tables = tomllib.loads(ARM) if name == "arm" else recipe(name)
    written(tables, tmp_path)
    seen = simulation_of(wavesweep.load(tables), np.ones(2000)).signals["v"]
    place = {"arm": "ws_hand_v", "controllers/pmw-lm": "ws_device_v"}[name]
    assert host_of(tmp_path)[place] == pytest.approx(seen, rel=1e-9, abs=1e-11 * np.abs(seen).max())


PWM = """
[rates]
tick_hz = 1000
[block.motor]
type = "mass"
mass = 0.02
damping = 0.1
[block.law]
type = "hold"
[block.slow]
type = "hold"
every = 3
[block.pwm]
type = "delay"
seconds = 0.0014
[wire]
"law.u" = "20*(ref - motor.x)"
"slow.u" = "0.2*motor.v"
"pwm.u" = "law.y"
"motor.f" = "pwm.y - slow.y + load"
[ports]
inputs = { ref = "ref", load = "load" }
outputs = { x = "motor.x" }
[simulate]
input = "noise"
duration_s = 1
"""


@pytest.mark.sample(2)
@pytest.mark.parametrize("seconds", [0.0014, 0.0004, 0.002])
def test_a_dead_time_that_acts_on_a_plant_is_the_hosts(seconds, tmp_path):
    need("gcc")
    tables = tomllib.loads(PWM.replace("0.0014", str(seconds)))
    files = written(tables, tmp_path)
    assert files["vectors.csv"].splitlines()[0] == "tick,ws_motor_x,ws_motor_v,ws_ref,ws_load,ws_motor_f,ws_pwm_u"
    assert f"computed nowhere here: pwm ({1e3 * seconds:g} ms)" in files["controller.h"]
    assert check(tmp_path) == 1000
    seen = simulation_of(load(tables), np.ones(2000)).signals["outputs.x"]
    assert host_of(tmp_path)["ws_motor_x"] == pytest.approx(seen, rel=1e-9, abs=1e-11 * np.abs(seen).max())


@pytest.mark.parametrize(
    ("wire", "into"), [("law.u", "20*(ref - pwm.y)"), ("pwm.u", "law.y - 0.1*motor.x")], ids=["between blocks", "of a sensor"]
)
def test_a_dead_time_that_is_not_from_the_controller_to_a_plant_is_refused(wire, into):
    tables = tomllib.loads(PWM)
    tables["wire"][wire] = into
    with pytest.raises(UsageError, match=r"expected dead times from the controller to plants alone.* found block\.pwm"):
        exported(load(tables))


def test_a_loop_without_a_controller_is_refused():
    tables = tomllib.loads(ARM)
    tables["block"] = {name: tables["block"][name] for name in ("hand", "arm")}
    tables["wire"] = {"hand.f": "push - 30*(hand.x - arm.x)", "arm.f": "30*(hand.x - arm.x) - 40*arm.x"}
    with pytest.raises(UsageError, match=r"expected a device .* and further blocks, found nothing else"):
        exported(wavesweep.load(tables))


@pytest.mark.parametrize("word", ["EOF", "_x"])
def test_a_force_may_be_called_as_a_word_a_macro_or_a_function_of_c(word, tmp_path):
    tables = tomllib.loads(ARM.replace("push", word))
    assert f"ws_{word}" in exported(wavesweep.load(tables))["vectors.csv"].split("\n", 1)[0].split(",")
    if "gcc" in present():
        written(tables, tmp_path)
        check(tmp_path, "gcc", "-O0")


@pytest.mark.parametrize(("delay", "kind"), [(0, "dc-slow"), (20, "pmw-lm")])
def test_no_bit_differs_with_effects_of_a_device(kind, delay, tmp_path):
    need("gcc")
    spec = wavesweep.load({"controller": {"kind": kind, "Kp": 5.0}, "environment": {"delay": delay, "K_VE": 100.0}})
    effects = {"wall": 0.0, "late": 45, "dropped": 0.1, "resolution": 1e-5, "friction": 0.05, "max_force": 2.0, "jitter": 0.1}
    written(as_blocks(spec.values) | {"simulate": {"input": "noise", "duration_s": 1.0, "amplitude": 4.0} | effects}, tmp_path)
    check(tmp_path, "gcc", "-O2")


def test_a_loop_without_a_hand_has_its_inputs_in_the_controller():
    tables = tomllib.loads(DRIVE) | {"simulate": {"duration_s": 0.5}}
    files = exported(load(tables))
    header, *rows = files["vectors.csv"].splitlines()
    assert header == "tick,ws_motor_v,ws_ref,ws_load,ws_motor_f"
    given = [[float.fromhex(each) for each in row.split(",")[1:]] for row in rows]
    inputs = np.array([row[1:3] for row in given]).T
    speed, _, torque, _ = drive(inputs)
    np.testing.assert_allclose(np.array(given)[:, 0], speed, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.array(given)[:, 3], torque - inputs[1], rtol=0, atol=1e-12)
    assert "in.ws_ref = given;" in files["example.c"]
    assert "in.ws_load = 0.0;" in files["example.c"]
