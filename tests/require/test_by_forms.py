"""Stretches of a number that forms tell of a margin, held against an own matrix of a frame with complex factors."""

import numpy as np
import pytest
from support.margin_cut import factors_of, largest, tables_with

from wavesweep.engine.loop import Loops
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals
from wavesweep.require.by_forms import ByForms
from wavesweep.require.disc_panels import BAD, GOOD
from wavesweep.require.factors import Factors

SPAN = 50.0, 900.0
SIZES = {"gain": 2.0, "phase_deg": 40.0}


def spec_of(margin):
    return load(tables_with({"cut": "c.y", margin: SIZES[margin]}, SPAN))


@pytest.mark.slow
@pytest.mark.parametrize("margin", SIZES)
def test_stretches_that_are_told_have_the_margin_or_have_it_nowhere(margin):
    """And they leave less than a millionth of an end open."""
    factors = factors_of(margin, SIZES[margin], 4001)
    edges = np.linspace(*SPAN, 40)
    spec = spec_of(margin)
    loops = Loops(spec.drawing, dict(spec.values))
    told = ByForms(loops, "numbers.kp", "c.y", margin, SIZES[margin], SPAN).told(0, edges[:-1], edges[1:])
    good = [(low, high) for low, high, label in told if label == GOOD]
    bad = [(low, high) for low, high, label in told if label == BAD and low < high]
    assert len(good) == 1
    assert bad
    for low, high in good:
        assert max(largest(1.0, kp, factors) for kp in np.linspace(low, high, 20)) < 1
    for low, high in bad:
        assert min(largest(1.0, kp, factors) for kp in np.linspace(low, high, 20)[1:-1]) > 1
    assert min(low for low, _ in bad) - good[0][1] <= 1e-6 * good[0][1]


@pytest.mark.slow
def test_intervals_are_the_same_if_forms_are_asked_at_once(monkeypatch):
    rows = intervals(spec_of("phase_deg"), jobs=1).columns
    asked = []
    told = ByForms.told
    monkeypatch.setattr(ByForms, "told", lambda self, *panels: asked.append(1) or told(self, *panels))
    monkeypatch.setattr(Factors, "struggles", lambda self, tried: tried > 0)  # noqa: ARG005
    with_forms = intervals(spec_of("phase_deg"), jobs=1).columns
    assert asked
    assert with_forms["certified"].all()
    assert rows["certified"].all()
    for end in ("low", "high"):
        assert np.allclose(with_forms[end], rows[end], rtol=2e-7, atol=0)
