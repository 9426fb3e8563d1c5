"""A log has to move by three steps of its encoder."""

from types import SimpleNamespace

import numpy as np
import pytest

from wavesweep.engine.errors import UsageError
from wavesweep.identification.table import _refuse_log


def test_a_log_of_exactly_three_steps_moves_and_one_of_two_does_not():
    step, model = 2.0**-20, SimpleNamespace(delay=None, load=False, friction=False, measured="position")
    reading = step * np.array([0.0, 1, 2, 3, 2, 1, 0, 0])
    log = SimpleNamespace(reading=reading, force=np.sin(np.arange(8.0)), measured="position", period=1e-3)
    _refuse_log("log.csv", log, step, model)
    log.reading = np.minimum(reading, 2 * step)
    with pytest.raises(UsageError, match="changes by 3 of its steps at least, found 2"):
        _refuse_log("log.csv", log, step, model)
