"""The delay margin in seconds, against marches of a mass whose force arrives between two samples."""

import numpy as np
import pytest
from meaning.reading import radius_of

from wavesweep.margins.table import margins
from wavesweep.program.spec import load

PERIOD = 0.02  # s


def spring(k, d=2.0, **more):
    """A mass on a spring and a damper whose force is computed once in 20 ms."""
    block = {"m": {"type": "mass", "mass": 0.1, "damping": 1.0}, "c": {"type": "hold", "every": 20}}
    wire = {"c.u": f"-{k}*m.x - {d}*m.v", "m.f": "c.y"}
    return {"rates": {"tick_hz": 1000}, "block": block | more.get("block", {}), "wire": wire | more.get("wire", {})}


def radius(k, dead_time):
    """The spectral radius with the force late by so much, by the documents' own reading."""
    late = {"block": {"late": {"type": "delay", "seconds": float(dead_time)}}, "wire": {"late.u": "c.y", "m.f": "late.y"}}
    return radius_of(spring(k, **late), 0)


@pytest.mark.slow
@pytest.mark.parametrize(("k", "ms"), [(100.0, 16.118), (250.0, 1.793), (70.0, None)])
def test_a_force_on_a_mass_may_be_late_by_a_dead_time_and_not_by_the_phase_over_the_crossover(k, ms):
    columns = margins(load(spring(k)), "c.y").columns
    row = columns["margin"].tolist().index("delay")
    value = columns["value"][row]
    assert (columns["unit"][row], columns["certified"][row]) == ("s", True)
    assert radius(k, 0.0) < 1
    assert radius(k, value * (1 - 1e-6)) < 1 < radius(k, value * (1 + 1e-6))
    assert max(radius(k, share * value) for share in np.linspace(0.0, 0.999, 200)) < 1
    assert "delay_frames" not in columns["margin"].tolist()
    if ms is None:
        assert value > PERIOD
    else:
        assert 1e3 * value == pytest.approx(ms, abs=1e-3)


def test_a_signal_that_a_sampled_block_reads_has_a_margin_of_whole_frames():
    more = {"block": {"out": {"type": "hold", "every": 20}}, "wire": {"out.u": "c.y", "m.f": "out.y"}}
    found = margins(load(spring(100.0, **more)), "c.y").columns
    row = found["margin"].tolist().index("delay_frames")
    assert (found["unit"][row], found["limited"][row]) == ("frame", True)
    assert found["value"][row] == pytest.approx(0.0163956 / PERIOD, rel=1e-5)
    assert "delay" not in found["margin"].tolist()
    assert radius(100.0, PERIOD) > 1


def integrator(K):
    """A held gain before an integrator, once in 1 ms."""
    block = {"plant": {"type": "tf", "num": [1], "den": [1, 0]}, "c": {"type": "gain", "k": K}}
    wire = {"c.u": "-plant.y", "plant.u": "c.y"}
    return {"rates": {"tick_hz": 1000}, "block": block, "wire": wire}


def test_an_integrator_alone_has_a_delay_margin_or_a_sentence_says_why_not():
    """With a dead time of n T + e: z^(n + 1) (z - 1) + K (T - e) z + K e = 0."""
    table = margins(load(integrator(500.0)), "c.y")
    row = table.columns["margin"].tolist().index("delay")
    value = table.columns["value"][row]
    for share, stable in ((1 - 1e-6, True), (1 + 1e-6, False)):
        n, e = divmod(share * value, 1e-3)
        roots = np.roots([1, -1, *[0] * (int(n) - 1), 500 * (1e-3 - e), 500 * e])
        assert (np.abs(roots).max() < 1) == stable
    assert not [said for said in table.facts["notices"] if "delay" in said]


def test_a_delay_margin_that_is_not_found_is_told(monkeypatch):
    monkeypatch.setattr("wavesweep.margins.dead_time_margin.MOST_WORK", 10.0)
    table = margins(load(integrator(20.0)), "c.y")
    assert "delay" not in table.columns["margin"].tolist()
    assert [said for said in table.facts["notices"] if "no delay margin" in said]
