"""The statements judged once for all tests: a few seconds, most of them for the simulated experiment."""

import pytest

from reproduce.open_choices import open_choices
from reproduce.paper_loops import PaperLoops
from reproduce.statements import STATEMENTS
from reproduce.verdicts import judge


@pytest.fixture(scope="session")
def paper():
    """Answers about the paper's specs, remembered over the tests."""
    return PaperLoops()


@pytest.fixture(scope="session")
def judged(paper):
    """The columns of the table of statements."""
    return judge(paper, STATEMENTS).columns


@pytest.fixture(scope="session")
def choices():
    """The columns of the study of open choices."""
    return open_choices().columns
