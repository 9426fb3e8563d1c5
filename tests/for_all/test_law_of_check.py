"""What `check` proves at a value, a row contains; what a row contains, `check` proves; what either refutes, neither proves."""

import pytest
from meaning.sets import ALONE, KINDS

from tests.for_all.law_of_check import broken

pytestmark = pytest.mark.asks("contact")
SETS = (0, 1, 3, 4, 5, 6, 7, 8, 9, 10, 13, 14, 23, 35, 47, 59)  # of each kind, the last of late ticks and of contact


@pytest.mark.slow
@pytest.mark.parametrize("number", SETS, ids=lambda number: f"{KINDS[number % len(KINDS)].__name__}-{number}")
def test_rows_and_check_agree(number):
    faults, asked, _ = broken(number)
    assert asked
    assert not faults


@pytest.mark.slow
@pytest.mark.parametrize("number", range(4), ids=lambda number: f"{ALONE[number % len(ALONE)].__name__}-{number}")
def test_rows_and_check_agree_of_two_channels_at_random_and_of_two_axes(number):
    faults, asked, _ = broken(number, ALONE)
    assert asked
    assert not faults
