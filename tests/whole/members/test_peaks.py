"""Claims about numbers that a loop reads through peaks, poles, steps and pulses hold for members right beside these."""

import numpy as np
import pytest
from support import mean_members

TRIES = 40  # members of each interval that is claimed, most of them next to what is narrow


def contradictions(make, seeds):
    found = {}
    for seed in seeds:
        rng = np.random.default_rng([seed, 77])
        claim = make(rng)
        if wrong := claim.contradicted(rng, TRIES):
            found[seed] = claim.kind, wrong
    return found


@pytest.mark.slow
@pytest.mark.parametrize("ten", [0, 99])
def test_intervals_along_an_expression_hold_between_their_ends(ten):
    assert not contradictions(mean_members.mean_alone, range(10 * ten, 10 * ten + 10))


@pytest.mark.slow
@pytest.mark.asks("passive")
@pytest.mark.parametrize("seed", [15, 24])
def test_intervals_for_every_passive_hand_hold_where_an_expression_peaks(seed):
    assert not contradictions(mean_members.mean_hands, [seed])
