"""The words of firmware: against their difference equations and python-control."""

import control
import numpy as np
import pytest
from scipy.signal import lfilter

from wavesweep.engine.loop import Loops
from wavesweep.program.spec import load
from wavesweep.simulation.running_blocks import loop_of

T = 1 / 400
S = control.tf("s")


def pid_by_hand(u, kp, ki, kd, tau, method):
    """As firmware has it, a line at a time."""
    y, total, last, slope = [], 0.0, 0.0, 0.0
    for each in u:
        ahead = {"explicit": 0.0, "implicit": T * each, "trapezoidal": T * each / 2}[method]
        slope = (tau * slope + each - last) / (tau + T)
        y.append(kp * each + ki * (total + ahead) + kd * slope)
        total, last = total + T * each, each
    return y


def lowpass_by_hand(u, a):
    y = [0.0]
    for each in u:
        y.append(y[-1] + a * (each - y[-1]))
    return y[1:]


def recursion(u, num, den):
    y, num, den = [], np.divide(num, den[0]), np.divide(den, den[0])
    for k in range(len(u)):
        past = sum(b * u[k - i] for i, b in enumerate(num) if k >= i)
        y.append(past - sum(a * y[k - i] for i, a in enumerate(den) if 0 < i <= k))
    return y


def cookbook(u, hz, q, depth):
    """R. Bristow-Johnson's notch; alpha of the numerator in proportion to what is left."""
    w = 2 * np.pi * hz * T
    alpha = np.sin(w) / (2 * q)
    return recursion(u, [1 + depth * alpha, -2 * np.cos(w), 1 - depth * alpha], [1 + alpha, -2 * np.cos(w), 1 - alpha])


def warped(hz):
    return 2 / T * np.tan(np.pi * hz * T)


def backward(system):
    return control.sample_system(system, T, "backward_diff")


PID = {"kp": 2.0, "ki": 3.0, "kd": 0.04}
WORDS = {
    "lowpass": ({"type": "lowpass", "a": 0.3}, lambda u: lowpass_by_hand(u, 0.3), None),
    "lowpass of all": ({"type": "lowpass", "a": 1}, lambda u: u, None),
    "lowpass by cutoff": (
        {"type": "lowpass", "cutoff_hz": 20},
        lambda u: lowpass_by_hand(u, T / (T + 1 / (40 * np.pi))),
        backward(1 / (1 + S / (40 * np.pi))),
    ),
    "pi": (
        {"type": "pi", "kp": 2, "ki": 3},
        lambda u: pid_by_hand(u, 2, 3, 0, 0, "implicit"),
        backward(2 + 3 / S),
    ),
    "pi explicit": (
        {"type": "pi", "kp": 2, "ki": 3, "method": "explicit"},
        lambda u: pid_by_hand(u, 2, 3, 0, 0, "explicit"),
        control.sample_system(2 + 3 / S, T, "euler"),
    ),
    "pi trapezoidal": (
        {"type": "pi", "kp": 2, "ki": 3, "method": "trapezoidal"},
        lambda u: pid_by_hand(u, 2, 3, 0, 0, "trapezoidal"),
        control.sample_system(2 + 3 / S, T, "bilinear"),
    ),
    "pid": (
        {"type": "pid", **PID, "tau": 0.01},
        lambda u: pid_by_hand(u, *PID.values(), 0.01, "implicit"),
        backward(2 + 3 / S + 0.04 * S / (1 + 0.01 * S)),
    ),
    "pid without filter": (
        {"type": "pid", **PID, "method": "trapezoidal"},
        lambda u: pid_by_hand(u, *PID.values(), 0, "trapezoidal"),
        None,
    ),
    "lead": (
        {"type": "lead", "zero_hz": 10, "pole_hz": 90},
        lambda u: recursion(u, *([1 + 1 / w, 1 - 1 / w] for w in (np.tan(np.pi * hz * T) for hz in (10, 90)))),
        control.sample_system((1 + S / warped(10)) / (1 + S / warped(90)), T, "bilinear"),
    ),
    "notch": (
        {"type": "notch", "frequency_hz": 80, "q": 2},
        lambda u: cookbook(u, 80, 2, 0),
        control.sample_system(
            (S**2 + (160 * np.pi) ** 2) / (S**2 + 80 * np.pi * S + (160 * np.pi) ** 2),
            T,
            "bilinear",
            prewarp_frequency=160 * np.pi,
        ),
    ),
    "shallow notch": (
        {"type": "notch", "frequency_hz": 150, "q": 0.7, "depth": 0.2},
        lambda u: cookbook(u, 150, 0.7, 0.2),
        None,
    ),
    "biquad": (
        {"type": "biquad", "b0": 0.2, "b1": -0.5, "b2": 0.7, "a1": -1.2, "a2": 0.5},
        lambda u: recursion(u, [0.2, -0.5, 0.7], [1, -1.2, 0.5]),
        control.tf([0.2, -0.5, 0.7], [1, -1.2, 0.5], T),
    ),
    "fir": (
        {"type": "fir", "coefficients": [0.2, -0.5, 0.7, 0.1]},
        lambda u: lfilter([0.2, -0.5, 0.7, 0.1], [1.0], u),
        control.tf([0.2, -0.5, 0.7, 0.1], [1, 0, 0, 0], T),
    ),
    "fir of one": ({"type": "fir", "coefficients": [0.4]}, lambda u: 0.4 * u, None),
    "mean": ({"type": "mean", "n": 5}, lambda u: recursion(u, [0.2] * 5, [1]), control.tf([0.2] * 5, [1, 0, 0, 0, 0], T)),
    "mean of one": ({"type": "mean", "n": 1}, lambda u: u, None),
}


def spec_of(block, every=3, **more):
    """A word that runs every third tick of 1200 Hz, behind a plant."""
    return load(
        {
            "rates": {"tick_hz": every * 400},
            "block": {"m": {"type": "mass", "mass": 2.0, "damping": 3.0}, "w": block | {"every": every}},
            "wire": {"w.u": "m.x", "m.f": "-0.1*w.y + push"},
            "ports": {"hand": {"force": "push", "displacement": "m.x"}},
        }
        | more
    )


def word_of(spec):
    return next(each.block for each in Loops(spec.drawing, spec.values).drawn().placed if each.block.name == "w")


def marched(block, u):
    x, y = np.zeros(len(block.states)), []
    for each in u:
        y.append((block.C @ x + block.D[:, 0] * each)[0])
        x = x + block.E @ x + block.B[:, 0] * each
    return y


def lawful(law, u):
    """A law of the simulation, run by itself."""
    moved = {name for _, row in law.moves for name in row}
    x, y = dict.fromkeys((*law.keeps, *moved), 0.0), []
    for each in u:
        now = {**x, "u": each}

        def value(name, now=now):
            if name not in now:
                now[name] = sum(factor * value(source) for factor, source in law.gives[name])
            return now[name]

        y.append(value("y"))
        later = {name: sum(factor * value(source) for factor, source in terms) for name, terms in law.keeps.items()}
        later |= {name: value(source) for first, row in law.moves for name, source in zip(row, (first, *row), strict=False)}
        x = later
    return y


@pytest.mark.parametrize("name", WORDS)
def test_a_word_does_what_its_difference_equation_says_and_control_makes_of_it(name):
    keys, by_hand, continuous = WORDS[name]
    u = np.random.default_rng(5).normal(size=200)
    spec, expected = spec_of(keys), by_hand(u)
    part = next(part for part in loop_of(spec.drawing, spec.values).blocks if part.name == "w")
    size = np.abs(expected).max()
    for found in (marched(word_of(spec), u), lawful(part.law, u)):
        assert np.abs(np.subtract(found, expected)).max() < 1e-12 * size
    if continuous is not None:
        assert np.abs(control.forced_response(continuous, U=u).outputs - expected).max() < 1e-11 * size
