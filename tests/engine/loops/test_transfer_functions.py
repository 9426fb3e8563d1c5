"""Transfer functions as blocks: against scipy's difference equation and exact sums, and their loops over long frames."""

import mpmath
import numpy as np
import pytest
from scipy.signal import butter, lfilter

import wavesweep
from wavesweep.engine._loops.blocks import tf

mp = mpmath.mp.clone()
mp.prec = 333


def companion(num, den):
    """The difference equation with its last values as states, as anybody would write it: A, B, C, D."""
    n = len(den) - 1
    A = [[-a / den[0] for a in den[1:]]] + [[1.0 if column == row else 0.0 for column in range(n)] for row in range(n - 1)]
    C = [[b / den[0] - a / den[0] * num[0] / den[0] for a, b in zip(den[1:], num[1:], strict=True)]]
    return A, [[1.0]] + [[0.0]] * (n - 1), C, [[num[0] / den[0]]]


def loop(block, every, **numbers):
    """A block whose output is read every so many ticks, and fed back with a gain, beside a plant that a hand holds."""
    plant = {"type": "mass", "mass": 0.3, "damping": 20.0, "stiffness": 400.0}
    return wavesweep.compile(
        {
            "rates": {"tick_hz": 1000},
            "numbers": {"K": 0.5} | numbers,
            "block": {"f": block | {"discrete": True}, "s": {"type": "hold", "every": every}, "m": plant},
            "wire": {"f.u": "-K*s.y", "s.u": "f.y", "m.f": "hand"},
            "ports": {"hand": {"force": "hand", "displacement": "m.x"}},
            "sweep": {"along": "K", "K": {"start": -10, "stop": 10}},
        }
    )


def radius(num, den, every, K):
    """Spectral radius of that loop in 333 bits."""
    A, B, C, D = (mp.matrix(part) for part in companion([mp.mpf(b) for b in num], [mp.mpf(a) for a in den]))
    frame, fed = mp.eye(A.rows), mp.zeros(A.rows, 1)
    for _ in range(every):
        frame, fed = A * frame, A * fed + B
    values, _ = mp.eig(frame - fed * C * (K / (1 + K * D[0])))
    return max(abs(value) for value in values)


@pytest.mark.parametrize(
    ("num", "den", "states"),
    [
        ([1, 2, 3], [1, -0.5, 0.06], ("x0", "x1")),
        ([1], [1, -2, 1], ("x0", "x1")),
        ([1], [1, 0, 0], ("u1", "u2")),
        ([1, 1, 1], [3.0, 0, 0], ("u1", "u2")),
        ([1, 2, 3, 4], [2, -0.5, 0.0, 0], ("x0", "u1", "u2")),
        ([3, 4, 0], [2, -0.5, 0.0], ("x0", "u1")),
        ([2], [4], ()),
    ],
)
def test_a_discrete_one_is_its_difference_equation(num, den, states):
    block, u = tf("f", 1e-3, num, den, discrete=True), np.random.default_rng(1).normal(size=60)
    x, y = np.zeros(len(states)), []
    for value in u:
        y.append(block.C @ x + block.D[:, 0] * value)
        x = x + block.E @ x + block.B[:, 0] * value
    expected = lfilter([0.0] * (len(den) - len(num)) + num, den, u)
    assert block.states == states
    np.testing.assert_allclose(np.ravel(y), expected, rtol=0, atol=1e-14 * max(1, np.abs(expected).max()))


@pytest.mark.slow
@pytest.mark.parametrize(("order", "cutoff", "every"), [(2, 0.01, 20), (5, 0.05, 500)])
def test_ends_of_a_slow_filter_in_a_long_frame_are_right(order, cutoff, every):
    num, den = (each.tolist() for each in butter(order, cutoff))
    table = loop({"type": "tf", "num": num, "den": den}, every).stable_intervals("K")
    assert table.certified.all()
    assert len(table) == 1
    for end, outwards in ((table.low[0], -1), (table.high[0], 1)):
        step = mp.mpf(1e-9) * abs(mp.mpf(end)) * outwards
        assert radius(num, den, every, mp.mpf(end) - step) < 1 < radius(num, den, every, mp.mpf(end) + step)


@pytest.mark.parametrize("name", ["leak", "a"])
def test_a_pole_at_one_in_coefficients_that_are_expressions(name):
    """`1 - (2 - leak) + (1 - leak)` is 0, whatever rounding leaves of it; what it leaves depends on the numbers."""
    spec = {
        "rates": {"tick_hz": 1000},
        "numbers": {name: 1e-3, "K": 1.0},
        "block": {
            "p": {"type": "mass", "mass": 0.2, "damping": 10.0},
            "pi": {"type": "tf", "discrete": True, "num": [0.001, 0], "den": [1, f"-(2-{name})", f"1-{name}"]},
        },
        "wire": {"pi.u": "p.v", "p.f": "-K*pi.y"},
    }
    table = wavesweep.compile(spec).stable_intervals("K", (0.0, 100.0))
    assert table["certified"].all()
    a = np.exp(-10e-3 / 0.2)
    g = (1 - a) / 10

    def radius(K):
        return np.abs(np.roots(np.polyadd(np.polymul([1, -a], np.polymul([1, -1], [1, -(1 - 1e-3)])), [K * 1e-3 * g, 0]))).max()

    high = table["high"][0]
    assert radius(high * (1 - 1e-6)) < 1 < radius(high * (1 + 1e-6))


@pytest.mark.sample(2)
@pytest.mark.parametrize("leak", [1.2345e-3, 1.2345e-8, 1.2345e-10])
@pytest.mark.parametrize(
    "block",
    [
        {"type": "tf", "num": ["K"], "den": [1, "-(1 - leak)"]},
        {"type": "ss", "A": [["1 - leak"]], "B": [["K"]], "C": [[1]], "D": [[0]], "inputs": ["u"], "outputs": ["y"]},
    ],
)
def test_a_coefficient_keeps_its_distance_from_1(leak, block):
    """A leaky integrator about a plain gain is stable up to K = leak, whatever the double nearest to 1 - leak is."""
    spec = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 1e-12, "leak": leak},
        "block": {"c": block | {"discrete": True}, "p": {"type": "hold"}},
        "wire": {"c.u": "p.y", "p.u": "c.y"},
    }
    found = wavesweep.compile(spec).stable_intervals("K", (-leak, 8 * leak))
    assert found["certified"].all()
    np.testing.assert_allclose(found["high"], leak, rtol=1e-12)
    swept = wavesweep.compile(spec | {"numbers": {"K": leak / 2, "leak": 0.1}}).stable_intervals("leak", (leak / 8, 4 * leak))
    assert swept["certified"].all()
    np.testing.assert_allclose(swept["low"], leak / 2, rtol=1e-12)
