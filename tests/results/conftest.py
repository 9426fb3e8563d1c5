"""Tables made by hand, with every number that is hard to write."""

import numpy as np
import pytest
from support.tables import same

HARD = [
    0.1,
    1e-300,
    5e-324,
    20000.0,
    -0.0,
    0.0,
    1.7976931348623157e308,
    -2.5e-310,
    1e14,
    1e15,
    2.0**53,
    1e22,
    1 / 3,
    np.nan,
]


@pytest.fixture
def facts():
    """Facts of a run."""
    return {
        "schema_version": 1,
        "tool_version": "0.1.0",
        "spec": {"controller": {"kind": "pmw", "b": 25.0}},
        "spec_sha256": "ab" * 32,
        "methods": {"intervals": "by hand"},
        "slices": {"computed": 3, "skipped": 0, "certified": 3},
        "timings": {"total": 0.25},
    }


@pytest.fixture
def columns():
    """A `zwidth` table with an axis of floats and one of whole numbers."""
    length = len(HARD)
    return {
        "B_VE": np.array([*HARD[:-1], 3.0]),
        "environment.delay": np.arange(length),
        "along": np.full(length, "K_VE", dtype=object),
        "intervals": np.arange(length) % 3,
        "interval": np.zeros(length, dtype=np.int64),
        "low": np.array(HARD[::-1]),
        "high": np.array(HARD),
        "low_omega": np.full(length, np.nan),
        "high_omega": np.arange(length, dtype=float),
        "certified": np.arange(length) % 2 == 0,
        "residual": np.full(length, 1e-16),
        "doubt": np.array(["", "rounding"] * (length // 2), dtype=object),
        "felt_low": np.array(HARD[::-1]),
        "felt_high": np.array(HARD[::-1]),
    }


@pytest.fixture(name="same")
def same_tables():
    """Whether two tables are equal to the bit."""
    return same
