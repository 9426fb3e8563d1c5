"""One controller of a loop as C: a function of its own period, which `make check` runs inside the whole loop."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.exports import made, need, put

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.simulation.controller_group import assumed_of_rest, group_of
from wavesweep.simulation.export.one_controller import exported_controller
from wavesweep.simulation.from_spec import simulated

SHIPPED = Path(__file__).parents[2] / "sweeps"
# A drive: current 8 kHz, speed 4 kHz, position and bus 1 kHz; the limit of the speed's output is not reached.
DRIVE = """
[rates]
tick_hz = 8000
[numbers]
J = 0.02
kp = 5.0
[block.motor]
type = "inertia"
inertia = "J"
damping = 1e-4
[block.current]
type = "tf"
num = [1]
den = [0.0003, 1]
[block.encoder]
type = "difference"
every = 2
[block.speed]
type = "pi"
kp = "kp"
ki = 5.0
every = 2
[block.most]
type = "saturation"
low = -1e4
high = 1e4
every = 2
[block.position]
type = "gain"
k = 50
every = 8
phase = 3
[block.bus]
type = "channel"
late = 12
lost = 2
every = 8
phase = 3
[wire]
"encoder.u" = "motor.x"
"position.u" = "ref - motor.x"
"bus.u" = "position.y"
"speed.u" = "bus.y - encoder.y"
"most.u" = "speed.y"
"current.u" = "most.y"
"motor.f" = "0.5*current.y - load"
[ports]
inputs = { ref = "ref", load = "load" }
outputs = { angle = "motor.x", asked = "most.y", wanted = "bus.y" }
[simulate]
from = "ref"
input = "noise"
duration_s = 0.1
"""


def drive(messages=(0, 3, "lost", 12, 0, 9), **bus):
    """The tables of the drive; bus: keys of its channel."""
    tables = tomllib.loads(DRIVE)
    tables["simulate"]["messages"] = {"bus": [*messages]}
    tables["block"]["bus"] |= bus
    return tables


def columns(files):
    """The vectors, a column for each name."""
    names, *rows = [line.split(",") for line in files["vectors.csv"].splitlines()]
    values = [[float.fromhex(each) if "x" in each else float(each) for each in row] for row in rows]
    return dict(zip(names, np.array(values).T, strict=True))


@pytest.mark.parametrize(
    ("name", "blocks", "inputs", "outputs", "steps"),
    [
        ("speed", ["encoder", "speed", "most"], {"motor.x", "bus.y"}, ("most.y",), (0, 2)),
        ("position", ["position"], {"ref", "motor.x"}, ("position.y",), (3, 8)),
        ("speed,", ["speed"], {"bus.y", "encoder.y"}, ("speed.y",), (0, 2)),
        ("position,most", ["most", "position"], {"ref", "motor.x", "speed.y"}, ("most.y", "position.y"), (0, 1)),
    ],
)  # fmt: skip
def test_a_controller_is_the_connected_blocks_of_a_rate_or_those_that_are_named(name, blocks, inputs, outputs, steps):
    group = group_of(wavesweep.load(drive()), name)
    found = {signal.replace("motor+current.motor:", "motor.") for signal in group.inputs}
    assert ([block.name for block in group.blocks], found, group.outputs) == (blocks, inputs, outputs)
    assert (group.first, group.every) == steps


def test_the_vectors_are_the_loop_that_simulate_runs():
    tables = drive()
    found = columns(exported_controller(wavesweep.load(tables), "speed", []))
    seen = simulated(wavesweep.load(tables)).signals
    for name, column in (("ws_motor_x", "angle"), ("ws_bus_y", "wanted"), ("ws_most_y", "asked")):
        size = np.abs(seen[column]).max()
        np.testing.assert_allclose(found[name], seen[column], rtol=0, atol=1e-12 * size)
    assert found["step"].tolist() == [1, 0] * 400
    assert {-1, 11} < set(found["comes_bus.y"])  # the message of tick 11 comes 3 ticks later


@pytest.mark.parametrize(
    ("name", "into", "problem"),
    [
        ("motor", None, "expected blocks that a program runs (encoder, speed, most, position), found motor"),
        ("spee", None, "found spee; did you mean speed?"),
        ("most,", ("speed.u", "bus.y - encoder.y - most.y"), "found most.y, which comes back to most, within its step"),
        ("position", ("bus.u", "ref"), "found one that gives nothing to the rest (position)"),
    ],
    ids=["a plant", "a slip", "comes back", "nobody reads"],
)
def test_another_name_is_refused(name, into, problem):
    tables = drive()
    tables["block"]["most"] = {"type": "gain", "every": 2}
    if into:
        tables["wire"][into[0]] = into[1]
    with pytest.raises(UsageError, match=re.escape(problem)):
        exported_controller(wavesweep.load(tables), name, [])


def test_steps_that_vary_are_refused():
    tables = tomllib.loads(DRIVE) | {"for_all": {"n": {"values": [2, 3], "varying": True}}}
    tables["numbers"]["n"] = 2
    for block in ("encoder", "speed", "most"):
        tables["block"][block]["every"] = "n"
    tables["block"] |= {"bus": {"type": "hold"}, "position": {"type": "gain", "k": 50}}
    with pytest.raises(UsageError, match="found blocks whose `every` has n, which varies"):
        group_of(wavesweep.load(tables), "speed")


def test_what_is_assumed_of_the_rest_is_said():
    spec = wavesweep.load(drive())
    lines = [*assumed_of_rest(spec, group_of(spec, "speed"))]
    assert "a step every 0.25 ms (2 ticks), the first in tick 0" in lines[0]
    assert lines[1] == "  reads in the tick of its step: motor.x, bus.y; gives until its next: most.y"
    for line in ("current.u = most.y", "motor.f = -load + 0.5*current.y", "bus.u = position.y"):
        assert f"    {line}" in lines
    moves, message = lines[-2:]
    assert moves.startswith("    moves continuously: motor (inertia, inertia = J = 0.02, damping = 0.0001,")
    assert message.startswith("    every 1 ms, in tick 3: position (gain, k = 50), bus (channel, late = 12, lost = 2,")


@pytest.mark.slow
def test_check_and_the_header_say_what_is_known_of_the_loop(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("drive.toml").write_text(DRIVE + "[for_all]\nJ = { values = [0.02, 0.021] }\n")
    args = ("drive.toml", "--set", "block.bus={type='hold', every=8, phase=3}", "--controller", "speed")
    said = wavesweep("check", *args)[1]
    header_of = ("export", *args, "--out", "c", "--quiet")
    assert wavesweep(*header_of) == (0, "", "")
    header = Path("c/speed.h").read_text()
    assert "proved stable for J of 0.02, 0.021" in said
    assert " * drive, drawn: proved stable for J of 0.02, 0.021 (each for ever)\n" in header
    assert "    current.u = most.y\n" in said
    assert " *     current.u = most.y\n" in header
    assert "(ws_speed_state *s, double ws_motor_x, double ws_bus_y, double *ws_most_y);" in header
    assert wavesweep(*header_of, "--overwrite", "--float")[0] == 2


def shipped(name):
    """A shipped spec with a short run of noise."""
    tables = tomllib.loads((SHIPPED / f"{name}.toml").read_text(encoding="utf-8"))
    return tables | {"simulate": {"input": "noise", "duration_s": 0.1}}


CASES = {
    "messages": (drive(), "speed"),
    "two rates, zeros": (drive(missing="zero"), "position,most"),
    "one block": (drive([0]), "speed,"),
    "a built-in wall": (shipped("examples/first-hour"), "avatar"),
    "two arms": (shipped("recipes/teleoperation"), "leader_x"),
    "in each wire": (shipped("recipes/wheel"), "game"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_no_bit_differs_inside_the_whole_loop(case, tmp_path):
    need("gcc")
    tables, name = CASES[case]
    files = exported_controller(wavesweep.load(tables), name, [])
    put(files, tmp_path)
    for level in ("-O0", "-O2"):
        code, said = made(tmp_path, "check", "gcc", level)
        assert (code, said.partition(": ")[2]) == (0, "no bit differs\n")
        assert int(said.split()[0]) == files["vectors.csv"].count("\n") - 1 > 50


@pytest.mark.slow
def test_the_loop_sees_another_gain(tmp_path):
    need("gcc")
    files = exported_controller(wavesweep.load(drive()), "position", [])
    gain, other = (50.0).hex(), float(np.nextafter(50.0, 51.0)).hex()
    assert gain in files["position.c"]
    put(files | {"position.c": files["position.c"].replace(gain, other)}, tmp_path)
    code, said = made(tmp_path, "check", "gcc", "-O1")
    assert code == 2
    assert re.search(r"position\.y is .*, expected", said)
