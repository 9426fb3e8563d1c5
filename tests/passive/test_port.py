"""Passivity at the hand's port against dense scans of the lifted system, Colgate's bound and simulated energy."""

import numpy as np
import pytest
from support.exact import march, margin_at_rest
from support.held import held, more_damping, port_margin, scan
from support.specs import values_of

from wavesweep.engine._energy.lifted_map import TickMaps
from wavesweep.passive import margin
from wavesweep.passive.margin import ZERO_MARGIN


def lifted(values):
    """The lifted map from the forces of a frame to its displacements."""
    loop = held(values)
    port = loop.port()
    return TickMaps.of(port.maps, port.kind, loop.batch).in_even_units().lifted()


@pytest.mark.slow
@pytest.mark.parametrize("block", [0])
def test_100_random_loops_agree_with_a_scan(random_values, block):
    for seed in range(10 * block, 10 * block + 10):
        v = random_values(seed)
        found, seen = port_margin(v), scan(v).min()
        noise = 1e-9 * (abs(found.margin) + found.mean) + 1e-9 * abs(seen)
        assert found.certified, seed
        assert seen >= found.margin - noise, seed
        if seen < -noise - ZERO_MARGIN * found.mean:
            assert not found.passive, seed
        theta = np.array([found.omega * (1 if v["controller.kind"] == "dc" else v["rates.ratio"]) / v["rates.fast_hz"]])
        if found.margin < -ZERO_MARGIN * found.mean and theta > 1e-7:  # the lifted system has the violation where it is said
            assert scan(v, theta)[0] == pytest.approx(found.margin, rel=1e-5, abs=1e-8 * found.mean), seed


@pytest.mark.slow
@pytest.mark.parametrize("seed", [141, 152, 159])
def test_the_response_next_to_rest_is_that_of_ball_arithmetic(random_values, seed):
    """From 1e-13 rad per frame on, where the position's pole takes all digits of a lifted system in doubles."""
    pytest.importorskip("flint", reason="python-flint is the witness")
    from flint import arb, ctx
    from support import balls

    ctx.prec = 512
    v = random_values(seed)
    v |= {"rates.ratio": 1} if v["controller.kind"] == "dc" else {}  # its frame is one tick
    angles = [1e-13, 1e-9, 0.9e-7, 1.1e-7]
    maps = (np.array(balls.displacements(v, arb(angle))) for angle in angles)
    wanted = [np.linalg.eigvalsh((G + G.conj().T) / 2)[0] for G in maps]
    found = lifted(v)
    np.testing.assert_allclose(found.smallest(0, np.array(angles)), wanted, rtol=1e-10, atol=1e-12 * found.mean[0])


@pytest.mark.parametrize("seed", [1, 6, 9, 11, 12, 14])
@pytest.mark.parametrize("more", [3.0, 30.0])
def test_a_margin_of_zero_is_passive_where_a_search_only_decides_as_well(random_values, seed, more):
    """A spring that holds the scene has the margin 0, of which rounding makes a small number of either sign."""
    values = random_values(seed)
    loop = held(values | {"device.damping": values["device.damping"] + more})
    decided = margin.port_margin(loop, decide=True)
    assert decided.passive == margin.port_margin(loop).passive


def test_a_force_that_takes_energy_out_of_a_loop_that_is_not_passive(values):
    """The worst direction of the port, marched: more work comes out than all that went in before."""
    v = values("dc-slow", K_VE=200.0)
    found = port_margin(v)
    assert found.stable
    assert not found.passive
    theta, parts = found.omega * 0.02, lifted(v)
    E, T, O, G = (part[0] for part in (parts.E, parts.T, parts.O, parts.G))
    H = T + O @ np.linalg.solve((np.exp(1j * theta) - 1) * np.eye(len(E)) - E, G)
    _, vectors = np.linalg.eigh((H + H.conj().T) / 2)
    force = (np.exp(1j * theta * np.arange(400))[:, None] * vectors[:, 0]).real.ravel()
    seen = march(v, force)
    work = np.cumsum(force[:-1] * np.diff(seen["x"]))
    assert work[-1] < -1e-6


def filtered(order, cutoff_hz, ratio, damping, kind="pmw-lm"):
    """Waves without position feedback, as the tests above and those of the table have them."""
    lp1 = {"filters.lp1.order": order, "filters.lp1.cutoff_hz": cutoff_hz}
    return values_of(kind, Kp=0.0, ratio=ratio, damping=damping, velocity="difference", **lp1)


# The frames of which a motion drags the avatar along, through a filter that leaves up to 1e-11 of it.
DRAGGED = [(4, 3.13, 20), (4, 3.13, 5), (2, 8.0, 3), (6, 4.0, 8), (5, 3.5, 4), (3, 2.0, 10)]


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("frame", DRAGGED)
@pytest.mark.parametrize("kind", ["pmw", "pmw-lm"])
def test_no_damping_is_enough_where_a_motion_drags_the_avatar_along(frame, kind):
    """At 0 Hz, at 50 digits; what is left of the margin is far below the rounding of the map that it belongs to."""
    for damping in (1.5, 1294.0, 9000.0):
        values = filtered(*frame, damping, kind)
        found, exact = port_margin(values), float(margin_at_rest(values))
        assert exact < 0
        assert not found.passive
        assert found.margin <= exact * (1 - 1e-3)
        if damping > 1000:
            assert (found.margin, found.omega) == (pytest.approx(exact, rel=1e-3), 0)
    assert np.isnan(more_damping(filtered(*frame, 1.5, kind)))


@pytest.mark.slow
def test_a_port_is_passive_exactly_where_it_is_stable_and_its_margin_is_not_negative(random_values):
    for seed in range(5):
        for damping in (1.0, 300.0, 5000.0):
            found = port_margin(random_values(seed) | {"device.damping": damping, "controller.Kp": 0.0})
            if not np.isnan(found.margin):
                assert found.passive == (found.stable and found.margin >= 0), seed


def test_loops_in_a_batch_are_those_one_by_one(values):
    stiffness = np.array([[10.0, 100.0], [500.0, 5000.0]])
    found = port_margin(values("pmw", K_VE=stiffness, **{"device.velocity": "difference"}))
    alone = [port_margin(values("pmw", K_VE=K, **{"device.velocity": "difference"})).margin for K in stiffness.flat]
    assert found.margin.shape == (2, 2)
    np.testing.assert_allclose(found.margin.ravel(), alone, rtol=1e-9, atol=1e-9 * found.mean.max())


@pytest.mark.slow
def test_a_loop_whose_frame_overflows_is_not_passive_and_has_no_margin(values):
    v = values("dc-lm", K_LM=1e9, K_VE=np.array([10.0, 20.0]), **{"rates.ratio": 1000})
    found = port_margin(v)
    assert np.isnan(found.margin).all()
    assert not (found.stable | found.certified | found.passive).any()
