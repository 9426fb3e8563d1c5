"""A claim about a set is held against members of the set, which are computed without it."""

import numpy as np
import pytest
from support.members import box_margins, built_in, drawn_hands, every_hand_damping

TRIES = 20  # members of each interval that is claimed
LONGER = 2.0  # of every interval, a claim that is false
SAMPLE = [
    (drawn_hands, (10, 0)),  # no row: the device runs away without a hand
    (drawn_hands, (1, 0)),
    (built_in, (13, 4)),
    (built_in, (15, 4)),
    (box_margins, (9, 7)),
    (every_hand_damping, (136, 10)),  # delays in ticks that were taken for "frame" are found here
]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), SAMPLE)
def test_members_of_a_set_keep_what_is_claimed_for_the_set(kind, seed):
    rng = np.random.default_rng(seed)
    claim = kind(rng)
    contradiction = claim.contradicted(rng, TRIES)
    assert not contradiction, (contradiction, claim.tables)
    assert not claim.stated or claim.contradicted(rng, 5 * TRIES, LONGER), claim.tables
