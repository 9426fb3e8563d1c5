import mpmath
import numpy as np
import pytest

from wavesweep.simulation.body import Body, slide, zero_order_hold

T = 1e-3


def exact(mass, damping, stiffness):
    """The increments over a tick from a 60-digit matrix exponential."""
    with mpmath.workdps(60):
        mass = mpmath.mpf(mass)
        generator = mpmath.matrix([[0, 1, 0], [-stiffness / mass, -damping / mass, 1 / mass], [0, 0, 0]])
        increment = mpmath.expm(generator * mpmath.mpf(T)) - mpmath.eye(3)
        return [float(increment[row, column]) for row in (0, 1) for column in range(3)]


@pytest.mark.parametrize(
    ("mass", "damping", "stiffness"),
    [
        (0.1, 1.5, 0.0),
        (0.1, 0.0, 0.0),
        (0.1, 0.0, 250.0),
        (0.1, 1e-9, 0.0),
        (2.0, 1.0, 374.0),
        (0.1, 2.0, 10.0),  # equal poles
        (0.05, 40.0, 30.0),  # overdamped
        (1e-3, 20.0, 5e4),  # many time constants in a tick
    ],
)
def test_a_tick_is_the_exact_solution(mass, damping, stiffness):
    found = zero_order_hold(mass, damping, stiffness, T)
    np.testing.assert_allclose(found, exact(mass, damping, stiffness), rtol=2e-13, atol=0)


BODIES = [
    Body(0.1, 1.5, 0.0, 0.3),
    Body(0.1, 0.0, 0.0, 0.3),
    Body(0.1, 0.5, 400.0, 0.3),
    Body(0.1, 30.0, 400.0, 0.3),
    Body(1e-4, 1e-3, 3e3, 1e-3),  # swings several times in a tick
]


def tick(body, x, v, f, length=T):
    return slide(body, x, v, f, length, tuple(zero_order_hold(*body[:3], length).tolist()))


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES)
def test_a_tick_in_pieces_is_the_tick(body):
    """Motion, rest and setting off again do not depend on where a clock happens to cut the time."""
    source = np.random.default_rng(6)
    for x, v, f in (source.standard_normal((100, 3)) * (1e-3, 2e-3, 0.5)).tolist():
        whole, pieces = tick(body, x, v, f), (x, v)
        for _ in range(16):
            pieces = tick(body, *pieces, f, T / 16)
        assert whole == pytest.approx(pieces, rel=1e-10, abs=1e-15)


def test_a_sliding_mass_stops_where_its_energy_is_used_up():
    """`m·v²/2 = F·s`, and then it stays there to the bit."""
    body, state, seen = Body(0.1, 0.0, 0.0, 0.3), (0.0, 0.05), []
    for _ in range(30):
        state = tick(body, *state, 0.0)
        seen.append(state)
    assert state[0] == pytest.approx(0.1 * 0.05**2 / 2 / 0.3, rel=1e-12)
    assert seen[-10:] == [state] * 10
    assert state[1] == 0.0


@pytest.mark.parametrize("body", BODIES)
def test_a_force_below_friction_moves_nothing(body):
    assert tick(body, 0.0, 0.0, 0.99 * body.friction) == (0.0, 0.0)
    assert tick(body, 0.0, 0.0, 1.01 * body.friction)[0] > 0.0
