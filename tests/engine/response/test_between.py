"""Responses between inputs and outputs, against python-control at one rate and against a march in plain numpy at two."""

import tomllib

import control
import mpmath as mp
import numpy as np
import pytest
from support.drawn import DRIVE, drive

import wavesweep
from wavesweep.program.analyses.poles import poles

FREQUENCIES = [0.3, 2.0, 17.0, 81.0, 317.0]  # below and above half the rate of the frame, 100 Hz
OUTPUTS = ("speed", "angle", "torque", "twice")


def loop(**changes):
    return wavesweep.compile(tomllib.loads(DRIVE) | changes)


def value(table):
    return table.response_re.to_numpy() + 1j * table.response_im.to_numpy()


def test_an_output_that_drifts_has_its_response():
    """Speed is the angle's rate: exact under a torque that is held, over a tick, by the motor's own equations."""
    found, z = loop().response(FREQUENCIES), np.exp(2j * np.pi * np.array(FREQUENCIES) * 0.001)
    a = np.exp(-0.05 * 0.001 / 0.02)
    c, b = (1 - a) * 0.02 / 0.05, (1 - a) / 0.05
    e = (0.001 - c) / 0.05
    for source in ("ref", "load"):
        speed, angle, torque = (value(found[(found.from_input == source) & (found.to_output == name)]) for name in OUTPUTS[:3])
        force = torque - (source == "load")
        np.testing.assert_allclose((z - 1) * angle, c * speed + e * force, rtol=1e-9)
        np.testing.assert_allclose((z - a) * speed, b * force, rtol=1e-9)


def test_a_loop_of_one_rate_is_that_of_python_control():
    tables = tomllib.loads(DRIVE)
    tables["block"]["control"] |= {"every": 1, "phase": 0, "C": [["ki*0.001"]]}
    plant = control.sample_system(control.ss([[-2.5]], [[50.0]], [[1.0]], [[0.0]]), 0.001)
    pi = control.ss([[1.0]], [[1.0]], [[0.008]], [[0.5]], 0.001)
    closed = {"ref": control.feedback(pi * plant, 1), "load": -control.feedback(plant, pi)}
    for source, system in closed.items():
        found = wavesweep.compile(tables).response(FREQUENCIES, from_=source, to="speed")
        np.testing.assert_allclose(value(found), system(np.exp(2j * np.pi * np.array(FREQUENCIES) * 0.001)), rtol=1e-9)


def test_the_static_limit_is_exact_and_what_an_integrator_removes_is_0():
    found = loop().response(0).set_index(["from_input", "to_output"])
    assert found.response_re["ref", "speed"] == pytest.approx(1, rel=1e-12)
    assert found.response_re["ref", "torque"] == pytest.approx(0.05, rel=1e-12)
    assert found.response_re["load", "torque"] == pytest.approx(1, rel=1e-12)
    assert found.response_abs["load", "speed"] == 0
    assert np.isnan(found.response_abs["ref", "angle"])  # it goes on without end
    assert found.doubt.eq("").all()


def test_to_control_is_the_loop_at_the_starts_of_frames_under_inputs_held_over_them():
    system = loop().to_control()
    assert (system.dt, system.input_labels, system.output_labels) == (pytest.approx(0.005), ["ref", "load"], list(OUTPUTS))
    frames = np.random.default_rng(3).standard_normal((2, 60))
    wanted = drive(np.repeat(frames, 5, axis=1))[:, ::5]
    found = control.forced_response(system, 0.005 * np.arange(60), frames).outputs
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)
    own = poles(loop().spec)
    shown = np.sort_complex(np.round(system.poles(), 9))
    assert np.isin(np.round(own["z_re"] + 1j * own["z_im"], 9)[own["radius"] > 1e-9], shown).all()


def at_50_digits(frequency, source):
    """Speed, torque and `twice` of DRIVE under a sine, from the periodic state of its frame."""
    T, J, d, kp, g = mp.mpf(1) / 1000, mp.mpf(0.02), mp.mpf(0.05), mp.mpf(0.5), mp.mpf(8.0) * mp.mpf(0.005)
    a, w = mp.exp(-d * T / J), mp.expjpi(2 * mp.mpf(frequency) * T)

    def frame(state, size):
        (v, s, y), shown = state, []
        for k in range(5):
            ref, load = (size * w**k * (source == name) for name in ("ref", "load"))
            if k == 2:
                y, s = kp * (ref - v) + g * s, s + ref - v
            shown.append((v, y, v + ref))
            v = a * v + (1 - a) / d * (y - load)
        return mp.matrix([v, s, y]), shown

    A = mp.matrix(3, 3)
    for i in range(3):
        A[:, i] = frame([mp.mpf(i == j) for j in range(3)], 0)[0]
    start = mp.lu_solve(w**5 * mp.eye(3) - A, frame([mp.mpf(0)] * 3, 1)[0])
    shown = frame(list(start), 1)[1]
    return [complex(mp.fsum(row[i] * w**-k for k, row in enumerate(shown)) / 5) for i in range(3)]


@pytest.mark.parametrize("source", ["ref", "load"])
def test_bounds_hold_at_50_digits(source):
    mp.mp.dps = 50
    frequencies = [0.01, 2.0, 81.0, 317.0, 499.0]
    found = loop().response(frequencies, from_=source)
    wanted = np.array([at_50_digits(frequency, source) for frequency in frequencies])
    for name, each in zip(("speed", "torque", "twice"), wanted.T, strict=True):
        rows = found[found.to_output == name]
        assert (abs(value(rows) - each) <= rows.response_error * abs(each)).all()
        assert rows.response_error.max() < 1e-10
