"""What `check` proves at a value, a row contains; what a row contains, `check` proves; what either refutes, neither proves."""

import pytest

from tests.for_all.law_of_check import KINDS, broken

pytestmark = pytest.mark.asks("contact")
SEEDS = [*range(len(KINDS))]
SEEDS[KINDS.index("contact of waves")] = 1107  # the first ones of these are refused
SEEDS[KINDS.index("contact of a coupling")] = 1108


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS, ids=KINDS)
def test_rows_and_check_agree(seed):
    faults, asked, _ = broken(seed)
    assert asked
    assert not faults
