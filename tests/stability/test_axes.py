"""Intervals along every axis of random specs stand before eigenvalues, as a sample (the whole: tests/support/axes.py)."""

import pytest
from support.axes import examine
from support.specs import random_values

pytestmark = pytest.mark.slow


@pytest.mark.sample(2)
@pytest.mark.parametrize("seed", range(0, 500, 100))
def test_no_certified_column_is_wrong_along_any_axis(seed):
    """Just inside and just outside of every end, and at 200 points between."""
    faults, counts = examine(random_values(seed))
    assert faults == []
    assert sum(counts.values()) > 0
