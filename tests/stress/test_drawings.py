"""A sample of the stress run over drawn loops; `python -m stress.drawings 1000` is the whole of it."""

import pytest
from stress.drawings import look, look_at_rates, look_beside, look_within, main


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize("looking", [look, look_beside, look_at_rates, look_within])
def test_a_sample_of_random_drawings_is_never_wrong(looking):
    tally = main(12, 5000, looking)
    assert tally.wrong == 0
    assert tally.certified > 8
    assert tally.points > 200
