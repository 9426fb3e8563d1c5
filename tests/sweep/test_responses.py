"""The table of responses: several specs, axes that only some of them read, and the static limit."""

import numpy as np

import wavesweep
from wavesweep import sweep


def test_an_axis_that_a_spec_does_not_read_has_no_value_there():
    specs = [
        wavesweep.load({"controller": {"kind": "pmw"}, "bode": {"frequency_hz": [0.0, 1.0], "b": [20.0, 40.0]}}),
        wavesweep.load({"controller": {"kind": "dc"}, "bode": {"frequency_hz": [0.0, 1.0]}}),
        wavesweep.load({"controller": {"kind": "pmw", "b": 30.0}, "bode": {"frequency_hz": [0.0, 1.0]}}),
    ]
    columns = sweep.responses(specs).columns
    assert columns["b"].tolist()[:4] == [20, 20, 40, 40]
    assert np.isnan(columns["b"][columns["controller"] == "dc"]).all()
    assert columns["b"].tolist()[-2:] == [30, 30]
    assert columns["frequency_hz"].tolist() == [0, 1] * 4
    assert np.isfinite(columns["impedance_abs"]).all()
    assert columns["impedance_re"][4] == 500.0


def test_whole_numbers_and_the_slow_rate_may_be_swept_in_one_spec_only():
    one = {
        "controller": {"kind": "pmw"},
        "bode": {"frequency_hz": [1.0], "environment.delay": [1, 2], "rates.slow_hz": [100.0]},
    }
    other = {"controller": {"kind": "pmw"}, "environment": {"delay": 3}, "bode": {"frequency_hz": [1.0]}}
    ideal = {"controller": {"kind": "dc"}, "bode": {"frequency_hz": [1.0]}}
    columns = wavesweep.bode(one, other, ideal)
    assert columns["environment.delay"].tolist()[:3] == [1, 2, 3]
    assert columns["environment.delay"].dtype == np.int64
    assert columns["rates.slow_hz"].tolist()[:3] == [100.0, 100.0, 50.0]
    assert np.isnan(columns["rates.slow_hz"].iloc[3])
