"""Long tables are spelt by Arrow, short ones by Python: nobody can tell from the bytes."""

import numpy as np
import pytest

from wavesweep.results import text
from wavesweep.results.bulk import bulk_lines

BORDERS = [1e-10, 1e-5, 1e-4, 1e9, 1e10, 1e14, 1e15, 1e16, 1e22]


def same_both_ways(column):
    assert column.size < text.BULK
    assert bulk_lines({"a": column, "b": column}) == text.lines({"a": column, "b": column})


@pytest.mark.parametrize("seed", range(8))
def test_any_double_is_spelt_alike(seed):
    bits = np.random.default_rng(seed).integers(0, 2**64, text.BULK - 1, dtype=np.uint64).view(np.float64)
    same_both_ways(bits[np.isfinite(bits)])


def test_numbers_of_every_size_are_spelt_alike():
    random = np.random.default_rng(1)
    size = random.choice([-1.0, 1.0], 19_000) * 10.0 ** random.uniform(-20, 24, 19_000)
    for column in (size, np.round(size), np.round(size, 3), np.arange(-9000.0, 9000.0) / 4):
        same_both_ways(column)


def test_the_borders_between_two_spellings_are_spelt_alike():
    borders = np.array(BORDERS)
    around = [borders, np.nextafter(borders, 0), np.nextafter(borders, np.inf), borders * 1.5, borders * 0.3]
    same_both_ways(np.concatenate([*around, [0.0, -0.0, np.nan, 5e-324, 1.7976931348623157e308]]))


def test_every_kind_of_column_is_spelt_alike(columns):
    table = {name: np.resize(column, 1000) for name, column in columns.items()}
    table["along"] = np.resize(np.array(["K_VE", "a,b", 'say "hi"', "grün"], dtype=object), 1000)
    assert bulk_lines(table) == text.lines(table)
