"""The paper's loop as flat values, from which each test changes what it is about."""

import pytest
from support.specs import values_of


@pytest.fixture
def values():
    """A function: the defaults with some keys changed, `values("dc-slow", K_VE=100.0, **{"rates.ratio": 1})`."""
    return values_of
