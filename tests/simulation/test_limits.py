"""Blocks with limits against programs of their own: drives that saturate, and what their integrals do then."""

import numpy as np
import pytest
from support.exports import made, present, put

import wavesweep
from wavesweep.program.analyses.assumptions import model_in_words
from wavesweep.program.spec import load
from wavesweep.simulation.export.source import exported

T, KP, KI, KD, TAU, TRACKING = 0.004, 1.5, 30.0, 0.02, 0.01, 0.05
METHODS = "explicit", "implicit", "trapezoidal"


def drive(keys, **more):
    """A speed loop: its controller runs every 4 ticks of 1 ms, its amplifier a tick later."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"umax": 2.0},
        "block": {
            "motor": {"type": "mass", "mass": 0.05, "damping": 0.1},
            "speed": {"every": 4, **keys},
            "late": {"type": "delay"},
            "amp": {"type": "saturation", "high": 1.6, "low": -0.9},
        },
        "wire": {"speed.u": "ref - motor.v", "late.u": "speed.y", "amp.u": "late.y", "motor.f": "amp.y"},
        "ports": {"inputs": {"ref": "ref"}, "outputs": {"omega": "motor.v", "torque": "amp.y", "out": "speed.y"}},
        **more,
    }


def marched(ref, kind, method, acts, umax):
    """Speed, torque and the controller's output, by the equations of a text book."""
    kp, ki, kd = {"integrator": (0.0, 1.0, 0.0), "pi": (KP, KI, 0.0), "pid": (KP, KI, KD)}[kind]
    decay, v, total, last, slope, out, sent, rows = np.exp(-0.1 / 0.05 * 1e-3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, []
    for k, r in enumerate(ref):
        before = sent  # the delay shows the output of a tick ago
        if k % 4 == 0:
            e = r - v
            step = {"explicit": T * e, "implicit": T * e, "trapezoidal": T * (e + last) / 2}[method]
            read = total if method == "explicit" else total + step
            slope = (TAU * slope + e - last) / (TAU + T)
            free = kp * e + ki * read + kd * slope
            out = min(max(free, -umax), umax)
            if acts == "back-calculation":
                step += T * (out - free) / (ki * TRACKING)
            if acts == "clamping" and abs(free) > umax and free * e > 0:
                step = 0.0
            total, last = total + step, e
        torque, sent = min(max(before, -0.9), 1.6), out
        rows.append((v, torque, out))
        v = decay * v + (1 - decay) / 0.1 * torque
    return np.array(rows)


@pytest.mark.slow
@pytest.mark.parametrize("acts", ["none", "back-calculation", "clamping"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", ["integrator", "pi", "pid"])
def test_a_drive_at_its_limits_is_that_of_a_program_of_its_own(kind, method, acts):
    keys = {"type": kind, "method": method, "high": "umax", "anti_windup": acts}
    keys |= {"integrator": {}, "pi": {"kp": KP, "ki": KI}}.get(kind, {"kp": KP, "ki": KI, "kd": KD, "tau": TAU})
    keys |= {"tracking_s": TRACKING} if acts == "back-calculation" else {}
    ref = np.where(np.arange(600) < 350, 30.0, -20.0)
    umax = 0.7 if kind == "integrator" else 2.0
    seen = wavesweep.compile(drive(keys)).with_(umax=umax).simulate(ref)
    expected = marched(ref, kind, method, acts, umax)
    np.testing.assert_allclose(seen[["omega", "torque", "out"]], expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    assert (np.abs(expected[:, 2]) >= umax).sum() > 100


@pytest.mark.parametrize("method", METHODS)
def test_a_clamped_integral_is_at_its_limit_while_it_is_driven_on(method):
    """0.3 a run up to 1: also where no whole number of steps ends at the limit."""
    loop = {
        "rates": {"tick_hz": 1},
        "block": {"i": {"type": "integrator", "high": 1.0, "anti_windup": "clamping", "method": method}},
        "wire": {"i.u": "cmd"},
        "ports": {"inputs": {"cmd": "cmd"}, "outputs": {"y": "i.y"}},
    }
    y = wavesweep.compile(loop).simulate(np.full(9, 0.3)).y
    assert y.max() == 1.0
    assert (y[5:] == 1.0).all()


def test_within_its_limits_a_loop_is_the_linear_one():
    keys = {"type": "pi", "kp": KP, "ki": KI, "high": "umax", "anti_windup": "clamping"}
    plain = drive({"type": "pi", "kp": KP, "ki": KI})
    plain["block"]["amp"] = {"type": "gain"}
    del plain["numbers"]
    one, other = (wavesweep.compile(tables) for tables in (drive(keys), plain))
    assert one.spectral_radius() == other.spectral_radius()
    ref = 0.1 * np.random.default_rng(0).normal(size=300)
    np.testing.assert_array_equal(one.simulate(ref).omega, other.simulate(ref).omega)
    assert model_in_words(one.spec) == "linear while |speed.y| <= 2, -0.9 <= amp.u <= 1.6; simulate keeps to these limits"


@pytest.mark.slow
@pytest.mark.parametrize("acts", ["back-calculation", "clamping"])
def test_no_bit_of_c_differs_at_the_limits(acts, tmp_path):
    if "gcc" not in present():
        pytest.skip("no gcc")
    keys = {"type": "pid", "kp": KP, "ki": KI, "kd": KD, "high": "umax", "anti_windup": acts}
    keys |= {"tracking_s": TRACKING} if acts == "back-calculation" else {}
    simulate = {"input": "step", "amplitude": 30, "at_s": 0, "duration_s": 0.3}
    put(exported(load(drive(keys, simulate=simulate))), tmp_path)
    code, said = made(tmp_path, "check", "gcc", "-O0")
    assert (code, said[-16:]) == (0, " no bit differs\n"), said
