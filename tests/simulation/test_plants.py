"""Plants of several blocks run tick by tick as they move in between, and as the frames of the analysis do."""

import numpy as np
import pytest
import scipy.linalg
from support.plants import bodies

import wavesweep


def stepped(A, B, C, period, force, kp, kd):
    """The position of the last body, with scipy's exponential of a tick under PD from samples and the hand's force."""
    n = len(A)
    whole = scipy.linalg.expm(period * np.block([[A, B], [np.zeros((2, n + 2))]]))
    x, rows = np.zeros(n), []
    for f in force:
        q, w, last = C @ x
        rows.append(last)
        x = whole[:n, :n] @ x + whole[:n, n:] @ [-kp * q - kd * w, f]
    return np.array(rows)


@pytest.mark.parametrize("seed", range(6))
def test_bodies_move_between_ticks_as_their_exponential(seed):
    many, single, A, B = bodies(seed)
    force = np.random.default_rng(seed).normal(size=400)
    seen = wavesweep.compile(many).simulate(force)
    C = np.array(single["block"]["p"]["C"])
    expected = stepped(A, B, C, 1 / many["rates"]["tick_hz"], force, **many["numbers"])
    np.testing.assert_allclose(seen.x, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_filters_and_static_gains_within_a_plant_are_solved_by_the_simulation_too():
    """A tf with a direct term, of which a part goes back at once."""
    blocks = {
        "lag": {"type": "tf", "num": [1, 5], "den": [2, 3]},
        "m": {"type": "inertia", "inertia": 0.5, "damping": 3.0, "stiffness": 7.0},
        "held": {"type": "hold"},
    }
    wires = {"lag.u": "-0.7*lag.y + 0.1*m.x + held.y", "m.f": "3*lag.y + push", "held.u": "-m.x"}
    tables = {"rates": {"tick_hz": 100}, "block": blocks, "wire": wires}
    tables |= {"ports": {"hand": {"force": "push", "displacement": "m.x", "turns": True}}}
    found = wavesweep.compile(tables).response([0.5])
    assert found.stable.all()
    count, w = 6000, 2 * np.pi * 0.5 / 100
    seen = wavesweep.compile(tables).simulate(np.sin(w * np.arange(count)))
    last = slice(count - 1200, count)
    basis = np.stack([np.cos(w * np.arange(count)), np.sin(w * np.arange(count))], axis=1)[last]
    a, b = np.linalg.lstsq(basis, seen.x[last], rcond=None)[0]
    assert (b, a) == (
        pytest.approx(found.admittance_re[0], rel=1e-9),
        pytest.approx(found.admittance_im[0], rel=1e-9),
    )


def test_a_wall_that_reads_a_plant_is_what_its_wires_say():
    """Of a plant of several blocks, and of one that a dead time acts on: as the loop whose ports name no wall."""
    force = np.random.default_rng(2).normal(size=300)
    for dead in (True, False):
        block = {
            "m": {"type": "mass", "mass": 0.1, "damping": 1.5},
            "wall": {"type": "hold", "every": 2},
            "motor": {"type": "delay", "seconds": 0.0013} if dead else {"type": "hold"},
        }
        wire = {"wall.u": "-K*m.x - B*m.v", "motor.u": "wall.y", "m.f": "motor.y + push"}
        if not dead:
            block["far"], wire["far.f"] = {"type": "mass", "mass": 0.2}, "50*(m.x - far.x)"
            wire["m.f"] += " + 50*(far.x - m.x)"
        ports = {"hand": {"force": "push", "displacement": "m.x"}}
        tables = {"rates": {"tick_hz": 1000}, "numbers": {"K": 200.0, "B": 2.0}, "block": block, "wire": wire, "ports": ports}
        expected = wavesweep.compile(tables).simulate(force)
        found = wavesweep.compile(tables | {"ports": ports | {"wall": {"stiffness": "K", "damping": "B"}}}).simulate(force)
        np.testing.assert_allclose(found.x, expected.x, rtol=0, atol=1e-13)
        assert np.abs(found.F_s).max() > 1e-3
