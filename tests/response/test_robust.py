"""Loops that overflow within a frame have no steady state, and say so without crashing."""

import numpy as np
import pytest
from support.intervals import intervals_of
from support.responses import loop_of
from support.specs import values_of

from wavesweep.response.steady import respond

# Local models so stiff for an explicit step that a frame of 1000 ticks leaves the range of doubles; and a local spring
# of the direct kind.
WAVES = values_of("pmw-lm", ratio=1000, delay=500, K_LM=1e9, **{"local_model.integration": "explicit"})
DIRECT = values_of("dc-lm", ratio=200, K_LM=1e9, B_LM=1e6)


@pytest.mark.parametrize("values", [WAVES, DIRECT])
@pytest.mark.parametrize("along", ["K_VE", "B_VE"])
def test_it_has_no_stable_interval_and_no_certificate(values, along):
    found = intervals_of(values, along, (0, 2e4), [0.0, 1.0])
    assert found.count.tolist() == [0, 0]
    assert not found.certified.any()


@pytest.mark.parametrize("values", [WAVES, DIRECT])
def test_its_response_is_missing(values):
    """An unstable loop has no steady state that anybody would feel; NaN is what a table shows."""
    found = respond(loop_of(values), [0.5, 10.0])
    assert np.isnan([found.admittance, found.impedance]).all()
