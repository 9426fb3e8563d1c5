"""Boxes of hands of one to four decades, against a search that knows nothing of how the walls came."""

import pytest
from stress.hands import judge

pytestmark = pytest.mark.slow


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1, 103, 127, 130])
def test_what_is_settled_is_right(seed):
    """Three of these have light hands that alias between those of a grid of six along each number."""
    (verdict,) = judge(seed)
    assert verdict.kind == "right", verdict.truth
