"""One quick run, which all tests of this folder read."""

import pytest

import bench


@pytest.fixture(scope="session")
def quick():
    """The run of `python benchmarks/bench --quick`."""
    return bench.measure(quick=True)
