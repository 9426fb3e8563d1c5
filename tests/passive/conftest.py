"""The paper's loop as flat values, and random loops of every kind."""

import pytest
from support.specs import random_values as any_values
from support.specs import values_of


@pytest.fixture
def values():
    """A function: the defaults with some keys changed, `values("pmw", K_VE=100.0, **{"filters.lp1.order": 2})`."""
    return values_of


@pytest.fixture
def random_values():
    """A function: a loop of any kind from a seed."""
    return any_values
