import numpy as np
import pytest

from wavesweep.engine.errors import UsageError
from wavesweep.simulation.inputs import chirp, sine, stepped_sine


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
