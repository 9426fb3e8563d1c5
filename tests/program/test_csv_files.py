"""Columns of numbers from CSV files."""

import pytest

from wavesweep.engine.errors import UsageError
from wavesweep.program.csv_files import MOST_COLUMNS, read_csv


def test_a_cell_beyond_the_limit_is_refused_in_a_line(tmp_path):
    path = tmp_path / "long.csv"
    path.write_text('time,force\n0,"' + "x" * 140_000 + '"\n')
    with pytest.raises(UsageError, match=r"long.csv: expected cells of at most 131072 letters"):
        read_csv(path, 10**7)


def test_a_file_with_very_many_columns_is_refused_at_its_header(tmp_path):
    path = tmp_path / "wide.csv"
    path.write_text(",".join(f"c{number}" for number in range(MOST_COLUMNS + 1)) + "\n")
    with pytest.raises(UsageError, match=r"wide.csv:1: expected at most 10000 columns, found 10001; export those"):
        read_csv(path, 10**7)
    path.write_text("time,force\n0,1\n")
    assert read_csv(path, 100).numbers(["force"]).tolist() == [[1.0]]
