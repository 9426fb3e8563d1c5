import numpy as np
import pytest

from wavesweep.analysis.march.experiment import simulate
from wavesweep.analysis.march.presets import DEVICES


@pytest.mark.parametrize("name", DEVICES)
def test_every_device_runs_an_experiment(values, name):
    device = DEVICES[name]
    loop = {**values("pmw-lm", Kp=20.0, velocity="difference"), **device.values()}
    options = device.options(wall=0.0)
    assert options.max_force == device.max_force
    seen = simulate(loop, np.sin(np.arange(1000) / 50.0), options).signals
    assert np.abs(seen["x"]).max() > 0.0
    assert device.published
    assert device.assumed
