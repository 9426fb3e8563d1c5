"""The words of firmware: against their difference equations and python-control."""

import control
import numpy as np
import pytest
from scipy.signal import lfilter

import wavesweep

T = 1 / 400
S = control.tf("s")


PID = {"kp": 2.0, "ki": 3.0, "kd": 0.04}


def pid_by_hand(u):
    """As firmware has it, a line at a time: the sum by trapezia, and the slope of the last two."""
    y, total, last = [], 0.0, 0.0
    for each in u:
        y.append(PID["kp"] * each + PID["ki"] * (total + T * each / 2) + PID["kd"] * (each - last) / T)
        total, last = total + T * each, each
    return np.array(y)


def cookbook(u, hz, q, depth):
    """R. Bristow-Johnson's notch; alpha of the numerator in proportion to what is left."""
    w = 2 * np.pi * hz * T
    alpha = np.sin(w) / (2 * q)
    return lfilter([1 + depth * alpha, -2 * np.cos(w), 1 - depth * alpha], [1 + alpha, -2 * np.cos(w), 1 - alpha], u)


def warped(hz):
    return 2 / T * np.tan(np.pi * hz * T)


def backward(system):
    return control.sample_system(system, T, "backward_diff")


WORDS = {  # and a program's line, or a system of python-control
    "lowpass": ({"type": "lowpass", "a": 0.3}, lambda u: lfilter([0.3], [1, -0.7], u)),
    "lowpass of all": ({"type": "lowpass", "a": 1}, lambda u: u),
    "lowpass by cutoff": ({"type": "lowpass", "cutoff_hz": 20}, backward(1 / (1 + S / (40 * np.pi)))),
    "pi": ({"type": "pi", "kp": 2, "ki": 3}, backward(2 + 3 / S)),
    "pi explicit": ({"type": "pi", "kp": 2, "ki": 3, "method": "explicit"}, control.sample_system(2 + 3 / S, T, "euler")),
    "pi trapezoidal": (
        {"type": "pi", "kp": 2, "ki": 3, "method": "trapezoidal"},
        control.sample_system(2 + 3 / S, T, "bilinear"),
    ),
    "pid": ({"type": "pid", **PID, "tau": 0.01}, backward(2 + 3 / S + 0.04 * S / (1 + 0.01 * S))),
    "pid without filter": ({"type": "pid", **PID, "method": "trapezoidal"}, pid_by_hand),
    "lead": (
        {"type": "lead", "zero_hz": 10, "pole_hz": 90},
        control.sample_system((1 + S / warped(10)) / (1 + S / warped(90)), T, "bilinear"),
    ),
    "notch": (
        {"type": "notch", "frequency_hz": 80, "q": 2},
        control.sample_system(
            (S**2 + (160 * np.pi) ** 2) / (S**2 + 80 * np.pi * S + (160 * np.pi) ** 2),
            T,
            "bilinear",
            prewarp_frequency=160 * np.pi,
        ),
    ),
    "shallow notch": ({"type": "notch", "frequency_hz": 150, "q": 0.7, "depth": 0.2}, lambda u: cookbook(u, 150, 0.7, 0.2)),
    "biquad": (
        {"type": "biquad", "b0": 0.2, "b1": -0.5, "b2": 0.7, "a1": -1.2, "a2": 0.5},
        control.tf([0.2, -0.5, 0.7], [1, -1.2, 0.5], T),
    ),
    "fir": ({"type": "fir", "coefficients": [0.2, -0.5, 0.7, 0.1]}, lambda u: lfilter([0.2, -0.5, 0.7, 0.1], [1], u)),
    "fir of one": ({"type": "fir", "coefficients": [0.4]}, lambda u: 0.4 * u),
    "mean": ({"type": "mean", "n": 5}, control.tf([0.2] * 5, [1, 0, 0, 0, 0], T)),
    "mean of one": ({"type": "mean", "n": 1}, lambda u: u),
}


@pytest.mark.parametrize("name", WORDS)
def test_a_word_does_what_firmware_has_and_control_makes_of_it(name):
    """It runs every third tick of 1200 Hz, behind a plant; frames have the same as the simulation, by another law."""
    keys, expected = WORDS[name]
    tables = {
        "rates": {"tick_hz": 1200},
        "block": {"m": {"type": "mass", "mass": 2.0, "damping": 3.0}, "w": keys | {"every": 3}},
        "wire": {"w.u": "m.x + kick", "m.f": "-0.1*w.y + push"},
        "ports": {"hand": {"force": "push", "displacement": "m.x"}, "inputs": {"kick": "kick"}},
        "simulate": {"input": "noise", "from": "kick", "duration_s": 0.5, "show": ["w.u", "w.y"]},
    }
    run = wavesweep.simulate(tables)[0][::3]
    u = np.array(run["w.u"])
    wanted = control.forced_response(expected, U=u).outputs if isinstance(expected, control.lti.LTI) else expected(u)
    np.testing.assert_allclose(run["w.y"], wanted, rtol=0, atol=1e-11 * np.abs(wanted).max())
