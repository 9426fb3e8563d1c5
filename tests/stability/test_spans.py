"""Parts of spans against loops over all pairs."""

import numpy as np
import pytest

from wavesweep.stability.spans import are_in, merged, weight_touching


def parts(r, count):
    column, low = r.integers(0, 3, count), r.integers(0, 12, count).astype(float)
    return column, low, low + r.integers(0, 3, count)


@pytest.mark.parametrize("seed", range(30))
def test_they_are_those_of_all_pairs(seed):
    r = np.random.default_rng(seed)
    column, left, right = merged(*parts(r, 6))
    owner, low, high = parts(r, 9)
    weight = r.integers(1, 3, 9).astype(float)
    pairs = (owner == column[:, None]) & (low <= right[:, None]) & (high >= left[:, None])
    assert weight_touching(column, left, right, owner, low, high, weight).tolist() == (pairs * weight).sum(1).tolist()
    value = r.uniform(0, 14, 9)
    there = (column == owner[:, None]) & (left < value[:, None]) & (value[:, None] < right)
    assert are_in(owner, value, column, left, right).tolist() == there.any(1).tolist()
    order = np.lexsort((left, column))
    assert (order == np.arange(column.size)).all()
    assert all((right[i] < left[i + 1]) or column[i] != column[i + 1] for i in range(column.size - 1))
