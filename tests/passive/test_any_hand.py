"""Colgate and Schenkel's bound at one rate, its extension to two, and what both are worth against hands."""

import numpy as np
import pytest
from support.held import any_hand_walls, damping_needed, hands_at, passive_walls, port_margin, worst_modes
from support.published import colgate_schenkel

ENCODER = {"device.velocity": "difference"}


@pytest.mark.parametrize("kind", ["dc", "dc-slow"])
@pytest.mark.parametrize(("stiffness", "damping"), [(500.0, 1.0), (2000.0, 0.0), (30.0, 12.0), (0.0, 3.0)])
def test_at_one_rate_it_is_the_bound_of_colgate_and_schenkel(values, kind, stiffness, damping):
    found = damping_needed(values(kind, K_VE=stiffness, B_VE=damping, **ENCODER | {"rates.ratio": 1}))
    assert found.certified
    assert found.damping == pytest.approx(colgate_schenkel(stiffness, damping, 1e-3), rel=1e-9)


@pytest.mark.parametrize("late", [0.0004, 0.0013, 0.002])
def test_a_dead_time_divides_the_tick_in_two_parts_of_which_a_hand_may_use_one(values, late):
    """`(d*/T - K (1/2 + late/T)) d* = K^2 T s (1 - s)/4`: a hand that is faster before the force changes takes out more."""
    K, T, s = 300.0, 1e-3, np.ceil(late / 1e-3 - 1e-9) - late / 1e-3
    found = damping_needed(values("dc", K_VE=K, B_VE=0.0, **ENCODER) | {"device.dead_time": late})
    held = K * (T / 2 + late)
    assert found.certified
    assert found.damping == pytest.approx((held + np.sqrt(held**2 + (K * T) ** 2 * s * (1 - s))) / 2, rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 12, 24])
def test_enough_damping_bears_every_hand_of_a_huge_box(random_values, seed):
    """Heavy, stiff and undamped hands, resonances near the rates among them: none is unstable."""
    v = random_values(seed) | ENCODER | {"controller.Kp": 25.0, "operator.mass": 0.0, "operator.stiffness": 0.0}
    needed = damping_needed(v)
    if not (needed.responsive and np.isfinite(needed.damping)):
        return
    v |= {"device.damping": max(float(needed.damping) * 1.001, 0.01), "operator.damping": 0.0}
    shares = np.random.default_rng(seed).random((600, 3))
    hands = np.concatenate(
        [
            hands_at((0.0, 0.0, 1.0), (0.0, 0.0, 1e6), shares[:150]),
            hands_at((1e-3, 0.0, 1e-1), (20.0, 0.0, 1e6), shares),
        ]
    )
    radius, _ = worst_modes(v, hands, v["environment.K_VE"], v["environment.B_VE"])
    assert radius.max() < 1 + 1e-9


def test_the_condition_for_held_forces_is_weaker_than_that_for_continuous_hands(values):
    """Between the two bounds the port is passive for held forces, and yet a passive hand makes the loop unstable."""
    v = values("dc", K_VE=100.0, B_VE=4.0, **ENCODER | {"rates.ratio": 1})
    assert port_margin(v).passive
    assert damping_needed(v).damping == pytest.approx(4.05)  # the device has 1.5
    springs = np.outer(np.geomspace(1.0, 1e7, 2000), [0, 0, 1])
    assert worst_modes(v, springs, 100.0, 4.0)[0].max() > 1.001
    assert worst_modes(v | {"device.damping": 4.06}, springs, 100.0, 4.0)[0].max() < 1


@pytest.mark.parametrize("mass", [1.0, 0.1, 0.001])
def test_at_the_port_a_spring_asks_for_colgates_damping_and_a_damper_for_less(values, mass):
    def passive(share, stiffness, damping):
        bound = colgate_schenkel(stiffness, damping, 1e-3)
        changes = ENCODER | {"rates.ratio": 1, "device.mass": mass, "device.damping": share * bound}
        return bool(port_margin(values("dc", K_VE=stiffness, B_VE=damping, **changes)).passive)

    assert [passive(share, 1000.0, 0.0) for share in (0.99, 1.01)] == [False, True]
    assert [passive(share, 1000.0, 2.0) for share in (0.9, 1.01)] == [True, True]


def test_waves_without_position_feedback_need_infinite_damping(values):
    """Hands that move at a multiple of the slow rate drag the avatar along: no damper undoes a force that stays."""
    assert damping_needed(values("pmw", **ENCODER)).damping == np.inf
    assert np.isfinite(damping_needed(values("pmw", Kp=20.0, **ENCODER)).damping)
    assert damping_needed(values("pmw", **ENCODER | {"rates.ratio": 1})).damping < np.inf


@pytest.mark.parametrize("dead_time", [0.0, 0.0015])
def test_no_wall_of_waves_without_position_feedback_is_stable_with_every_hand(dead_time, values):
    """The frame has a pole at z = 1 there, which is no rounding: values of K_VE are refuted away from it."""
    found = any_hand_walls(values("pmw", **ENCODER) | {"device.dead_time": dead_time}, (0.0, 5000.0))
    assert (found.low.tolist(), found.complete) == ([], True)


@pytest.mark.slow
def test_walls_that_are_passive_end_at_the_bound(values):
    found = any_hand_walls(values("dc", **ENCODER | {"device.damping": 3.5}), (0.0, 9000.0))
    np.testing.assert_allclose([found.low, found.high], [[0.0], [5000.0]], rtol=1e-6)
    assert (found.certified.tolist(), found.complete) == ([True], True)
    assert any_hand_walls(values("dc", **ENCODER), (0.0, 100.0)).high == [100.0]
    walls = passive_walls(values("dc", **ENCODER), (0.0, 9000.0))
    assert found.high[0] < 9000.0
    assert walls.low == [0.0]
    inside, outside = (values("dc", K_VE=walls.high[0] * (1 + by), **ENCODER) for by in (0, 3e-6))
    assert port_margin(inside).passive
    assert not port_margin(outside).passive
