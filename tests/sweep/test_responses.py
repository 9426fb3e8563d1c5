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
