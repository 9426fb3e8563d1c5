import math

import numpy as np
import pytest

from wavesweep.analysis.simulation.avatar import Avatar, allows, contact, free, grazing, port, pressed, touch


@pytest.mark.parametrize("integration", ["explicit", "implicit", "trapezoidal"])
def test_a_one_sided_wall_pushes_only_inside(integration):
    """`b·ẋ + F = √(2b)·u` always; F is the spring and damper inside, nothing outside, in between on the surface."""
    source = np.random.default_rng(5)
    wall = port(300.0, 4.0, 25.0, 0.02, integration)._replace(position=0.01, one_sided=True)
    met = set()
    for x, x_dot, u in (source.standard_normal((4000, 3)) * (0.02, 0.5, 2.0)).tolist():
        before = Avatar(x, x_dot)
        how, after = contact(wall, before, u), touch(wall, before, u)
        met.add(how)
        tilde = x + wall.behind * x_dot + wall.ahead * after.x_dot
        assert 25.0 * after.x_dot + after.F == pytest.approx(math.sqrt(50.0) * u, abs=1e-12)
        if how is pressed:
            assert tilde > 0.01
            assert pytest.approx(300.0 * (tilde - 0.01) + 4.0 * after.x_dot, abs=1e-12) == after.F
        elif how is free:
            assert tilde <= 0.01
            assert after.F == 0.0
        else:
            assert tilde == pytest.approx(0.01, abs=1e-15)
            assert 0.0 <= after.F <= 4.0 * after.x_dot
        assert after.touching is (how is not free)
        assert allows(wall, before, u, how)
    assert met == ({pressed, free} if integration == "explicit" else {pressed, free, grazing})


def test_deep_inside_there_is_no_second_side():
    wall = port(300.0, 4.0, 25.0, 0.02, "implicit")
    one_sided = wall._replace(one_sided=True)
    assert touch(one_sided, Avatar(0.02, 0.1), 0.7) == touch(wall, Avatar(0.02, 0.1), 0.7)
