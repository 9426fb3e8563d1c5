"""A pattern of ticks in the simulation: it decays where all ticks are proved, and grows where the pattern refutes."""

import numpy as np
import pytest

import wavesweep
from tests.late_ticks.test_rows import SPEC, changed
from wavesweep.simulation.from_spec import simulated

pytestmark = [pytest.mark.asks("for_all"), pytest.mark.asks("simulation")]
PULSE = {"input": "pulse", "duration_s": 3.0}


def run(K, ticks):
    """The largest position (m) early and late in a run of ticks of these lengths."""
    spec = changed(
        environment={**SPEC["environment"], "K_VE": K},
        simulate={**PULSE, "ticks": list(ticks)},
    )
    found = simulated(wavesweep.load(spec))
    x = np.abs(found.signals["x"])
    third = len(x) // 3
    return x[third : 2 * third].max(), x[2 * third :].max()


@pytest.mark.slow
def test_a_pattern_of_ticks_grows_where_it_refutes_and_decays_where_all_are_proved():
    """Proved to 481.5 N/m, refuted from 486.6 by 1.2, 1.2, 1 ms; ticks on time are stable to 551.5."""
    pattern = 0.0012, 0.0012, 0.001
    early, late = run(470.0, pattern)
    assert late < early
    early, late = run(500.0, pattern)
    assert late > early
    early, late = run(500.0, (0.001,))
    assert late < early
