"""Ends at which two eigenvalues of a frame meet at z = 1: a tick's eigenvalue -1, seen every even number of ticks."""

import numpy as np
import pytest

import wavesweep
from wavesweep.engine._stability.along_any import stable_along_any
from wavesweep.engine._stability.sampled_frames import ParametricFrames


def line(every, **numbers):
    """A wave line whose avatar runs every so many ticks: between, the line damps the device by its impedance."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 100.0, "B": 2.0, "m": 0.2, "d": 1.5, "b": 30.0} | numbers,
        "block": {
            "device": {"type": "mass", "mass": "m", "damping": "d"},
            "end": {"type": "wave", "b": "b"},
            "avatar": {"type": "avatar", "b": "b", "integration": "implicit", "every": every},
        },
        "wire": {
            "end.v": "device.v",
            "end.in": "avatar.out",
            "avatar.in": "end.out",
            "avatar.f": "K*avatar.x_spring + B*avatar.v",
            "device.f": "-end.force",
        },
    }


@pytest.mark.slow
@pytest.mark.whole
@pytest.mark.parametrize("every", [2])
def test_the_largest_impedance_beside_a_mass_is_certified(every):
    masses = np.geomspace(0.02, 0.4, 3)
    table = wavesweep.compile(line(every)).stable_intervals("b", (5.0, 2000.0), m=masses)
    assert table["certified"].all()
    a = np.exp(-1.5e-3 / masses)
    np.testing.assert_allclose(table["high"], 1.5 * (1 + a) / (1 - a), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.whole
@pytest.mark.parametrize("span", [(-0.1, 14.0)])
def test_an_end_at_which_a_position_and_its_integral_lose_their_springs_is_exact(span):
    """Both springs are proportional to the number, so that two eigenvalues are next to z = 1 beside 0."""
    loop = {
        "rates": {"tick_hz": 100},
        "numbers": {"p": 2.0},
        "block": {
            "m": {"type": "mass", "mass": 1.0},
            "i": {"type": "integrator", "every": 5, "method": "implicit"},
            "h": {"type": "hold", "every": 10},
        },
        "wire": {
            "i.u": "m.x",
            "h.u": "m.x",
            "m.f": "(-65.53129134442632*p)*h.y + (-11.003307386028977*p)*i.y + (-7.358146857439756)*m.v",
        },
    }
    (row,) = wavesweep.compile(loop).stable_intervals("p", span).to_dict("records")
    assert (row["certified"], row["low_omega"]) == (True, 0)
    assert abs(row["low"]) < 1e-14 * (span[1] - span[0])


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-7, 1e-5])
def test_a_pair_that_crosses_elsewhere_is_not_taken_for_one_that_meets(off):
    """A pair at an angle crosses at p = 1 + off, and a real eigenvalue at p = 1: both have to be seen, or there is doubt."""

    def evaluate(_, p):
        E = np.zeros((p.size, 3, 3), p.dtype)
        size = np.exp(0.1 * (p - 1 - off))
        E[:, 0, 0] = E[:, 1, 1] = size * np.cos(0.8) - 1
        E[:, 0, 1], E[:, 1, 0] = size * np.sin(0.8), -size * np.sin(0.8)
        E[:, 2, 2] = np.exp(-0.2 * (p - 1)) - 1
        return E

    found = stable_along_any(ParametricFrames(evaluate, np.ones(1)), (0.5, 1.6))
    assert not found.certified.any() or found.count.tolist() == ([1] if off > 0 else [0])
    assert found.certified.all() or off < 1e-6
