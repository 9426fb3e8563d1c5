"""Passivity at the hand's port against dense scans of the lifted system, Colgate's bound and simulated energy."""

import numpy as np
import pytest
from support.exact import march, margin_at_rest
from support.held import held, more_damping, port_margin
from support.specs import nested, values_of
from support.specs import random_values as random_loop

import wavesweep
from wavesweep.passive.lifted_map import TickMaps
from wavesweep.passive.margin import TOLERANCE

THETA = np.concatenate([np.geomspace(1e-5, 1, 90), np.linspace(0.03, np.pi, 90)])


def lifted(values):
    """The lifted map from the forces of a frame to its displacements."""
    loop = held(values)
    port = loop.port()
    return TickMaps.of(port.maps, port.kind, loop.batch).in_even_units().lifted()


def scan(values, theta=THETA):
    """Smallest eigenvalue at each angle, from the lifted system with every tick's force an input."""
    G = over_frame(values, theta)
    return np.linalg.eigvalsh((G + np.swapaxes(G.conj(), -1, -2)) / 2)[:, 0]


def over_frame(values, theta):
    """The map from the forces of a frame to its displacements, by python-control; the frame of `dc` is one tick."""
    tables = nested(values | {"rates.ratio": 1, "environment.delay": 0} if values["controller.kind"] == "dc" else values)
    return np.moveaxis(wavesweep.compile(tables).to_control("displacement")(np.exp(1j * theta), squeeze=False), -1, 0)


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize("block", range(10))
def test_100_random_loops_agree_with_a_scan(random_values, block):
    for seed in range(10 * block, 10 * block + 10):
        v = random_values(seed)
        found, seen = port_margin(v), scan(v).min()
        noise = 1e-9 * (abs(found.margin) + found.mean) + 1e-9 * abs(seen)
        assert found.certified, seed
        assert seen >= found.margin - noise, seed
        if seen < -noise - TOLERANCE * found.mean:
            assert not found.passive, seed
        theta = np.array([found.omega * (1 if v["controller.kind"] == "dc" else v["rates.ratio"]) / v["rates.fast_hz"]])
        if found.margin < -TOLERANCE * found.mean and theta > 1e-7:  # the lifted system has the violation where it is said
            assert scan(v, theta)[0] == pytest.approx(found.margin, rel=1e-5, abs=1e-8 * found.mean), seed


@pytest.mark.sample(4)
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_the_response_is_that_of_the_lifted_system(random_values, seed):
    v = random_values(seed)
    theta, found = np.array([0.01, 0.3, 1.0, 3.0]), lifted(v)
    np.testing.assert_allclose(found.smallest(0, theta), scan(v, theta), rtol=1e-8, atol=1e-9 * found.mean[0])


@pytest.mark.sample(3)
@pytest.mark.slow
@pytest.mark.parametrize("seed", [141, 143, 146, 152, 156, 158, 159])
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


def test_the_mean_eigenvalue_is_the_direct_term(values):
    v = values("pmw")
    theta = np.pi * (np.arange(400) + 0.5) / 400
    G = over_frame(v, theta)
    assert np.trace(G, axis1=-2, axis2=-1).real.mean() / 20 == pytest.approx(port_margin(v).mean, rel=1e-9)


def test_a_device_alone_is_passive(values):
    found = port_margin(values("dc-slow", K_VE=0.0, B_VE=0.0))
    assert found.passive
    assert 0 < found.margin < found.mean


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


FADING = {  # a margin of -1e-9 of the mean eigenvalue at rest; 320-bit arithmetic says that no damping lifts it above zero
    "Kp": 0.0, "b": 1.15, "ratio": 3, "mass": 0.0855, "damping": 5.9, "K_VE": 380.0, "B_VE": 0.0, "integration": "explicit",
    "delay": 1, "lp1_order": 2, "lp1_cutoff_hz": 2.5,
}  # fmt: skip


@pytest.mark.parametrize(("more", "margin"), [(0.0, -6.549e-14), (92.1203, -4.130e-15), (921.0, -2.648e-16), (1e4, -2.1e-17)])
def test_a_margin_that_is_hardly_below_zero_is_no_passive_port(values, more, margin):
    found = port_margin(values("pmw", **FADING | {"damping": 5.9 + more}))
    assert found.margin == pytest.approx(margin, rel=0.03)
    assert (found.stable, found.passive) == (True, False)


def test_rounding_that_is_alike_in_both_ways_is_no_negative_margin(values):
    """In a frame of one tick both ways are the same sums, and some are -4e-22 at all angles next to rest, of 2.6e-6."""
    for damping in (242.091, *np.linspace(150, 300, 40)):
        found = port_margin(values("pmw", **{"rates.ratio": 1, "filters.lp1.order": 0, "device.damping": float(damping)}))
        assert found.passive
        assert abs(found.margin) < 1e-14 * found.mean


def test_the_damping_that_is_needed_is_known_to_a_thousandth(values):
    """That of 320-bit arithmetic: the margin is -1.063e-15 m/N at 1.0621 N*s/m and zero near 1.073; and there is none above."""
    loop = {"b": 47.5, "Kp": 1.23, "ratio": 1, "mass": 0.04, "damping": 0.02, "K_VE": 880.0, "B_VE": 0.227, "lp1_order": 0}
    assert more_damping(values("pmw", **loop, integration="explicit")) == pytest.approx(1.0732, rel=1e-3)
    assert np.isnan(more_damping(values("pmw", **FADING)))


def filtered(order, cutoff_hz, ratio, damping, kind="pmw-lm"):
    """Waves without position feedback, as the tests above and those of the table have them."""
    lp1 = {"filters.lp1.order": order, "filters.lp1.cutoff_hz": cutoff_hz}
    return values_of(kind, Kp=0.0, ratio=ratio, damping=damping, velocity="difference", **lp1)


# The frames of which a motion drags the avatar along, through a filter that leaves up to 1e-11 of it.
DRAGGED = [(4, 3.13, 20), (4, 3.13, 5), (2, 8.0, 3), (6, 4.0, 8), (5, 3.5, 4), (3, 2.0, 10)]


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
def test_damping_is_enough_behind_an_average_over_the_frame():
    """No motion at a multiple of the slow rate passes it, so none drags anything along; a shorter average lets them pass."""

    def row(n, damping):
        blocks = {
            "device": {"type": "mass", "mass": 0.1, "damping": damping},
            "velocity": {"type": "difference"},
            "end": {"type": "wave", "b": 20.0},
            "lp": {"type": "mean", "n": n},
            "avatar": {"type": "avatar", "b": 20.0, "every": 5},
            "late": {"type": "hold", "every": 5, "phase": 1},
        }
        wires = {"velocity.u": "device.x", "end.v": "velocity.y", "end.in": "late.y", "lp.u": "end.out", "avatar.in": "lp.y"}
        wires |= {"avatar.f": "300*avatar.x_spring + avatar.v", "late.u": "avatar.out", "device.f": "hand - end.force"}
        hand = {"force": "hand", "displacement": "device.x"}
        tables = {"rates": {"tick_hz": 1000}, "block": blocks, "wire": wires, "ports": {"hand": hand}}
        return wavesweep.compile(tables).passivity().iloc[0]

    needed = row(5, 20.0).damping_needed
    assert (row(5, 20.0 + needed).port_passive, row(5, 20.0 + needed).port_margin) == (True, 0.0)
    assert not row(5, 20.0 + 0.99 * needed).port_passive
    assert np.isnan(row(4, 20.0).damping_needed)
    assert row(4, 2000.0).port_margin < 0


@pytest.mark.slow
def test_a_port_is_passive_exactly_where_it_is_stable_and_its_margin_is_not_negative(random_values):
    for seed in range(60):
        for damping in (1.0, 300.0, 5000.0):
            found = port_margin(random_values(seed) | {"device.damping": damping, "controller.Kp": 0.0})
            if not np.isnan(found.margin):
                assert found.passive == (found.stable and found.margin >= 0), seed


def slow_integrator(tick, device, lp, every, phases, gains):
    """A position and a velocity feedback, and an integrator of the position at a slow rate."""
    fast, slow = every
    return {
        "rates": {"tick_hz": tick},
        "numbers": dict(zip(("K", "B", "ki", "a"), gains, strict=True)),
        "block": {
            "m": {"type": "mass", **dict(zip(("mass", "damping", "stiffness"), device, strict=True))},
            "h": {"type": "hold", "every": fast, "phase": phases[0]},
            "s": {"type": "tf", "discrete": True, "num": ["a", "-a"], "den": [1, "-(1-a)"], "every": fast},
            "i": {"type": "integrator", "every": slow, "method": "explicit"},
            "o": {"type": "hold", "every": slow, "phase": phases[1]},
            "lp": {"type": "butterworth", "order": lp[0], "cutoff_hz": lp[1]},
        },
        "wire": {
            "h.u": "m.x",
            "s.u": "h.y",
            "lp.u": f"s.y*{tick / fast!r}",
            "i.u": "ki*h.y",
            "o.u": "K*h.y + B*lp.y + i.y",
            "m.f": "hand - o.y",
        },
        "ports": {"hand": {"force": "hand", "displacement": "m.x"}},
    }


# An eigenvalue of the map, next to z = 1 and next to resonances, in 256 bits; and the mean of all.
SLOW_INTEGRATORS = [
    (1e4, (0.0229151, 0.0854363, 74.2528), (6, 69.4794), (1, 5), (0, 4), (26.5638, 0.0256935, 0.0550945, 0.0338909)),
    (3e3, (0.503046, 0.0257843, 1138741.0882444947), (1, 11.1613), (5, 5), (0, 3), (6.72151, 0.924689, 0.00173084, 0.00273953)),
    (1e4, (0.613466, 0.0140077, 699498.1972526183), (2, 8.38711), (1, 50), (0, 37), (4.80876, 0.126534, 1.14318, 0.204641)),
]
LOWEST = [(-5.41241930386e-10, 2.18e-7), (-1.5485851056781743e-15, 1.02e-10), (-6.547798245647756e-14, 5.21e-12)]


@pytest.mark.parametrize(("numbers", "expected"), list(zip(SLOW_INTEGRATORS, LOWEST, strict=True)))
def test_crossings_of_a_level_that_nearly_meet_are_not_missed(numbers, expected):
    found, (lowest, mean) = wavesweep.compile(slow_integrator(*numbers)).passivity().iloc[0], expected
    assert found.port_margin == pytest.approx(lowest, rel=2e-10, abs=2e-10 * mean)


@pytest.mark.slow
def test_a_margin_that_is_zero_by_structure_is_not_negative():
    """Rounding leaves up to 1e-11 of the mean eigenvalue; what is negative by more than FAINT is so in 320 bits, too."""
    negative = {370, 346, 1109, 98, 512, 567, 983}
    for seed in (*negative, 1409, 840, 283, 591, 317, 39, 107, 650, 1201, 294, 567, 1182, 803, 108, 464, 983, 1344):
        found = port_margin(random_loop(seed))
        assert -1e-10 * found.mean < found.margin < 1e-10 * found.mean
        assert (found.negative, found.passive) == (seed in negative, bool(found.stable) and seed not in negative)
        if seed in negative:
            assert found.margin == pytest.approx(float(margin_at_rest(random_loop(seed))), rel=1e-3)


def test_a_margin_of_zero_is_written_as_zero():
    """The port of a mass on a spring is passive up to a damper that samples too late; rounding alone made it -1e-21 m/N."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"kp": 240.0, "kd": 0.7},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 1.0}, "v": {"type": "difference"}},
        "wire": {"v.u": "m.x", "m.f": "hand - kp*m.x - kd*v.y"},
        "ports": {"hand": {"force": "hand", "displacement": "m.x"}},
    }
    found = wavesweep.compile(tables).passivity(kd=np.linspace(0.1, 5, 60))
    assert found.port_passive.sum() > 30
    assert (found.port_margin[found.port_passive] == 0).mean() > 0.8
    assert not ((found.port_margin != 0) & (np.abs(found.port_margin) < 1e-19)).any()
    assert (found.port_margin[~found.port_passive] < 0).all()


def test_a_margin_is_not_zero_where_no_way_leads_from_the_wall_to_the_hand(values):
    """The local model's spring is gone and the slow wave is not passed on at rest, so no wall holds the scene."""
    hidden = values(
        "pmw-lm", b=5.0, Kp=0.0, K_VE=500.0, K_LM=0.0, B_LM=2.0,
        **{"rates.ratio": 2, "device.mass": 0.05, "device.damping": 4.0, "filters.hp.order": 0, "filters.lp1.order": 1,
           "filters.lp1.cutoff_hz": 20.0, "filters.lp2.order": 0, "environment.delay": 0},
    )  # fmt: skip
    found, seen = port_margin(hidden), scan(hidden, np.geomspace(1e-4, np.pi, 300)).min()
    assert 0 < found.margin == pytest.approx(seen, rel=1e-3)


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


@pytest.mark.slow
def test_hundreds_of_ticks_in_a_frame(values):
    v = values("pmw", **{"rates.ratio": 200, "environment.delay": 80})
    found = port_margin(v)
    assert found.certified
    assert lifted(v).smallest(0, np.linspace(0, np.pi, 60)).min() >= found.margin - 1e-9 * found.mean
