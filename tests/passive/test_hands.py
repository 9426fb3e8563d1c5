"""The worst hand of a box against sampled hands, and the walls that every hand of a box bears."""

import numpy as np
import pytest
from support.growth import growth_rate
from support.held import WALL, box_intervals, held, worst_modes
from support.search import worst_hand

from wavesweep.passive.hand import HOLDING_A_DEVICE, HandBox
from wavesweep.sweep.hands import stable_of

LOOPS = {
    "pmw": {"integration": "explicit", "K_VE": 900.0},
    "pmw-lm": {"Kp": 20.0, "environment.integration": "explicit"},
    "dc": {"K_VE": 3000.0, "device.velocity": "difference"},
    "dc-slow": {"K_VE": 150.0, "environment.delay": 5},
    "dc-lm": {"K_VE": 80.0},
}


@pytest.fixture(scope="module")
def walls():
    """The intervals of a loop for the whole box, computed once for each kind."""
    known = {}

    def found(kind, v):
        if kind not in known:
            known[kind] = box_intervals(v, (0.0, 20000.0), HOLDING_A_DEVICE)
        return known[kind]

    return found


def loop_of(values, kind, **more):
    changes = {("environment.integration" if k == "integration" else k): v for k, v in LOOPS[kind].items()}
    return values(kind, **changes | more)


def sampled(box, count, seed=7):
    shares = np.random.default_rng(seed).random((count, 3))
    shares[: count // 4] = np.round(shares[: count // 4])  # corners and edges as well
    return box.points(shares)


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("kind", LOOPS)
def test_none_of_10000_sampled_hands_is_worse(values, kind):
    v = loop_of(values, kind)
    hands = sampled(HOLDING_A_DEVICE, 10_000)
    radius, damping = worst_modes(v, hands, v["environment.K_VE"], v["environment.B_VE"])
    assert worst_hand(v, HOLDING_A_DEVICE).spectral_radius >= radius.max() * (1 - 1e-12)
    assert worst_hand(v, HOLDING_A_DEVICE, by="damping").damping_ratio <= damping.min() + 1e-12


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_none_of_2000_hands_is_worse_on_random_loops(random_values, seed):
    v = random_values(seed + 300)
    box = HandBox(mass=(0.0, 0.8), damping=(0.0, 20.0), stiffness=(0.0, 1500.0))
    radius, damping = worst_modes(v, sampled(box, 2000), v["environment.K_VE"], v["environment.B_VE"])
    assert worst_hand(v, box).spectral_radius >= radius.max() * (1 - 1e-9)
    assert worst_hand(v, box, by="damping").damping_ratio <= damping.min() + 1e-9


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("kind", LOOPS)
def test_the_worst_hand_swings_up_or_down_when_it_is_marched(values, kind):
    v = loop_of(values, kind)
    worst = worst_hand(v, HOLDING_A_DEVICE)
    held = v | {"operator.mass": worst.mass, "operator.damping": worst.damping, "operator.stiffness": worst.stiffness}
    assert growth_rate(held) == pytest.approx(worst.spectral_radius, rel=1e-6)


def test_a_box_that_is_a_point_is_that_hand(values):
    v = loop_of(values, "pmw")
    found = worst_hand(v, HandBox((0.2, 0.2), (3.0, 3.0), (300.0, 300.0)))
    assert (found.mass, found.damping, found.stiffness) == (0.2, 3.0, 300.0)
    assert found.spectral_radius == worst_modes(v, np.array([[0.2, 3.0, 300.0]]), 900.0, 1.0)[0][0]


def test_shares_are_those_that_the_points_were_made_of():
    box = HandBox(mass=(0.0, 0.8), damping=(2.0, 20.0), stiffness=(300.0, 300.0))
    share = np.random.default_rng(2).random((50, 3)) * [1, 1, 0]
    assert box.shares(box.points(share)) == pytest.approx(share, abs=1e-12)
    assert (box.points(box.shares([[0.9, 1.0, 5.0]])) == [[0.8, 2.0, 300.0]]).all()


def test_a_box_with_a_negative_or_empty_range_is_refused():
    with pytest.raises(ValueError, match="stiffness expected 0 <= low <= high"):
        HandBox((0.1, 0.2), (1.0, 2.0), (5.0, 1.0))


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in LOOPS if kind != "pmw-lm"])  # too many pieces for a proof
def test_walls_for_the_box_are_stable_for_sampled_hands_and_end_where_the_named_hand_says(values, walls, kind):
    v = loop_of(values, kind)
    found = walls(kind, v)
    assert found.settled
    assert found.each
    assert found.low.size
    hands = sampled(HOLDING_A_DEVICE, 400)
    for low, high, hand in zip(found.low, found.high, found.high_hand, strict=True):
        stiffness = low + (high - low) * np.array([1e-6, 0.1, 0.5, 0.9, 0.999999])
        radius, _ = worst_modes(v, np.repeat(hands, stiffness.size, axis=0), np.tile(stiffness, len(hands)), 1.0)
        assert radius.max() < 1
        if high < 20000.0:
            just = np.array([high * (1 - 1e-7), high * (1 + 1e-7)])
            inside, outside = worst_modes(v, np.repeat(hand[None], 2, axis=0), just, 1.0)[0]
            assert inside < 1 < outside


@pytest.mark.slow
def test_the_walls_for_the_box_are_within_those_of_each_of_its_hands(values, walls):
    v = loop_of(values, "dc-slow")
    found = walls("dc-slow", v)
    hands = sampled(HOLDING_A_DEVICE, 60)
    parts = dict(zip(("operator.mass", "operator.damping", "operator.stiffness"), hands.T, strict=True))
    each = stable_of(WALL, (0.0, 20000.0), held(v | parts, WALL))
    assert found.high.max() <= min(max(high for _, high in pieces) for pieces, _ in each) * (1 + 1e-9)
