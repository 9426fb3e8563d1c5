import numpy as np
import pytest

from wavesweep.analysis.march.recording import read_force
from wavesweep.errors import UsageError


@pytest.fixture
def record(tmp_path):
    """A function that writes a CSV file and gives its path."""

    def write(text, encoding="utf-8"):
        path = tmp_path / "force.csv"
        path.write_bytes(text.encode(encoding))
        return path

    return write


def test_forces_alone_are_one_per_tick(record):
    assert np.array_equal(read_force(record("force_N\n1\n-2.5\n1e-3\n"), 1000.0).force, [1.0, -2.5, 1e-3])


@pytest.mark.parametrize("start", [0.0, 12.5])
def test_times_at_the_fast_rate_are_accepted(record, start):
    rows = "".join(f"{start + k / 3000:.6f}, x, {k}\r\n" for k in range(3000))
    path = record("\ufefftime_s, note, force_N\r\n" + rows + "\r\n")
    assert np.array_equal(read_force(path, 3000.0).force, np.arange(3000.0))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("force\n1\n", ":1: expected a column force_N in the header, found force"),
        ("", ":1: expected a column force_N in the header, found nothing"),
        ("force_N\n", "expected at least one row of numbers below the header, found none"),
        ("force_N\n1\nabc\n", ":3: force_N: expected a number, found abc"),
        ("force_N\n1\nnan\n", ":3: force_N: expected a number, found nan"),
        ("a,force_N\n1,1\n1\n", ":3: force_N: expected a number, found nothing"),
        ("time_s,force_N\n0,1\n0.001,1\n0.003,1\n", r":4: time_s: expected 0.002, a row every 0.001 s .* found 0.003"),
    ],
)
def test_a_bad_file_is_refused_with_its_place(record, text, expected):
    with pytest.raises(UsageError, match=expected):
        read_force(record(text), 1000.0)


def test_a_file_that_is_not_text_or_not_there_is_refused(record, tmp_path):
    with pytest.raises(UsageError, match="expected a readable file, found: No such file"):
        read_force(tmp_path / "none.csv", 1000.0)
    with pytest.raises(UsageError, match="expected a CSV file in UTF-8"):
        read_force(record("force_N\n1é\n", "latin-1"), 1000.0)
