"""Boxes of hands of one to four decades, against a search that knows nothing of how the walls came."""

import pytest
from stress.hands import SPAN, breaking, judge, question
from support.held import WALL, held

from wavesweep.for_all.unknown import Case
from wavesweep.program.spec import Axis

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("seed", [1, 103, 127, 130])
def test_what_is_settled_is_right(seed):
    """Three of these have light hands that alias between those of a grid of six along each number."""
    (verdict,) = judge(seed)
    assert verdict.kind == "right", verdict.truth


@pytest.mark.parametrize("seed", [103, 127])
def test_hands_that_swing_at_half_the_rate_are_met_before_a_proof_begins(seed):
    """They are unstable in one to three per cent of the range of their stiffness."""
    asked = question(seed)
    loop = held(asked.values).with_hand()
    ranges = [Axis(path, path, (), *ends, structural=False) for path, ends in asked.box.ranges().items()]
    case = Case(loop, WALL, SPAN, ranges)
    (part,) = case.narrowed(case.parts())
    assert breaking(asked, part.low, part.high, seed) is None
