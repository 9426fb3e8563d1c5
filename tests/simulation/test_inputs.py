import numpy as np
import pytest

from wavesweep.engine.errors import UsageError
from wavesweep.simulation.inputs import chirp, read_force, sine, stepped_sine


def test_a_sine_is_measured_over_whole_periods():
    record = sine(1000.0, 3.0, amplitude=2.0, seconds=3.0, settle=1.0)
    (tone,) = record.tones
    assert (tone.frequency_hz, tone.first, tone.last) == (3.0, 1000, 3000)
    np.testing.assert_allclose(record.force, 2.0 * np.sin(2 * np.pi * 3.0 * np.arange(3000) / 1000.0), atol=1e-11)


def test_stepped_sines_follow_each_other_without_a_jump():
    record = stepped_sine(1000.0, [5.0, 7.3, 40.0], settle=0.5, periods=4, least=0.2)
    assert [tone.frequency_hz for tone in record.tones] == [5.0, 7.3, 40.0]
    assert record.tones[-1].last == len(record.force)
    for tone in record.tones:
        assert (tone.last - tone.first) * tone.frequency_hz / 1000.0 >= 4 - 0.05
        assert (tone.last - tone.first) >= 195
    assert np.abs(np.diff(record.force)).max() <= 2 * np.pi * 40.0 / 1000.0


def test_a_chirp_sweeps_from_start_to_stop():
    force = chirp(1000.0, 1.0, 50.0, seconds=10.0).force
    crossings = np.flatnonzero((force[:-1] <= 0) & (force[1:] > 0))
    assert 1000.0 / np.diff(crossings)[0] == pytest.approx(1.2, rel=0.2)
    assert 1000.0 / np.diff(crossings)[-1] == pytest.approx(50.0, rel=0.1)
    assert chirp(1000.0, 5.0, 5.0, seconds=1.0).force[50] == pytest.approx(1.0)


@pytest.mark.parametrize("frequency", [0.0, -1.0, 500.0, np.nan])
def test_a_frequency_out_of_range_is_refused(frequency):
    with pytest.raises(UsageError, match="expected above 0 and below 500"):
        stepped_sine(1000.0, [1.0, frequency])


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
        ("force\n1\n", ":1: expected one column force_N and at most one time_s in the header, found force"),
        ("root:x:0\ntoor:x:1\n", "at most one time_s in the header, found text that is no table of numbers"),
        ("secret,key\n", "at most one time_s in the header, found text that is no table of numbers"),
        ("", ":1: expected one column force_N and at most one time_s in the header, found nothing"),
        ("force_N\n", "expected a row of numbers below the header, found none"),
        ("force_N\n1\nabc\n", ":3: force_N: expected a number, found abc"),
        ("force_N\n1\nnan\n", ":3: force_N: expected a finite number, found nan"),
        ("a,force_N\n1,1\n1\n", ":3: expected 2 values as in the header, found 1"),
        ("force_N\n1\n\n2\n", ":3: force_N: expected a number, found nothing"),
        ("time_s,force_N\n0,1\n\n0.001,2\n\n", ":3: force_N: expected a number, found nothing"),
        ("time_s,force_N\n0,1\n0.001,1\n0.003,1\n", r":4: time_s: expected 0.002, a row every 0.001 s .* found 0.003"),
    ],
)
def test_a_bad_file_is_refused_with_its_place(record, text, expected):
    with pytest.raises(UsageError, match=expected):
        read_force(record(text), 1000.0)


def test_a_file_in_another_code_is_read_and_one_that_is_not_there_is_refused(record, tmp_path):
    with pytest.raises(UsageError, match="cannot be read: No such file"):
        read_force(tmp_path / "none.csv", 1000.0)
    with pytest.raises(UsageError, match=r"force.csv:2: force_N: expected a number, found 1é"):
        read_force(record("force_N\n1é\n", "latin-1"), 1000.0)
