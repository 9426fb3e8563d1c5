"""The loop cut at the wall: its transfer functions at 50 digits, its poles, its drift."""

import numpy as np
import pytest
from support import exact
from support.lifted import poles, same_spectrum
from support.specs import KINDS, random_values, values_of

from wavesweep.diagram import draw
from wavesweep.lifted.at_wall import conserves, cut_at_wall
from wavesweep.lifted.cut import ADVANCE, OFFSET, V, close
from wavesweep.lifted.frame import lifted_system
from wavesweep.lifted.lift import frame_at_rest

SPECS = [(kind, seed) for kind in KINDS for seed in (range(2) if kind == "dc" else range(5))]


def wall_reads(cut, w):
    """(G_x, G_v) at `w = z - 1`."""
    state = np.linalg.solve(w * np.eye(cut.E.shape[-1]) - cut.E, cut.B + 0j)
    G = (cut.C @ state + cut.D)[:, 0]
    return (G[ADVANCE] / w if cut.integrates else 0) + G[OFFSET], G[V]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), SPECS)
def test_what_the_wall_reads_is_what_the_equations_say(kind, seed):
    """G_x and G_v on the circle, a hundredth of a turn from z = 1 and further."""
    values = random_values(seed, kind)
    cut, frame = cut_at_wall(draw(values)), exact.frame(values)
    for theta in (0.06, 0.9, 3.0):
        z = exact.mp.expj(theta)
        for found, wanted in zip(wall_reads(cut, complex(z - 1)), frame.transfer(z), strict=True):
            assert abs(found - wanted) <= 1e-10 * abs(wanted)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [(kind, seed) for kind in KINDS for seed in range(3)])
def test_the_spectral_radius_is_that_of_50_digits(kind, seed):
    """A simple eigenvalue of these matrices is good to 1e-10; pure delays are far inside and do not decide."""
    values = random_values(seed, kind)
    cut = cut_at_wall(draw(values))
    found = np.abs(1 + np.linalg.eigvals(close(cut, values["environment.K_VE"], values["environment.B_VE"]))).max()
    assert found == pytest.approx(float(exact.spectral_radius(values)), rel=1e-10)


@pytest.mark.parametrize(("kind", "seed"), SPECS)
def test_leaving_out_the_drift_leaves_out_nothing_else(kind, seed):
    """The cut loop with its wall has the poles of the whole lifted loop, less those at 1 and the dead ones at 0."""
    values = random_values(seed, kind)
    drawing, wall = draw(values), (values["environment.K_VE"], values["environment.B_VE"])
    ratio = drawing.ratio
    found = 1 + np.linalg.eigvals(close(cut_at_wall(drawing), *wall))
    whole = poles(lifted_system(drawing, ratio, *wall))
    # Chains of pure delays are defective at 0, where rounding is felt to the fourth root; the rest is what counts.
    found, whole = (p[np.abs(p) > 1e-2] for p in (found, whole))
    assert same_spectrum(found, whole[np.abs(whole - 1) > 1e-9], 1e-7)


def test_without_position_feedback_the_hand_drifts_by_structure():
    """Nothing in a free wave loop reads x; its eigenvalue 1 is left out by name, not by a tolerance."""
    drawing = draw(values_of("pmw"))
    cut = cut_at_wall(drawing)
    assert "frame.device.x" in cut.unread
    assert not conserves(drawing, cut)


def test_position_feedback_reads_the_hand():
    drawing = draw(values_of("pmw", Kp=20.0))
    cut = cut_at_wall(drawing)
    assert "frame.device.x" not in cut.unread
    assert not conserves(drawing, cut)


@pytest.mark.parametrize("kind", ["pmw", "pmw-lm"])
@pytest.mark.parametrize("velocity", ["exact", "difference"])
@pytest.mark.parametrize("delay", [0, 7, 20])
def test_a_spring_in_the_hand_leaves_a_conserved_combination(kind, velocity, delay):
    """x is read, and what stays for ever is avatar less hand: named, and no eigenvalue at 1 is left in the loop."""
    drawing = draw(values_of(kind, stiffness=100.0, velocity=velocity, delay=delay))
    cut = cut_at_wall(drawing)
    assert conserves(drawing, cut)
    assert not cut.integrates
    assert np.abs(np.linalg.eigvals(close(cut, 500.0, 1.0))).min() > 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{"Kp": 20.0}, {"hp_order": 0}])
def test_nothing_is_conserved_with_feedback_or_with_a_static_branch(changes):
    """Kp feeds the position back; without a high-pass the local model answers a constant wave."""
    values = values_of("pmw-lm", stiffness=100.0, **changes)
    assert not conserves(draw(values), cut_at_wall(draw(values)))
    radius = exact.spectral_radius(values, drift=0)
    assert abs(radius - 1) > 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [0.0, 100.0])
@pytest.mark.parametrize("Kp", [0.0, 20.0])
@pytest.mark.parametrize("K_LM", [0.0, 500.0])
def test_drifts_together_leave_no_eigenvalue_at_one(stiffness, Kp, K_LM):
    """A local model without stiffness drifts by itself, beside or instead of hand and avatar."""
    values = values_of("pmw-lm", stiffness=stiffness, Kp=Kp, K_LM=K_LM)
    cut = cut_at_wall(draw(values))
    assert ("frame.local.s" in cut.unread) == (K_LM == 0)
    found = 1 + np.linalg.eigvals(close(cut, 500.0, 1.0))
    assert np.abs(found - 1).min() > 1e-4
    assert np.abs(found).max() == pytest.approx(float(exact.spectral_radius(values)), abs=1e-11)


def test_without_a_wall_the_scene_drifts_and_is_set_aside():
    """At K_VE = 0 nothing reads where the scene is."""
    cut = cut_at_wall(draw(values_of("dc-slow")))
    assert cut.integrates
    assert np.abs(1 + np.linalg.eigvals(close(cut, 0.0, 1.0))).max() < 1


def test_slow_filters_are_not_taken_for_drift():
    """6th order at 3 Hz: a loose rank decision moves the radius from 0.9871 to 0.9903."""
    cut = cut_at_wall(draw(values_of("pmw", lp1_order=6, lp1_cutoff_hz=3.0)))
    radius = np.abs(1 + np.linalg.eigvals(close(cut, 500.0, 1.0))).max()
    assert radius == pytest.approx(0.9871066800216373, rel=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_a_batch_gives_the_bits_of_its_members(kind):
    """Arrays broadcast over leading axes, and no element sees its neighbours."""
    b, mass, Kp = np.array([20.0, 40.0, 60.0]), np.array([0.1, 0.2, 0.05]), np.array([5.0, 20.0, 30.0])
    together = cut_at_wall(draw(values_of(kind, b=b, mass=mass, Kp=Kp, delay=7)))
    for i in range(3):
        alone = cut_at_wall(draw(values_of(kind, b=b[i], mass=mass[i], Kp=Kp[i], delay=7)))
        assert together.states == alone.states
        for part in "EBCD":
            found = np.broadcast_to(getattr(together, part), (3, *getattr(alone, part).shape))[i]
            assert np.array_equal(found, getattr(alone, part))


@pytest.mark.parametrize("lp2", [0, 2])
def test_a_frame_at_rest_that_forgets_states_has_the_same_bits_alone(lp2):
    """With K_LM = 0 the local model's states leave the tick, and what stays must not lie otherwise in a batch's memory."""
    values, masses = (
        values_of("pmw-lm", Kp=20.0, K_LM=0.0, lp2_order=lp2, **{"local_model.delay": 0}),
        np.array([0.1, 0.137, 0.2741]),
    )
    together = frame_at_rest(draw(values | {"device.mass": masses}))
    for i in range(3):
        alone = frame_at_rest(draw(values | {"device.mass": masses[i : i + 1]}))
        for part in "EBCD":
            found = np.broadcast_to(getattr(together, part), (3, *getattr(alone, part).shape[1:]))[i]
            assert np.array_equal(found, getattr(alone, part)[0])


@pytest.mark.parametrize(("kind", "seed"), SPECS)
def test_a_cut_from_the_frame_at_rest_has_the_same_bits(kind, seed):
    """What is felt at rest needs more inputs and outputs; one connection serves both."""
    values = random_values(seed, kind)
    drawing = draw(values | {"device.mass": values["device.mass"] * np.array([1.0, 1.3])})
    alone, shared = cut_at_wall(drawing), cut_at_wall(drawing, frame_at_rest(drawing))
    assert (alone.states, alone.integrates, set(alone.unread)) == (shared.states, shared.integrates, set(shared.unread))
    for part in "EBCD":
        assert np.array_equal(*np.broadcast_arrays(getattr(alone, part), getattr(shared, part)))
