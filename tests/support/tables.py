"""Tables as mappings of columns, compared to the bit or to a relative difference."""

import numpy as np

from wavesweep.program.tables import kind_named


def same(found, expected, rtol=0.0):
    """Assert that two tables have the same columns in the same order, NaN being equal to NaN; rtol: 0 for equal to the bit.

    The residuals are roundings: without an equal bit there is nothing to compare.
    """
    assert list(found) == list(expected)
    for name, column in expected.items():
        assert found[name].dtype == column.dtype, name
        if column.dtype == np.float64:
            assert np.array_equal(np.isnan(found[name]), np.isnan(column)), name
            known = ~np.isnan(column)
            if rtol:
                if name != "residual":
                    np.testing.assert_allclose(found[name][known], column[known], rtol=rtol, err_msg=name)
                continue
            assert found[name][known].tobytes() == column[known].tobytes(), name
        else:
            assert found[name].tolist() == column.tolist(), name


MADE_UP = {"number": 1.0, "integer": 1, "boolean": True, "string": ""}


def rows_of(kind, rows, **columns):
    """The columns of a table of that kind: those given, and made-up values in all others that every such table has."""
    found = {name: np.asarray(column) for name, column in columns.items()}
    for field in kind_named(kind).fields:
        if not field.optional and field.name not in found:
            found[field.name] = np.full(rows, MADE_UP[field.kind], dtype=object if field.kind == "string" else None)
    found = {name: column.astype(object) if column.dtype.kind == "U" else column for name, column in found.items()}
    return kind_named(kind).ordered(found)
