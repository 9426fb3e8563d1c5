import mpmath
import numpy as np
import pytest

from wavesweep.analysis.march.device import zero_order_hold

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


def test_ticks_of_many_lengths_are_solved_at_once():
    lengths = np.array([0.5e-3, 1e-3, 1.7e-3])
    batch = zero_order_hold(0.1, 1.5, 20.0, lengths)
    for length, row in zip(lengths, batch, strict=True):
        np.testing.assert_allclose(zero_order_hold(0.1, 1.5, 20.0, length), row, rtol=1e-14)
