"""Stretches of a number that forms tell of a margin, held against an own matrix of a frame with complex factors."""

import numpy as np
import pytest
from scipy.linalg import expm

from wavesweep.engine.loop import Loops
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals
from wavesweep.require.between import Between
from wavesweep.require.by_forms import ByForms
from wavesweep.require.disc_panels import BAD, GOOD
from wavesweep.require.factors import Factors

T, N, M, D, TD = 0.001, 5, 1.0, 0.5, 0.3


def spec_of(margin, size):
    """A mass with friction, whose sampled position and velocity come back as a force a frame later."""
    return load(
        {
            "rates": {"tick_hz": 1000},
            "numbers": {"kp": 100.0},
            "block": {
                "plant": {"type": "mass", "mass": M, "damping": D},
                "c": {"type": "hold", "every": N},
                "z": {"type": "delay", "steps": 1, "every": N},
            },
            "wire": {"c.u": f"-kp*(plant.x + {TD}*plant.v)", "z.u": "c.y", "plant.f": "z.y + push"},
            "ports": {"inputs": {"push": {"signal": "push"}}},
            "sweep": {"along": "kp", "kp": {"start": 50, "stop": 900}, "require": {"margins": {"cut": "c.y", margin: size}}},
        }
    )


def worst(kp, factors):
    """The largest eigenvalue of frames with any of some factors."""
    plant = expm(np.array([[0, 1, 0], [0, -D / M, 1 / M], [0, 0, 0]]) * N * T)
    frames = np.zeros((len(factors), 3, 3), complex)
    frames[:, :2] = plant[:2]
    frames[:, 2, :2] = -factors[:, None] * kp * np.array([1, TD])
    return np.abs(np.linalg.eigvals(frames)).max()


TURNS = np.exp(1j * np.linspace(0, np.pi, 2001))
FACTORS = {
    "gain": (2.0, np.geomspace(0.5, 2.0, 501)),
    "phase_deg": (40.0, np.exp(1j * np.radians(np.linspace(0, 40, 501)))),
    "disk": (0.5, (1 + 0.25 * TURNS) / (1 - 0.25 * TURNS)),
    "Ms": (2.0, 1 / (1 - TURNS / 2)),
}


@pytest.mark.slow
@pytest.mark.parametrize("margin", list(FACTORS))
def test_stretches_that_are_told_have_the_margin_or_have_it_nowhere(margin):
    """And they leave less than a millionth of an end open."""
    size, factors = FACTORS[margin]
    span = 50.0, 900.0
    edges = np.linspace(*span, 40)
    spec = spec_of(margin, size)
    loops = Loops(spec.drawing, dict(spec.values))
    told = ByForms(loops, "numbers.kp", "c.y", margin, size, span).told(0, edges[:-1], edges[1:])
    good = [(low, high) for low, high, label in told if label == GOOD]
    bad = [(low, high) for low, high, label in told if label == BAD and low < high]
    assert len(good) == 1
    assert bad
    for low, high in good:
        assert max(worst(kp, factors) for kp in np.linspace(low, high, 20)) < 1
    for low, high in bad:
        assert min(worst(kp, factors) for kp in np.linspace(low, high, 20)[1:-1]) > 1
    assert min(low for low, _ in bad) - good[0][1] <= 1e-6 * good[0][1]


@pytest.mark.slow
@pytest.mark.parametrize(("margin", "judge"), [("phase_deg", Factors), ("Ms", Between)])
def test_intervals_are_the_same_if_forms_are_asked_at_once(margin, judge, monkeypatch):
    size, _ = FACTORS[margin]
    rows = intervals(spec_of(margin, size), jobs=1).columns
    asked = []
    told = ByForms.told
    monkeypatch.setattr(ByForms, "told", lambda self, *panels: asked.append(margin) or told(self, *panels))
    monkeypatch.setattr(judge, "struggles", lambda self, tried: tried > 0)  # noqa: ARG005
    with_forms = intervals(spec_of(margin, size), jobs=1).columns
    assert asked
    assert with_forms["certified"].all()
    assert rows["certified"].all()
    for end in ("low", "high"):
        assert np.allclose(with_forms[end], rows[end], rtol=2e-7, atol=0)
