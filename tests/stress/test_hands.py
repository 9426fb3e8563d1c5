"""Boxes in which a search by six hands along each axis once missed the hand that breaks an interval."""

import pytest

pytest.importorskip("flint", reason="python-flint is the witness of the other stress")
from stress.hands import judge


@pytest.mark.parametrize("seed", [103, 127, 130])
def test_a_light_hand_that_aliases_between_the_hands_of_a_grid_is_found(seed):
    """Three of the five in 256 that a grid of six hands along each axis had missed; the others take longer."""
    (verdict,) = judge(seed)
    assert verdict.kind == "right", verdict.truth
