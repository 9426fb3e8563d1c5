"""The damping that every passive hand needs while frames vary, against constant frames and marched networks."""

import numpy as np
import pytest
from support.frames import plan_of_controller
from support.marched_hands import growth, random_hand
from support.specs import values_of

pytest.importorskip("wavesweep.passive", reason="every hand at constant frames is known by it")
from support.held import damping_needed

from wavesweep.for_all.every_hand_proof import EveryHand
from wavesweep.for_all.frame_families import FramesInAnyOrder
from wavesweep.for_all.plan import FRAME

WALL = {"device.velocity": "difference", "environment.integration": "explicit"}


def needed(kind, frames, K_VE=100.0, B_VE=1.0, **more):
    values = values_of(kind, K_VE=K_VE, B_VE=B_VE, **WALL | more)
    return EveryHand.of(plan_of_controller(values, frames)).needed()


@pytest.mark.parametrize(
    ("kind", "ticks", "delay"), [("dc-slow", 16, 1), ("dc-slow", 9, FRAME), ("dc-lm", 7, 2), ("pmw", 4, 0)]
)
def test_at_constant_frames_it_is_the_damping_needed(kind, ticks, delay):
    gain = {"controller.Kp": 20.0}
    found = needed(kind, FramesInAnyOrder((ticks,), (delay,)), **gain)
    constant = {"rates.ratio": ticks, "environment.delay": ticks if delay == FRAME else delay}
    exact = damping_needed(values_of(kind, K_VE=100.0, B_VE=1.0, **WALL | gain | constant))
    assert found.proved == pytest.approx(exact.damping, rel=1e-6)
    assert found.proved >= exact.damping
    assert (found.refuted, found.omega) == pytest.approx((float(exact.damping), float(exact.omega)), rel=1e-9, abs=1e-4)


def test_a_pattern_may_need_more_than_any_frame_that_is_repeated():
    alone = [
        needed("dc-slow", FramesInAnyOrder((ticks,), (2,)), 400.0, 16.0, **{"rates.fast_hz": 155.0}) for ticks in (2, 3, 5)
    ]
    found = needed("dc-slow", FramesInAnyOrder((2, 3, 5), (2,)), 400.0, 16.0, **{"rates.fast_hz": 155.0})
    assert len(found.word) == 2
    assert found.refuted > 1.1 * max(each.proved for each in alone)
    assert found.refuted < found.proved < 1.05 * found.refuted


@pytest.mark.parametrize("seed", range(4))
def test_networks_of_masses_and_springs_are_stable_with_frames_in_any_order(seed):
    rng = np.random.default_rng(seed)
    lengths, period = tuple(sorted({*rng.integers(2, 12, 3).tolist()})), 10 ** rng.uniform(-4, -2)
    wall = 10 ** rng.uniform(0, 4), 10 ** rng.uniform(0, 3) * period * (seed % 2)
    delays = (FRAME,) if seed % 3 == 0 else tuple(sorted({*rng.integers(0, min(lengths) + 1, 2).tolist()}))
    found = needed("dc-slow", FramesInAnyOrder(lengths, delays), *wall, **{"rates.fast_hz": 1 / period})
    for _ in range(40):
        word = [(length, delay) for length, delay in zip(rng.choice(lengths, 3), rng.choice(delays, 3), strict=True)]
        word = [(int(length), int(length if delay == FRAME else delay)) for length, delay in word]
        device = 10 ** rng.uniform(-3, 1), 1.00001 * found.proved
        assert growth(random_hand(rng), device, wall, word, period) < 1 + 1e-7


def test_with_less_damping_a_heavy_mass_is_unstable():
    found = needed("dc-slow", FramesInAnyOrder((16, 33)), B_VE=0.0)
    nothing = np.zeros((1, 1))
    unstable = [
        growth((nothing, nothing, nothing), (mass, 0.9 * found.refuted), (100.0, 0.0), [(33, 1)], 1e-3) for mass in (0.3, 3.0)
    ]
    assert max(unstable) > 1 + 1e-6
    assert growth((nothing, nothing, nothing), (0.3, found.proved), (100.0, 0.0), [(33, 1)], 1e-3) < 1


@pytest.mark.parametrize("kind", ["dc-slow", "dc-lm"])
def test_frames_of_a_single_tick_are_among_others(kind):
    """There a slow block runs in every tick, and nothing of it is held."""
    found, alone = (needed(kind, FramesInAnyOrder(lengths, (0,))) for lengths in ((1, 3), (3,)))
    assert alone.refuted <= found.refuted <= found.proved
    assert found.proved == pytest.approx(alone.proved, rel=1e-6)  # as prompt results need no more than the longest frame
