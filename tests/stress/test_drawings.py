"""A sample of the stress run over drawn loops; `python -m stress.drawings 1000` is the whole of it."""

import pytest
from stress.drawings import main


@pytest.mark.slow
def test_a_sample_of_random_drawings_is_never_wrong():
    tally = main(12, 5000)
    assert tally.wrong == 0
    assert tally.certified > 8
    assert tally.points > 200
