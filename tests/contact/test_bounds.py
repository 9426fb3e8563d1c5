"""The bounds of the check, held against arithmetic of 40 digits: every error is within its bound."""

from dataclasses import make_dataclass

import mpmath
import numpy as np
import pytest

from tests.contact.test_proof import FIG4, SLOW, any_multiplier, wall_loop
from wavesweep.contact.circle_check import _opened, _resolvents
from wavesweep.contact.rows_in_frames import _in_units
from wavesweep.contact.stored_check import Stored, _are_positive


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


@pytest.mark.parametrize("drifts", [False, True])
def test_units_change_entries_and_their_errors_alike(drifts):
    """Frames keep their eigenvalues, what is read keeps its product with what is moved, and errors their shares."""
    random = np.random.default_rng(2)
    spread = 10.0 ** random.uniform(-4, 4, (1, 4))
    changes = random.normal(size=(2, 4, 4)) * 0.1 * spread.mT / spread
    rows = random.normal(size=(2, 2, 4)) / spread
    fields = {"changes": changes, "changes_error": 0.01 * abs(changes), "rows": rows, "rows_error": 0.02 * abs(rows)}
    frames = make_dataclass("Frames", [*fields, "drifts"])(**fields, drifts=drifts)
    scaled, unit = _in_units(frames)
    np.testing.assert_allclose(scaled.changes_error, 0.01 * abs(scaled.changes), rtol=1e-12)
    np.testing.assert_allclose(scaled.rows_error, 0.02 * abs(scaled.rows), rtol=1e-12)
    for ours, theirs in zip(scaled.changes[:, :3, :3], changes[:, :3, :3], strict=True):
        np.testing.assert_allclose(np.poly(ours), np.poly(theirs), rtol=1e-9, atol=1e-12)
    moved = [each.rows[:, :, :3] @ each.changes[:, :3, 3:] for each in (scaled, frames)]
    np.testing.assert_allclose(moved[0] * unit, moved[1], rtol=1e-12)
    assert abs(scaled.changes[:, :3, 3]).max() < 10


def test_forms_are_positive_symmetric_and_finite_with_weights_above_0():
    whole = np.eye(2)[None]
    sign = np.ones((1, 1))
    assert _are_positive(Stored(whole, 1.0, 0.0, 0 * sign))
    turned = whole + np.array([[0, 1e-3], [-1e-3, 0]])
    for P in (turned, -whole, whole * np.nan, whole - 1):
        assert not _are_positive(Stored(P, 1.0, 0.0, 0 * sign))
    for weights in ((0.0, 0.0, sign), (-1.0, 0.0, sign), (1.0, -1e-9, sign), (1.0, 0.0, -sign)):
        assert not _are_positive(Stored(whole, *weights))
