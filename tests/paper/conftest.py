"""The statements judged once for all tests: a few seconds, most of them for the simulated experiment."""

import pytest

from wavesweep.paper.bench import Bench
from wavesweep.paper.statements import STATEMENTS
from wavesweep.paper.verdicts import judge


@pytest.fixture(scope="session")
def bench():
    """Answers about the paper's specs, remembered over the tests."""
    return Bench()


@pytest.fixture(scope="session")
def judged(bench):
    """The columns of the table of statements."""
    return judge(bench, STATEMENTS).columns
