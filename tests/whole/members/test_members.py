"""A claim about a set is held against members of the set, which are computed without it."""

import numpy as np
import pytest
from support import members

TRIES = 20  # members of each interval that is claimed
LONGER = 2.0  # of every interval, a claim that is false
KINDS = {make.__name__: make for make in members.KINDS}
SAMPLE = [
    ("drawn_hands", 10),  # no row: the device runs away without a hand
    ("drawn_hands", 1),
    ("drawn_frames", 3),
    ("drawn_messages", 23),  # one message more that is lost is found here
    ("drawn_messages", 2),  # one more tick of delay
    ("drawn_ranges", 2),
    ("built_in", 12),
    ("drawn_alone", 6),
    ("mean_square", 7),
    ("mean_square", 8),
    ("box_margins", 9),
    ("two_ports", 10),  # one port in place of two is found here
    ("built_in_words", 4),
    ("every_hand_damping", 136),  # delays in ticks that were taken for "frame" are found here
]


def drawn(name, seed):
    """A claim, and the random numbers that draw its members."""
    rng = np.random.default_rng([seed, list(KINDS).index(name)])
    return KINDS[name](rng), rng


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), SAMPLE)
def test_members_of_a_set_keep_what_is_claimed_for_the_set(name, seed):
    claim, rng = drawn(name, seed)
    assert not claim.contradicted(rng, TRIES)
    assert not claim.stated or claim.contradicted(rng, 5 * TRIES, LONGER)


@pytest.mark.parametrize(("name", "seed"), [("drawn_alone", 6), ("mean_square", 8)])
def test_a_row_that_is_missing_is_found(name, seed):
    claim, rng = drawn(name, seed)
    assert claim.missing(rng, claim.stated[1:])
