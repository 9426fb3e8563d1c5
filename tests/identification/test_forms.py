"""Columns of logs and responses with the names and units that other programs give them."""

import re

import numpy as np
import pytest
from scipy.signal import lfilter

from wavesweep.engine.errors import UsageError
from wavesweep.identification.log import _slope, read_log
from wavesweep.identification.points import read_response

TIMES = np.arange(60) / 1000
PUSH = np.sin(TIMES * 40)
MOTION = np.cos(TIMES * 50)
HEADERS = {  # what is measured, whether it turns, and the factors of the columns
    "t,F,x": ("position", False, (1, 1, 1)),
    "time_s,F,x": ("position", False, (1, 1, 1)),
    "Time (ms),Force [N],Position [mm]": ("position", False, (1e-3, 1, 1e-3)),
    "t_ms,force_mN,velocity_mm/s": ("velocity", False, (1e-3, 1e-3, 1e-3)),
    "t,F,speed": ("velocity", False, (1, 1, 1)),
    "time,torque_mNm,angle_deg": ("position", True, (1, 1e-3, np.pi / 180)),
    "t_us,torque,speed (1/min)": ("velocity", True, (1e-6, 1, np.pi / 30)),
    "t (\u03bcs),torque,Angle (°)": ("position", True, (1e-6, 1, np.pi / 180)),
    "t,tau,omega": ("velocity", True, (1, 1, 1)),
    "time_ns,F_kN,a_m/s^2": ("acceleration", False, (1e-9, 1e3, 1)),
    "t,voltage (mV),current": ("velocity", False, (1, 1e-3, 1)),
}


def written(path, header, *columns):
    np.savetxt(path, np.stack(columns, axis=1), "%.12g", ",", header=header, comments="")
    return path


@pytest.mark.parametrize("header", HEADERS)
def test_a_log_is_read_by_the_names_and_units_of_its_columns(header, tmp_path):
    measured, turns, factors = HEADERS[header]
    path = written(tmp_path / "log.csv", header, TIMES / factors[0], PUSH, MOTION)
    log = read_log(path, {}, {})
    assert (log.measured, log.turns, log.period) == (measured, turns, pytest.approx(1e-3))
    assert log.force == pytest.approx(PUSH * factors[1])
    assert log.reading == pytest.approx(MOTION * factors[2])
    assert len(log.taken) == sum(factor != 1 for factor in factors)
    assert log.circuit == ("voltage" in header)


def test_a_scale_that_is_given_takes_the_place_of_the_unit_of_a_name(tmp_path):
    path = written(tmp_path / "log.csv", "t,F,x_mm", TIMES, PUSH, MOTION)
    log = read_log(path, {}, {"position": 2.0})
    assert log.reading == pytest.approx(2 * MOTION)
    assert not log.taken


def test_a_column_that_is_named_has_its_unit_in_brackets_and_is_found_by_a_word(tmp_path):
    path = written(tmp_path / "log.csv", "Time (ms),Actual torque (% of rated),Actual speed (rpm)", TIMES * 1000, PUSH, MOTION)
    columns = {}
    for name, column in (("torque", "Actual torque (% of rated)"), ("speed", "Actual speed (rpm)")):
        with pytest.raises(UsageError, match=f"did you mean --column '{re.escape(f'{name}={column}')}'"):
            read_log(path, columns, {})
        columns[name] = column
    with pytest.raises(UsageError, match=r"\(% of rated\): expected N\*m, found % of rated; --scale torque=FACTOR turns"):
        read_log(path, columns, {})
    log = read_log(path, columns, {"torque": 2.0})
    assert log.reading == pytest.approx(MOTION * np.pi / 30)
    assert log.force == pytest.approx(2 * PUSH)


@pytest.mark.parametrize("header", ["freq_hz,admittance_abs,admittance_deg", "Frequency (Hz),admittance_abs,admittance_deg"])
def test_a_response_is_read_by_the_name_of_its_frequencies(header, tmp_path):
    hertz = np.arange(1.0, 21)
    path = written(tmp_path / "frf.csv", header, hertz, 1 / hertz, -hertz)
    assert read_response(path).frequency_hz == pytest.approx(hertz)


def test_columns_of_a_response_may_be_named(tmp_path):
    hertz = np.arange(1.0, 21)
    path = written(tmp_path / "frf.csv", "w,H,phi", hertz, 1 / hertz, -hertz)
    columns = {"frequency_hz": "w", "admittance_abs": "H", "admittance_deg": "phi"}
    found = read_response(path, columns=columns)
    assert np.abs(found.admittance) == pytest.approx(1 / hertz)
    with pytest.raises(UsageError, match="expected a column W, found w, H, phi"):
        read_response(path, columns=columns | {"frequency_hz": "W"})


def test_the_period_of_stamps_that_are_late_in_a_row_has_the_interval_of_what_is_alike():
    """Lateness of an autoregression of 0.8: its mean is off by 3 times as much as that of as many single ones."""
    late = lfilter([1], [1, -0.8], 1e-5 * np.random.default_rng(0).standard_normal(4000))
    period, half = _slope(5.0 + 1e-3 * np.arange(4000) + late)
    expected = 2 * 3 * late.std() / np.sqrt(4000**3 / 12) / 1e-3
    assert half == pytest.approx(expected, rel=0.05)
    assert abs(period / 1e-3 - 1) < half
