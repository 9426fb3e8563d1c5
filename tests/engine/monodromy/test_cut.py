"""The loop cut at the wall: its transfer functions at 50 digits, its poles, its drift."""

import numpy as np
import pytest
from support import exact
from support.specs import KINDS, random_values, values_of

from wavesweep.engine._monodromy.cut import ADVANCE, OFFSET, VELOCITY
from wavesweep.haptics.controller_page import wall_cut

SPECS = [(kind, seed) for kind in KINDS for seed in (range(2) if kind == "dc" else range(5))]


def wall_reads(cut, w):
    """(G_x, G_v) at `w = z - 1`."""
    state = np.linalg.solve(w * np.eye(cut.E.shape[-1]) - cut.E, cut.B + 0j)
    G = (cut.C @ state + cut.D)[:, 0]
    return (G[ADVANCE] / w if cut.integrates else 0) + G[OFFSET], G[VELOCITY]


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), SPECS)
def test_what_the_wall_reads_is_what_the_equations_say(kind, seed):
    """G_x and G_v on the circle, a hundredth of a turn from z = 1 and further."""
    values = random_values(seed, kind)
    cut, frame = wall_cut(values), exact.frame(values)
    for theta in (0.06, 0.9, 3.0):
        z = exact.mp.expj(theta)
        for found, wanted in zip(wall_reads(cut, complex(z - 1)), frame.transfer(z), strict=True):
            assert abs(found - wanted) <= 1e-10 * abs(wanted)


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [(kind, seed) for kind in KINDS for seed in range(3)])
def test_the_spectral_radius_is_that_of_50_digits(kind, seed):
    """A simple eigenvalue of these matrices is good to 1e-10; pure delays are far inside and do not decide."""
    values = random_values(seed, kind)
    cut = wall_cut(values)
    found = np.abs(1 + np.linalg.eigvals(cut.closed(values["environment.K_VE"], values["environment.B_VE"]))).max()
    assert found == pytest.approx(float(exact.spectral_radius(values)), rel=1e-10)


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [0.0, 100.0])
@pytest.mark.parametrize("Kp", [0.0, 20.0])
@pytest.mark.parametrize("K_LM", [0.0, 500.0])
def test_drifts_together_leave_no_eigenvalue_at_one(stiffness, Kp, K_LM):
    """A local model without stiffness drifts by itself, beside or instead of hand and avatar."""
    values = values_of("pmw-lm", stiffness=stiffness, Kp=Kp, K_LM=K_LM)
    cut = wall_cut(values)
    found = 1 + np.linalg.eigvals(cut.closed(500.0, 1.0))
    assert np.abs(found - 1).min() > 1e-4
    assert np.abs(found).max() == pytest.approx(float(exact.spectral_radius(values)), abs=1e-11)


def test_without_a_wall_the_scene_drifts_and_is_set_aside():
    """At K_VE = 0 nothing reads where the scene is."""
    cut = wall_cut(values_of("dc-slow"))
    assert cut.integrates
    assert np.abs(1 + np.linalg.eigvals(cut.closed(0.0, 1.0))).max() < 1


def test_slow_filters_are_not_taken_for_drift():
    """6th order at 3 Hz: a loose rank decision moves the radius from 0.9871 to 0.9903."""
    cut = wall_cut(values_of("pmw", lp1_order=6, lp1_cutoff_hz=3.0))
    radius = np.abs(1 + np.linalg.eigvals(cut.closed(500.0, 1.0))).max()
    assert radius == pytest.approx(0.9871066800216373, rel=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_a_batch_gives_the_bits_of_its_members(kind):
    """Arrays broadcast over leading axes, and no element sees its neighbours."""
    b, mass, Kp = np.array([20.0, 40.0, 60.0]), np.array([0.1, 0.2, 0.05]), np.array([5.0, 20.0, 30.0])
    together = wall_cut(values_of(kind, b=b, mass=mass, Kp=Kp, delay=7))
    for i in range(3):
        alone = wall_cut(values_of(kind, b=b[i], mass=mass[i], Kp=Kp[i], delay=7))
        assert together.states == alone.states
        for part in "EBCD":
            found = np.broadcast_to(getattr(together, part), (3, *getattr(alone, part).shape))[i]
            assert np.array_equal(found, getattr(alone, part))
