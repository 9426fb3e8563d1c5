"""The march grows and decays where the intervals say, for a sample of random specs (the whole: tests/support/growth.py)."""

import pytest
from support.growth import disagreements
from support.specs import random_values


@pytest.mark.parametrize("seed", range(0, 200, 20))
def test_growth_and_decay_in_time_agree_with_every_reported_end(seed):
    """A thousandth to either side of each end along K_VE."""
    wrong, _ = disagreements(random_values(seed))
    assert wrong == []


def test_the_sample_has_ends_to_look_at():
    assert sum(disagreements(random_values(seed))[1] for seed in range(0, 80, 20)) > 0
