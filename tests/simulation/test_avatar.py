"""How an avatar meets a wall: pressed, free, or on the surface in between."""

import math

import numpy as np
import pytest

from wavesweep.simulation.laws import avatar
from wavesweep.simulation.tick_sums import Meeting

b, PERIOD, K, B, POSITION = 25.0, 0.02, 300.0, 4.0, 0.01


def response(integration):
    """Of the spring's depth and of the speed: factors of state, wave and force."""
    gives = avatar(PERIOD, b, integration).gives
    speed = {name: factor for factor, name in gives["v"]}
    ahead = {name: factor for factor, name in gives["x_spring"]}.get("v", 0.0)
    return ahead, speed["in"], speed["f"]


@pytest.mark.parametrize("integration", ["explicit", "trapezoidal"])
def test_a_one_sided_wall_pushes_only_inside(integration):
    """`b v + F = sqrt(2b) u` always; F is the spring and damper inside, nothing outside, in between on the surface."""
    source, (ahead, of_wave, of_force), met = np.random.default_rng(5), response(integration), set()
    wall = Meeting(K, B, ahead * of_force, of_force, POSITION)
    for before, u in (source.standard_normal((4000, 2)) * (0.02, 2.0)).tolist():
        F, touched = wall.force(before + ahead * of_wave * u, of_wave * u)
        speed = of_wave * u + of_force * F
        depth = before + ahead * speed
        assert b * speed + F == pytest.approx(math.sqrt(2 * b) * u, abs=1e-12)
        if not touched:
            met.add("free")
            assert (depth <= POSITION, F) == (True, 0.0)
        elif depth == pytest.approx(POSITION, abs=1e-15):
            met.add("grazing")
            assert 0.0 <= F <= B * speed
        else:
            met.add("pressed")
            assert depth > POSITION
            assert pytest.approx(K * (depth - POSITION) + B * speed, abs=1e-12) == F
    assert met == ({"pressed", "free"} if integration == "explicit" else {"pressed", "free", "grazing"})


@pytest.mark.parametrize("integration", ["explicit", "implicit", "trapezoidal"])
def test_a_wall_that_only_pushes_never_pulls(integration):
    """Its force is `max(0, K depth + B speed)` of depth and speed with that force, on both sides of the surface."""
    source, (ahead, of_wave, of_force) = np.random.default_rng(6), response(integration)
    wall, outside, left = Meeting(K, B, ahead * of_force, of_force, POSITION, pulls=False), 0, 0
    for before, u in (source.standard_normal((4000, 2)) * (0.02, 2.0)).tolist():
        F, touched = wall.force(before + ahead * of_wave * u, of_wave * u)
        speed = of_wave * u + of_force * F
        depth = before + ahead * speed - POSITION
        assert pytest.approx(max(0.0, K * depth + B * speed), abs=1e-12) == F
        assert touched == (F > 0)
        outside += touched and depth < 0
        left += not touched and depth > 0
    assert outside > 0
    assert left > 0
