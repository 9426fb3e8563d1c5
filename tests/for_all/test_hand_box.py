"""The walls that every hand of a box bears, against sampled hands, and in 50 digits with the hand that is named."""

import numpy as np
import pytest
from support.held import box_intervals, ends_of, hands_at, worst_modes
from support.specs import values_of

from wavesweep.for_all.hand_box import HOLDING_A_DEVICE, HandBox

SPAN = (0.0, 20000.0)
LOOPS = {
    "pmw": {"integration": "explicit"},
    "pmw-lm": {"Kp": 20.0, "environment.integration": "explicit"},
    "dc": {"device.velocity": "difference"},
    "dc-slow": {"environment.delay": 5},
    "dc-lm": {},
}
NARROW = HandBox((0.05, 0.1), (3.0, 4.0), (300.0, 400.0))
LIGHT = HandBox((0.05, 0.3), (2.0, 6.0), (100.0, 500.0))
BOXES = {"dc": HOLDING_A_DEVICE, "dc-slow": NARROW, "dc-lm": LIGHT, "pmw": LIGHT, "pmw-lm": NARROW}


def sampled(box, count, seed=7):
    shares = np.random.default_rng(seed).random((count, 3))
    shares[: count // 4] = np.round(shares[: count // 4])  # corners and edges as well
    return hands_at(*ends_of(box), shares)


def hand_of(row, end="high"):
    return [float(row[f"{end}_hand_{part}"]) for part in ("mass", "damping", "stiffness")]


@pytest.mark.slow
@pytest.mark.parametrize("kind", LOOPS)
def test_walls_for_the_box_are_stable_for_sampled_hands_and_end_where_the_named_hand_says(kind):
    box = BOXES[kind]
    v = values_of(kind, **LOOPS[kind])
    rows = box_intervals(v, SPAN, box)
    assert rows["settled"].all()
    assert rows["intervals"][0]
    hands = sampled(box, 400)
    for row in rows:
        stiffness = row["low"] + (row["high"] - row["low"]) * np.array([1e-3, 0.1, 0.5, 0.9, 0.999])
        radius, _ = worst_modes(v, np.repeat(hands, stiffness.size, axis=0), np.tile(stiffness, len(hands)), 1.0)
        assert radius.max() < 1
        inside, outside = worst_modes(v, [hand_of(row)] * 2, row["high"] * np.array([1, 1 + 1.1e-3]), 1.0)[0]
        assert inside < 1 < outside
