"""What `check` proves at a value, a row contains; what a row contains, `check` proves; what either refutes, neither proves."""

import pytest

from tests.for_all.law_of_check import KINDS, broken

pytestmark = pytest.mark.asks("contact")
SLOW = ("three ranges", "late ticks", "contact of waves")  # a minute and more each: from the command line alone
SEEDS = [seed for seed, kind in enumerate(KINDS) if kind not in SLOW]


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS, ids=lambda seed: KINDS[seed])
def test_rows_and_check_agree(seed):
    faults, _ = broken(seed)
    assert not faults
