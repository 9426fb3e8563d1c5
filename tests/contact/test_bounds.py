"""The bounds of the check, held against arithmetic of 40 digits: every error is within its bound."""

import mpmath
import numpy as np
import pytest

from tests.contact.test_proof import FIG4, SLOW, any_multiplier, wall_loop
from wavesweep.contact.circle_check import _opened, _resolvents


def exact(array):
    """The same numbers for mpmath."""
    return mpmath.matrix(np.asarray(array).tolist())


def circle(angle):
    """The point of the unit circle at an angle that is a double."""
    return mpmath.expj(mpmath.mpf(float(angle)))


@pytest.fixture(autouse=True)
def _digits():
    with mpmath.workdps(40):
        yield


@pytest.mark.parametrize("tables", [SLOW, FIG4], ids=["dc-slow", "pmw"])
def test_resolvents_and_what_arcs_leave_out_are_within_their_bounds(tables):
    """`1 - K G_x - B G_v` without its pole, at the middles of arcs, as a line, and at their ends."""
    loop, rng = wall_loop(tables), np.random.default_rng(4)
    middles = np.concatenate([[1e-3, np.pi], rng.uniform(0, np.pi, 6)])
    half = 1e-4
    wall = np.array([300.0, 2.0])
    a, a1, rest = _opened(loop, wall, _resolvents(loop, middles, half), half**2 / 2)
    E, B = exact(loop.E.value), exact(loop.B.value)
    row, direct = exact(wall @ loop.rows.value), mpmath.mpf(float(wall @ loop.direct.value))
    for at, middle in enumerate(middles):

        def value(angle):
            X = mpmath.lu_solve((circle(angle) - 1) * mpmath.eye(len(loop.B.value)) - E, B)
            return 1 - direct - (row.T * X)[0]

        assert abs(value(middle) - complex(a.value[at])) <= a.error[at]
        for end in (-half, half):
            line = mpmath.mpmathify(complex(a.value[at])) + end * mpmath.mpmathify(complex(a1.value[at]))
            rounded = 1e-14  # the angle of the end
            assert abs(value(float(middle) + end) - line) <= rest[at] + a.error[at] + half * a1.error[at] + rounded


def test_multipliers_and_their_part_beside_the_pole_are_within_their_bounds():
    rng = np.random.default_rng(5)
    angles = rng.uniform(0, np.pi, 6)
    for _ in range(6):
        multiplier = any_multiplier(rng, 12)
        M, slope = multiplier.at(angles)
        q, _ = multiplier.pole_part(angles)
        for at, angle in enumerate(angles):
            z = circle(angle)
            terms = [(k, h) for k, h in enumerate(multiplier.before.tolist(), 1)]
            terms += [(-k, h) for k, h in enumerate(multiplier.after.tolist(), 1)]
            true = 1 - sum(h * z**-k for k, h in terms)
            turned = sum(1j * k * h * z**-k for k, h in terms)
            assert abs(true - complex(M.value[at])) <= M.error[at]
            assert abs(turned - complex(slope.value[at])) <= slope.error[at]
            assert abs((true / (z - 1)).real - float(q.value[at])) <= q.error[at]
