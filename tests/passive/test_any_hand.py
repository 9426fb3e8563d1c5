"""Colgate and Schenkel's bound at one rate, its extension to two, and what both are worth against hands."""

import numpy as np
import pytest
from support.held import any_hand_walls, damping_needed, hands_at, port_margin, port_passive_walls, worst_modes
from support.published import colgate_schenkel

from wavesweep.passive.hand import HandBox
from wavesweep.passive.hinf import SOFT, peak_by_levels

ENCODER = {"device.velocity": "difference"}


@pytest.mark.parametrize("kind", ["dc", "dc-slow"])
@pytest.mark.parametrize(("stiffness", "damping"), [(500.0, 1.0), (2000.0, 0.0), (30.0, 12.0), (0.0, 3.0)])
def test_at_one_rate_it_is_the_bound_of_colgate_and_schenkel(values, kind, stiffness, damping):
    found = damping_needed(values(kind, K_VE=stiffness, B_VE=damping, **ENCODER | {"rates.ratio": 1}))
    assert found.certified
    assert found.damping == pytest.approx(colgate_schenkel(stiffness, damping, 1e-3), rel=1e-9)


def test_point_samples_of_the_velocity_have_no_bound(values):
    assert damping_needed(values("dc")) is None
    assert any_hand_walls(values("dc"), (0.0, 100.0)) is None


@pytest.mark.sample(3)
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(25))
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
            hands_at(HandBox((0.0, 0.0), (0.0, 0.0), (1.0, 1e6)), shares[:150]),
            hands_at(HandBox((1e-3, 20.0), (0.0, 0.0), (1e-1, 1e6)), shares),
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


def test_walls_that_are_passive_end_at_the_bound(values):
    found = any_hand_walls(values("dc", **ENCODER), (0.0, 9000.0), hand_damping=2.0)
    np.testing.assert_allclose([found.low, found.high], [[0.0], [5000.0]], rtol=1e-6)
    assert any_hand_walls(values("dc", **ENCODER), (0.0, 100.0), hand_damping=2.0).high == [100.0]
    walls = port_passive_walls(values("dc", **ENCODER), (0.0, 9000.0))
    assert found.high[0] < 9000.0
    assert walls.low == [0.0]
    inside, outside = (values("dc", K_VE=walls.high[0] * (1 + by), **ENCODER) for by in (-1e-8, 1e-6))
    assert port_margin(inside).passive
    assert not port_margin(outside).passive


@pytest.mark.sample(2)
@pytest.mark.parametrize("gain", [0.3, 0.05, 0.01])
def test_a_weak_position_feedback_asks_for_damping_at_the_lowest_frequencies(values, gain):
    """The slow mode turns with some mrad/s or less: heavy masses find it, and the weaker condition at the port does too."""
    v = values("pmw", Kp=gain, **{"device.damping": 40.0, "rates.ratio": 1} | ENCODER)
    high = any_hand_walls(v, (0.0, 2000.0)).high[0]
    assert high <= port_passive_walls(v, (0.0, 2000.0)).high[0] <= high * (1 + 1e-4)
    masses = np.geomspace(1e2, 1e10, 200)
    hands = np.stack([masses, 0 * masses, 0 * masses], axis=-1)
    inside, outside = (worst_modes(v, hands, high * share, v["environment.B_VE"])[0].max() for share in (0.99, 1.2))
    assert inside < 1
    assert outside > 1 + 5e-11


@pytest.mark.parametrize("slow", [1e-7, 3e-5])
def test_a_slow_peak_is_found_without_the_eigenvalues_of_its_level(slow):
    """The angles that are tried first lie half a decade apart; the others are decades away."""

    def value(_, theta, floor):
        assert floor.shape == theta.shape
        return 1 / (1 + (np.log10(np.maximum(theta, 1e-30) / slow)) ** 2)

    def found(more):
        return peak_by_levels(value, lambda owner, _: np.full((owner.size, 1), np.nan), 1, lambda *_: 1e-3, more).value[0]

    assert found(()) < 0.3
    assert found(SOFT) > 0.9


def test_along_the_fast_rate_the_bound_is_that_of_colgate_and_schenkel(values):
    """K T/2 + B < d: the rate has to be above K/(2 (d - B))."""
    v = values("dc", **ENCODER, K_VE=800.0, B_VE=0.5, **{"device.damping": 1.5})
    found = any_hand_walls(v, (100.0, 4000.0), path="rates.fast_hz")
    assert found.low == [pytest.approx(400.0, rel=1e-5)]
    assert found.low[0] >= 400.0
    assert found.high == [4000.0]


@pytest.mark.parametrize(("K", "low"), [(800.0, [0.05]), (5000.0, [])])
def test_the_damping_needed_does_not_depend_on_the_mass(K, low, values):
    v = values("dc", **ENCODER, K_VE=K, B_VE=0.5, **{"device.damping": 1.5})
    assert any_hand_walls(v, (0.05, 1.0), path="device.mass").low.tolist() == low
