"""Sweeps that are quick, with everything in them that can go wrong in the order of rows."""

import pytest
from support.tables import same

from wavesweep.program.analyses import interval_jobs
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals

TABLES = {
    "environment": {"integration": "explicit"},
    "controller": {"kind": "pmw"},
    "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
    "sweep": {
        "along": "K_VE",
        "K_VE": {"start": 0, "stop": 20000},
        "b": [10.0, 25.0, 40.0],
        "B_VE": {"start": 0, "stop": 15, "num": 7},
        "K_LM": [100.0, 200.0],  # pmw has no local model: its rows are repeated
        "environment.delay": [0, 3],
        "Kp": [0.0, 20.0],
    },
}


def changed(**sweep):
    """The spec with other axes."""
    return load({**TABLES, "sweep": {"along": "K_VE", "K_VE": TABLES["sweep"]["K_VE"], **sweep}})


@pytest.fixture(scope="session")
def mixed():
    """The wall's axis between those of the loop, an axis that is not read, one in whole numbers, and holes."""
    return load(TABLES)


@pytest.fixture(autouse=True, scope="module")
def _small_chunks():
    """A few thousand slices are several chunks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(interval_jobs, "MOST", 4096)
        yield


@pytest.fixture(scope="session")
def long():
    """Several chunks."""
    return changed(b={"start": 5, "stop": 100, "num": 200}, B_VE={"start": 0, "stop": 15, "num": 81})


@pytest.fixture(scope="session")
def other():
    """Another spec of several chunks."""
    return changed(b={"start": 6, "stop": 100, "num": 200}, B_VE={"start": 0, "stop": 15, "num": 81})


@pytest.fixture(scope="session")
def long_table(long):
    """The table of the long sweep, computed in this process."""
    return intervals(long, jobs=1).columns


@pytest.fixture(name="same")
def same_tables():
    """Whether two tables are equal to the bit."""
    return same
