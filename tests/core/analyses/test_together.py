"""Loops of other numbers of states are computed in one call, as each kind of them would be by itself."""

from dataclasses import replace

import numpy as np
import pytest
from support.tables import same

from wavesweep.core.analyses.intervals import job_of
from wavesweep.core.spec import load
from wavesweep.core.stability import together
from wavesweep.core.sweep.running import in_memory

SWEEP = {"along": "K_VE", "K_VE": {"start": 0, "stop": 3000}, "B_VE": [0.5, 1.0, 4.0], "b": [6.0, 25.0]}
KINDS = {"K_LM": [0.0, 700.0, 2000.0], "Kp": [0.0, 20.0]}
SPECS = {
    "orders 7 to 9": ({}, KINDS),
    "slow filters": ({"lp1": {"order": 2, "cutoff_hz": 0.05}, "hp": {"order": 1, "cutoff_hz": 0.05}}, KINDS),
    "orders 14 to 16": ({"lp1": {"order": 6, "cutoff_hz": 10}, "lp2": {"order": 4, "cutoff_hz": 20}}, KINDS),
}


@pytest.mark.parametrize("name", SPECS)
def test_structures_together_have_the_intervals_of_each(name, monkeypatch):
    filters, axes = SPECS[name]
    tables = {"controller": {"kind": "pmw-lm"}, "environment": {"integration": "explicit"}, "filters": filters}
    job, calls = job_of(load({**tables, "sweep": SWEEP | axes})), []
    whole = together.stable_intervals
    monkeypatch.setattr(together, "stable_intervals", lambda *given: calls.append(given) or whole(*given))
    found, apart = in_memory(job), in_memory(replace(job, asked=replace(job.asked, order=0)))
    assert [cut.batch for cut, *_ in calls] == [(12,)]
    same(found, apart, rtol=1e-12)
    assert np.array_equal(found["certified"], apart["certified"])
    assert found["certified"].mean() > 0.9
