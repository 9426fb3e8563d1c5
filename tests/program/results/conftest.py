"""Tables made by hand, with every number that is hard to write."""

import numpy as np
import pytest
from support.tables import rows_of, same

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
    return rows_of(
        "zwidth",
        length,
        **{"B_VE": [*HARD[:-1], 3.0], "environment.delay": np.arange(length)},
        along=["K_VE"] * length,
        intervals=np.arange(length) % 3,
        interval=np.zeros(length, dtype=np.int64),
        low=HARD[::-1],
        high=HARD,
        low_omega=np.full(length, np.nan),
        high_omega=np.arange(length, dtype=float),
        certified=np.arange(length) % 2 == 0,
        residual=np.full(length, 1e-16),
        doubt=["", "rounding"] * (length // 2),
        felt_low=HARD[::-1],
        felt_high=HARD[::-1],
    )


@pytest.fixture(name="same")
def same_tables():
    """Whether two tables are equal to the bit."""
    return same
