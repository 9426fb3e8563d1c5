"""Simulations from any input of a drawn loop, against a march in plain numpy, and the columns of their table."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.drawn import DRIVE, WALL, drive

import wavesweep
from wavesweep.engine.errors import SpecError
from wavesweep.program.cli import main
from wavesweep.program.columns import RUN_COLUMNS
from wavesweep.program.spec import load
from wavesweep.program.tables import kind_named
from wavesweep.simulation.table import simulate

NAMES = ["tick", "frame", "phase", "time_s", "ref", "load", "error", "speed", "angle", "torque", "twice"]


def tables(**simulate):
    return tomllib.loads(DRIVE) | {"simulate": {"duration_s": 1.0, **simulate}}


@pytest.mark.parametrize("source", ["ref", "load"])
def test_a_step_into_an_input_is_that_of_the_march(source):
    found = wavesweep.simulate(tables(**{"from": source, "amplitude": 3.0}))
    assert len(found) == 1
    step = 3.0 * (np.arange(1000) >= 100)
    inputs = [step if source == name else 0 * step for name in ("ref", "load")]
    assert found[0].columns.tolist() == NAMES
    np.testing.assert_allclose(found[0][NAMES[-4:]].to_numpy().T, drive(inputs), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found[0][["ref", "load"]].to_numpy().T, inputs)
    np.testing.assert_allclose(found[0].error, inputs[0] - found[0].speed, rtol=0, atol=1e-15)
    assert found[0].attrs["units"] | {"speed": "rad/s", "load": "N*m", "twice": ""} == found[0].attrs["units"]


def test_the_summary_of_a_step_says_where_outputs_settle():
    (found,) = wavesweep.simulate(tables(amplitude=2.0))
    outputs = found.attrs["summary"]["outputs"]
    assert list(outputs) == ["speed", "torque", "twice"]  # the angle goes on without end
    assert outputs["speed"]["settles_at"] == pytest.approx(2.0, rel=1e-12)
    assert outputs["speed"]["peak"] == found.speed.max()
    at = round(1000 * (outputs["speed"]["settled_s"] + 0.1))
    off = (found.speed - 2.0).abs()
    assert off[at:].max() <= 0.04 < off[at - 1]


@pytest.mark.parametrize(
    ("high", "said"), [(0.5, "is 0.5 at the end, where the linear loop settles at 0.6"), (2, "settles at 0.6")]
)
def test_an_output_at_its_limit_is_said_to_be_there_and_not_where_the_linear_loop_settles(high, said):
    """With 1.5 (1 - x) before a lag of gain 1 the linear loop settles at 1.5/2.5, and its largest force is 1.5."""
    limited = {
        "rates": {"tick_hz": 100},
        "block": {
            "lag": {"type": "tf", "num": [1], "den": [0.2, 1]},
            "limit": {"type": "saturation", "high": high, "low": 0},
        },
        "wire": {"limit.u": "1.5*(push - lag.y)", "lag.u": "limit.y"},
        "ports": {"inputs": {"push": "push"}, "outputs": {"force": "limit.y"}},
        "simulate": {"input": "step", "duration_s": 3},
    }
    (found,) = wavesweep.simulate(limited)
    assert found.force.iloc[-1] == pytest.approx(min(high, 0.6))
    lines = [text for text, _ in kind_named("simulate").lines(found.attrs["summary"])]
    (line,) = [text for text in lines if text.startswith("force ")]
    assert line.startswith(f"force {said}")


def test_a_hand_and_inputs_have_their_columns_beside_each_other():
    text = WALL.replace('"hand - late.y"', '"hand - late.y + pull"')
    ports = 'inputs = { pull = "pull" }\noutputs = { place = "m.x", force = "K*m.x" }'
    text = text.replace("[ports]", f'[signals]\nx = "m.x"\n[ports]\n{ports}')
    text = text.replace('"K*m.x + B*v.y"', '"K*x + B*v.y"')
    by_hand, by_pull = (
        wavesweep.simulate(tomllib.loads(text) | {"simulate": {"input": "step", "duration_s": 0.5} | entry})[0]
        for entry in ({}, {"from": "pull"})
    )
    assert by_hand.columns.tolist()[4:8] == ["pull", "signals.x", "place", "force"]
    assert {"f_h", "x", "F_s", "touching", "energy_hand"} <= {*by_hand.columns}
    assert not by_hand.columns.intersection(["u_m", "late", "energy_channel", "f_m"]).size
    np.testing.assert_array_equal(by_hand.place, by_hand.x)
    np.testing.assert_array_equal(by_hand.place, by_hand["signals.x"])
    np.testing.assert_allclose(by_hand.force, 100 * by_hand.x, rtol=1e-14)
    np.testing.assert_allclose(by_pull.place, by_hand.place, rtol=0, atol=1e-15)  # both push the same mass
    assert (by_pull.f_h.abs().max(), by_hand.pull.abs().max(), by_pull.pull.max()) == (0, 0, 1)


def test_an_unstable_loop_without_a_hand_runs_up_to_the_last_finite_row():
    (found,) = simulate(load(tables(duration_s=20.0), ["kp=60"]).asking("simulate"))
    rows, wanted = (found.facts["ticks"][name] for name in ("simulated", "wanted"))
    assert 0 < rows < wanted
    assert found.facts["ticks"]["stopped"] == "numbers overflow"
    assert np.isfinite(found.columns["speed"]).all()
    assert found.facts["settles_at"] == {}


@pytest.mark.slow
@pytest.mark.parametrize("source", ["ref"])
def test_a_settled_sine_has_the_components_of_the_response(source):
    """Of a plant of several blocks, whose current acts on it continuously, behind a controller of every tenth tick."""
    path = Path(__file__).parents[2] / "sweeps" / "templates" / "drive.toml"
    own = wavesweep.compile(load(path, [f"simulate.from={source}"]))
    k, f = np.arange(24_000), 170.0
    parts = [own.simulate(wave(2 * np.pi * f * k / 10_000)).iloc[-1000:] for wave in (np.cos, np.sin)]
    found = own.response(f, from_=source).set_index("to_output")
    for name in ("speed", "current"):
        tick = (parts[0][name] + 1j * parts[1][name]).to_numpy() * np.exp(-2j * np.pi * f * k[-1000:] / 10_000)
        wanted = tick.mean()  # of a hundred frames
        assert found.response_re[name] + 1j * found.response_im[name] == pytest.approx(wanted, rel=1e-9)


def test_inner_signals_are_those_of_declared_outputs():
    spec = load(tables(show=["motor.v", "control.u", "motor.x"]))
    (found,) = wavesweep.simulate(spec)
    assert found.columns.tolist() == [*NAMES, "motor.v", "control.u", "motor.x"]
    for name, same in (("motor.v", "speed"), ("motor.x", "angle"), ("control.u", "error")):
        assert (found[name] == found[same]).all()
    assert found.attrs["units"]["motor.v"] == "rad/s"
    loop = wavesweep.compile(tables())
    shown, declared = (loop.response([0, 1, 100], from_="ref", to=name) for name in ("motor.v", "speed"))
    assert (shown.response_re == declared.response_re).all()
    with pytest.raises(wavesweep.UsageError, match=r"did you mean `motor\.v`"):
        loop.response(to="moter.v")


def test_an_output_and_an_input_may_have_any_name():
    """Where that is a column of a simulation, theirs has a prefix; the numbers are those under any other name."""
    names = [*sorted(RUN_COLUMNS - {"v"}), "hand", "low", "certified", "unit"]
    drive = tables(**{"from": "v"})
    inputs, speed = drive["ports"]["inputs"], drive["ports"]["outputs"]["speed"]
    drive["ports"] = {"inputs": {"v": inputs["ref"], "load": inputs["load"]}, "outputs": dict.fromkeys(names, speed)}
    (given,), (other,) = (wavesweep.simulate(each) for each in (tables(), drive))
    for name in names:
        column = f"outputs.{name}" if name in RUN_COLUMNS else name
        assert (other[column] == given["speed"]).all(), name
    assert (other["inputs.v"] == given["ref"]).all()
    assert {other.attrs["units"][name] for name in ("inputs.v", "outputs.x", "hand")} == {"rad/s"}
    assert other.attrs["summary"]["outputs"]["x"]["settles_at"] == pytest.approx(1.0)
    shown = wavesweep.compile(drive).response([1.0], from_="v", to="hand").response_re
    assert shown.tolist() == wavesweep.compile(tables()).response([1.0], from_="ref", to="speed").response_re.tolist()


def test_a_signal_that_is_asked_for_is_an_output_like_a_declared_one():
    """Outputs and inputs of blocks and named signals, with the units that are known; the resolved spec declares them."""
    spec = load(tomllib.loads(DRIVE) | {"bode": {"to": "motor.f"}, "simulate": {"show": ["motor.x", "control.u", "error"]}})
    asked = {name: unit for name, _, unit in spec.drawing.outputs[4:]}
    assert asked == {"motor.f": "N*m", "motor.x": "rad", "control.u": "", "error": ""}
    assert spec.routes == (("ref", "motor.f"), ("load", "motor.f"))
    again = load(spec.asking("simulate").tables()).asking("simulate")
    assert (again.sha256, again.drawing.outputs[4:] != ()) == (spec.asking("simulate").sha256, True)
    for name in ("torque.y", "spedd"):
        with pytest.raises(SpecError, match=r"simulate.show: expected an output in \[ports\] .* or a signal BLOCK.PORT"):
            load(tables(show=[name]))
    with pytest.raises(SpecError, match=r"it has none"):
        load({"controller": {"kind": "pmw"}}, ["simulate.show=avatar.out"])


def test_what_follows_a_step_is_counted_from_the_tick_at_which_it_sets_in(tmp_path, capsys):
    """y = ref - y/2 of the tick before is 1 at once, and 2/3 in the end; 2.4 s is taken at the tick at 3 s."""
    path = tmp_path / "spec.toml"
    path.write_text("""
[rates]
tick_hz = 1
[block.x]
type = "hold"
[wire]
"x.u" = "ref - 0.5*prev(x.y)"
[ports]
inputs = { ref = "ref" }
outputs = { y = "x.y" }
[simulate]
from = "ref"
input = "step"
at_s = 2.4
duration_s = 30
""")
    assert main(["simulate", str(path), "--no-plot", "--json", "--out", str(tmp_path / "out")]) == 0
    found = json.loads(capsys.readouterr().out)["tables"]["simulate"]["outputs"]["y"]
    assert (found["peak"], found["peak_s"]) == (1, 0)
    late = next(n for n in range(30) if all(abs((-0.5) ** k / 3) <= 0.02 * 2 / 3 for k in range(n, 30)))
    assert found["settled_s"] == late
