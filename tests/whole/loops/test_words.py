"""The words of firmware: against their difference equations, python-control, balls, and limits of loops in closed form."""

import re

import control
import numpy as np
import pytest
from scipy.signal import lfilter

import wavesweep
from wavesweep.engine._loops.integrator_modes import equations_of
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


@pytest.mark.parametrize(
    ("name", "gain"),
    [
        ("lowpass by cutoff", 1),
        ("lead", 1),
        ("notch", 1),
        ("mean", 1),
        ("fir", 0.5),
        ("biquad", 0.4 / 0.3),
        ("pi", None),
        ("pid", None),
    ],
)
def test_a_word_at_rest_is_known_without_rounding(name, gain):
    spec = spec_of(WORDS[name][0])
    block = word_of(spec)
    rest = equations_of(spec.drawing, spec.values, (), "", [block])
    rest.connect()
    if gain is None:  # an integral keeps any value without an input
        assert rest.null_space()
        return
    assert not rest.null_space()
    assert float(rest.outputs["w.y"]["w.u"]) == pytest.approx(gain)


def intervals(along, span, block, numbers, plant=None):
    plant = plant or {"type": "integrator"}  # x += T u
    found = wavesweep.compile(
        {
            "rates": {"tick_hz": 1 / T},
            "numbers": numbers,
            "block": {"x": plant, "c": block},
            "wire": {"c.u": "-x.y", "x.u": "c.y"},
            "sweep": {"along": along, along: {"start": span[0], "stop": span[1]}},
        }
    ).stable_intervals()
    assert found.certified.all()
    return found[["low", "high"]].to_numpy()


def test_pi_on_an_integrator_has_its_limits_in_closed_form():
    """d^2 + kp T d + ki T^2 with d = z - 1: ki T < kp < 2/T + ki T/2, or 2 kp/T - 4/T^2 < ki < kp/T."""
    pi, numbers = {"type": "pi", "kp": "kp", "ki": "ki", "method": "explicit"}, {"kp": 300.0, "ki": 5000.0}
    assert intervals("kp", (0, 2000), pi, numbers) == pytest.approx(np.array([[5000 * T, 2 / T + 5000 * T / 2]]), rel=1e-11)
    assert intervals("ki", (0, 1e6), pi, numbers) == pytest.approx(np.array([[0, 300 / T]]), rel=1e-11)
    numbers["kp"] = 900.0
    assert intervals("ki", (1, 1e6), pi, numbers) == pytest.approx(np.array([[2 * 900 / T - 4 / T**2, 900 / T]]), rel=1e-11)
    standard = {"type": "pi", "kp": "K", "ki": "K/Ti", "method": "explicit"}  # exact too: one word reads K
    assert intervals("K", (1, 2000), standard, {"K": 1.0, "Ti": 0.02}) == pytest.approx(
        np.array([[1, 2 / T / (1 - T / 0.04)]]), rel=1e-11
    )


def test_a_fir_on_an_integrator_has_its_limits_in_closed_form():
    """z^2 + z (c T - 1) + d T: d > -c, d < 1/T and d > c - 2/T."""
    fir = {"type": "fir", "coefficients": ["c", "d"]}
    assert intervals("d", (-2000, 2000), fir, {"c": 100.0, "d": 0.0}) == pytest.approx(np.array([[-100, 1 / T]]), rel=1e-11)
    assert intervals("c", (-2000, 2000), fir, {"c": 0.0, "d": 100.0}) == pytest.approx(
        np.array([[-100, 100 + 2 / T]]), rel=1e-11
    )


def test_pd_on_an_integrator_has_its_limits_in_closed_form():
    """z^2 + z (kp T + kd - 1) - kd: kp > 0, kd < 1 - kp T/2, and kd > -1."""
    pd = {"type": "pid", "kp": "kp", "kd": "kd"}
    assert intervals("kd", (-3, 3), pd, {"kp": 300.0, "kd": 0.0}) == pytest.approx(np.array([[-1, 1 - 300 * T / 2]]), rel=1e-11)
    assert intervals("kp", (-3, 3000), pd, {"kp": 300.0, "kd": 0.2}) == pytest.approx(np.array([[0, 2 * 0.8 / T]]), rel=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("block", "along", "span"),
    [
        ({"type": "pid", "kp": "kp", "ki": "40*kp", "kd": 0.02, "tau": "tau"}, "kp", (1, 5)),
        ({"type": "fir", "coefficients": [0.2, "b**2", 0.1]}, "b", (-3, 3)),
    ],
)
def test_numbers_of_words_are_swept_to_where_eigenvalues_cross(block, along, span):
    """The count of unstable eigenvalues of the closed loop, from the block's response, on both sides of each end."""
    own = {"kp": 2.0, "kd": 0.1, "tau": 0.003, "f": 50.0, "q": 2.0, "a": 0.5, "b": 0.5}
    read = re.findall(r"\w+", " ".join(str(each) for key, each in block.items() if key != "type"))
    numbers = {name: value for name, value in own.items() if name in read}
    plant = {"type": "tf", "num": [30.0], "den": [0.01, 1, 5]}
    found = intervals(along, span, block, numbers, plant)

    def stable(value):
        tables = {"rates": {"tick_hz": 1 / T}, "numbers": numbers | {along: value}, "block": {"x": plant, "c": block}}
        spec = load(tables | {"wire": {"c.u": "-x.y", "x.u": "c.y"}})
        parts = [each.block for each in Loops(spec.drawing, spec.values).drawn().placed]
        (A, B, C, D), (a, b, c, d) = ((1.0 * each.E + np.eye(len(each.states)), each.B, each.C, each.D) for each in parts)
        assert not D.any()
        whole = np.block([[A - B @ d @ C, B @ c], [-b @ C, a]])
        return np.abs(np.linalg.eigvals(whole)).max() < 1

    inside = np.linspace(*span, 100)
    margin = 1e-6 * (span[1] - span[0])
    for value in inside:
        if np.abs(found - value).min() > margin:
            assert stable(value) == any(low < value < high for low, high in found), value
    for value in found[(found > span[0]) & (found < span[1])]:
        assert stable(value - margin) != stable(value + margin)


@pytest.mark.parametrize("along", ["kp", "kd", "ki"])
def test_a_slow_controller_has_the_limits_that_its_frames_have(along):
    """Its own numbers are taken out of the frame; the spectral radius puts them in."""
    numbers = {"kp": 100.0, "ki": 50.0, "kd": 3.0}
    loop = wavesweep.compile(
        {
            "rates": {"tick_hz": 1000},
            "numbers": numbers,
            "block": {
                "m": {"type": "mass", "mass": 0.2, "damping": 0.1},
                "c": {"type": "pid", **{name: name for name in numbers}, "tau": 0.002, "every": 4, "phase": 1},
                "v": {"type": "mean", "n": 3, "every": 2},
            },
            "wire": {"v.u": "m.x", "c.u": "-v.y", "m.f": "c.y"},
            "sweep": {"along": along, along: {"start": 0, "stop": 1e4}},
        }
    )
    found = loop.stable_intervals()
    ends = [end for end in found[["low", "high"]].to_numpy().ravel() if 0 < end < 1e4]
    assert found.certified.all()
    assert ends
    sides = loop.spectral_radius(**{along: [end * (1 + side) for end in ends for side in (-1e-7, 1e-7)]}) > 1
    assert (sides[::2] != sides[1::2]).all()
