"""Tables as mappings of columns, compared to the bit."""

import numpy as np


def same(found, expected):
    """Assert that two tables have the same columns in the same order, equal to the bit, NaN being equal to NaN."""
    assert list(found) == list(expected)
    for name, column in expected.items():
        assert found[name].dtype == column.dtype, name
        if column.dtype == np.float64:
            assert np.array_equal(np.isnan(found[name]), np.isnan(column)), name
            known = ~np.isnan(column)
            assert found[name][known].tobytes() == column[known].tobytes(), name
        else:
            assert found[name].tolist() == column.tolist(), name
