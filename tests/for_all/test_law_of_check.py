"""What `check` proves at a value, a row contains; what a row contains, `check` proves; what either refutes, neither proves."""

import pytest

from tests.for_all.law_of_check import KINDS, broken

pytestmark = pytest.mark.asks("contact")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(len(KINDS)), ids=KINDS)
def test_rows_and_check_agree(seed):
    faults, _ = broken(seed)
    assert not faults
