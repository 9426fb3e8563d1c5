"""A claim about a set is held against members of the set, which are computed without it."""

import numpy as np
import pytest
from support import members

TRIES = 20  # members of each interval that is claimed
KINDS = {make.__name__: make for make in members.KINDS}
SAMPLE = [
    ("drawn_hands", 0),
    ("drawn_hands", 7),
    ("drawn_hands", 14),
    ("drawn_ranges", 5),
    ("drawn_ranges", 6),
    ("drawn_frames", 1),
]


def contradiction(name, seed):
    """A member that a claim does not hold for, with its spec; None without."""
    claim = KINDS[name](rng := np.random.default_rng([seed, list(KINDS).index(name)]))
    found = claim.contradicted(rng, TRIES)
    return found and {"seed": seed, "kind": claim.kind, **found, "spec": claim.tables}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), SAMPLE)
def test_members_of_a_set_keep_what_is_claimed_for_the_set(name, seed):
    assert not contradiction(name, seed)


@pytest.mark.thorough
@pytest.mark.parametrize("ten", range(100))
@pytest.mark.parametrize("name", KINDS)
def test_members_of_thousands_of_sets_keep_what_is_claimed(name, ten):
    assert not [found for seed in range(10 * ten, 10 * ten + 10) if (found := contradiction(name, seed))]
