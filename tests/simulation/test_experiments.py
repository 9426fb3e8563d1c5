"""What runs is what was analysed: a device's own delay stays outside, messages are lost, an engine answers late."""

import csv

import numpy as np
import pytest
from support.exports import check, host_of, made, need, put, written
from support.messages import marched_blocks, random_blocks, spec_of_blocks
from support.specs import nested, values_of

import wavesweep
from wavesweep.simulation.export import exported
from wavesweep.simulation.from_spec import simulated

pytestmark = pytest.mark.slow
NOISE = {"input": "noise", "duration_s": 1.0, "amplitude": 3.0}


def engine(kind="pmw", frames=(), delay=1, step="elapsed", **simulate):
    """A wall whose engine answers when it can."""
    tables = nested(values_of(kind, K_VE=60.0, local_model__K_LM=50.0, b=10.0, lp1_cutoff_hz=8.57, Kp=5.0))
    tables["environment"] |= {"integration": "trapezoidal", "delay": delay, "step": step}
    return tables | {"simulate": NOISE | ({"frames": list(frames)} if frames else {}) | simulate}


@pytest.mark.parametrize(
    ("kind", "late"), [("dc", (2, 0.0)), ("pmw-lm", (2, 0.0)), ("dc", (0, 0.0004)), ("pmw-lm", (2, 0.0017))]
)
def test_the_delay_of_an_amplifier_is_the_devices(kind, late, tmp_path):
    """The controller is that of a prompt amplifier, and its host delays what it asks for, to within a tick."""
    need("gcc")
    tables = engine(kind)
    prompt = exported(wavesweep.load(tables))
    tables["device"] = tables.get("device", {}) | dict(zip(("delay", "dead_time"), late, strict=True))
    files = written(tables, tmp_path)
    start = files["controller.c"].index("static void tick_0")
    assert files["controller.c"][start:] == prompt["controller.c"][prompt["controller.c"].index("static void tick_0") :]
    rate = wavesweep.load(tables).values["rates.fast_hz"]
    assert f"The amplifier's delay of {late[0] + late[1] * rate:g} ticks is the device's" in files["controller.h"]
    check(tmp_path)
    seen = simulated(wavesweep.load(tables), np.ones(2000)).signals["x"]
    np.testing.assert_allclose(host_of(tmp_path)["ws_device_x"], seen, rtol=1e-9 * bool(late[1]), atol=1e-12 * bool(late[1]))


def test_what_acts_on_a_device_from_outside_is_none_of_the_controllers(tmp_path):
    need("gcc")
    tables = {
        "rates": {"tick_hz": 1000},
        "block": {
            "motor": {"type": "mass", "mass": 0.1, "damping": 1.0},
            "load": {"type": "mass", "mass": 0.4, "damping": 2.0},
            "c": {"type": "pi", "kp": 3.0, "ki": 2.0},
        },
        "wire": {
            "c.u": "ref - load.x",
            "motor.f": "c.y - 2*motor.v - 40*(motor.x - load.x) + cogging",
            "load.f": "40*(motor.x - load.x) - torque",
        },
        "ports": {"inputs": {"torque": "torque", "cogging": "cogging", "ref": "ref"}, "outputs": {"place": "load.x"}},
        "simulate": NOISE,
    }
    files = written(tables, tmp_path)
    header = files["vectors.csv"].split("\n", 1)[0].split(",")
    assert not {"ws_torque", "ws_load_f"} & {*header}
    assert "/* cogging; part of motor.f: 0 where it acts on the device itself */" in files["controller.h"]
    assert "/* ref */" in files["controller.h"]
    assert "load.f: from outside alone, so the host's" in files["controller.h"]
    check(tmp_path)
    # The example of a host gives 1 to the first input, the torque, for 2 s: 2000 ticks.
    seen = simulated(wavesweep.load(tables), np.ones(2000)).signals["place"]
    np.testing.assert_allclose(host_of(tmp_path)["ws_load_x"], seen, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("seed", [0])
def test_messages_in_c_are_late_and_lost_as_in_a_march(seed, tmp_path):
    """Vectors of C are those of the simulation, and these are those of a march that shares no code."""
    need("gcc")
    loop = random_blocks(np.random.default_rng(seed))
    files = written(spec_of_blocks(loop, seed=seed), tmp_path)
    found = [float.fromhex(row["ws_mass_f"]) for row in csv.DictReader(files["vectors.csv"].splitlines())]
    pushes = np.random.default_rng(seed).standard_normal(len(found))
    gains = np.array([gain for name, gain in loop["force"].items() if name != "push"])
    expected = marched_blocks(loop, pushes)[:, 1:] @ gains + pushes
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    check(tmp_path)


FRAMES = [
    [16, 16, 20, 33, 33],
    [5, {"ticks": 9, "delay": 9}, {"ticks": 7, "delay": 3}],
    [{"ticks": 20, "lost": True}, 20, {"ticks": 4, "lost": True}, {"ticks": 6, "delay": 0}],
]


@pytest.mark.sample(3)
@pytest.mark.parametrize("frames", FRAMES)
@pytest.mark.parametrize("delay", [0, 3, "frame"])
@pytest.mark.parametrize("step", ["elapsed", "nominal"])
@pytest.mark.parametrize("kind", ["dc-slow", "dc-lm", "dc-vc", "dc-vc-lm", "pmw", "pmw-lm"])
@pytest.mark.parametrize("effects", [{}, {"wall": 0.001, "late": 9, "dropped": 0.2}])
def test_no_bit_differs_when_the_caller_triggers_slow_steps(kind, step, delay, frames, effects, tmp_path):
    need("gcc")
    written(engine(kind, frames, delay, step, **effects), tmp_path)
    assert check(tmp_path, "gcc", "-O1") == 1000


@pytest.mark.parametrize(("step", "delay"), [("elapsed", 3), ("nominal", "frame")])
def test_a_late_engine_closes_the_loop_as_the_simulation_does(step, delay, tmp_path):
    need("gcc")
    tables = engine("pmw-lm", FRAMES[0], delay, step)
    written(tables, tmp_path)
    seen = simulated(wavesweep.load(tables), np.ones(2000)).signals["x"]
    np.testing.assert_array_equal(host_of(tmp_path)["ws_device_x"], seen)


VARIED = {"for_all": {"rates.ratio": {"values": [17, 34, 50], "varying": True}}}


def test_an_answer_waits_for_a_length_that_is_proved_and_a_later_one_is_counted(tmp_path):
    """Lengths 17, 34 and 50: an engine that answers after 19 ticks steps after 34; one that takes 60 is told to the host."""
    need("gcc")
    put(exported(wavesweep.load(engine(delay=0) | VARIED)), tmp_path)
    check(tmp_path)
    (tmp_path / "example.c").write_text(
        '#include <stdio.h>\n#include "controller.h"\n'
        "int main(void)\n{\n"
        "    static const int answers[] = {0, 17, 36, 111};\n    static ws_state s;\n    ws_inputs in = {0};\n"
        "    int k, n = 0;\n    ws_init(&s);\n    for (k = 0; k < 130; k++) {\n"
        "        if (n < 4 && k == answers[n]) {\n            s.answered = 1;\n            n++;\n        }\n"
        '        ws_fast_tick(&s, in);\n        if (s.since == 1)\n            printf("%d ", k);\n    }\n'
        '    printf("%d\\n", (int)s.overlong);\n    return 0;\n}\n'
    )
    assert made(tmp_path, "example", "gcc", "-O1") == (0, "0 17 51 111 1\n")


DRAWN = {
    "rates": {"tick_hz": 1000},
    "numbers": {"n": 6},
    "block": {
        "m": {"type": "mass", "mass": 0.5, "damping": 2.0},
        "slow": {"type": "integrator", "every": "2*n", "method": "implicit"},
        "speed": {"type": "difference", "every": "2*n", "phase": 1},
        "later": {"type": "hold", "every": "2*n", "phase": 2},
    },
    "wire": {"slow.u": "m.x", "speed.u": "m.x", "later.u": "100*slow.y + 3*speed.y", "m.f": "push - later.y - 5*m.x"},
    "ports": {"hand": {"force": "push", "displacement": "m.x"}},
}


@pytest.mark.parametrize("frames", [None, [8, 16, 16, 10]])
def test_blocks_of_a_drawn_loop_step_each_at_its_phase(frames, tmp_path):
    """The lengths are those of the expression that says when the blocks run."""
    need("gcc")
    varied = {} if frames else {"for_all": {"n": {"values": [4, 5, 8], "varying": True}}}
    files = written(DRAWN | varied | {"simulate": NOISE | ({"frames": frames} if frames else {})}, tmp_path)
    assert " *   8, 10, 16\n" in files["controller.h"]
    check(tmp_path)
