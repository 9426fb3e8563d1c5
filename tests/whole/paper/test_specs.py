"""The paper's specs: complete, marked, in agreement with each other, and part of what is installed."""

from pathlib import Path

import pytest

from reproduce.specs import load_paper
from wavesweep.engine.errors import UsageError
from wavesweep.program import bundled
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.response_table import responses

ROOT = Path(__file__).parents[3]
NAMES = sorted(path.stem for path in (ROOT / "sweeps" / "paper").glob("*.toml"))
PAPERS = {
    "rates.fast_hz": 1000.0,
    "rates.ratio": 20,
    "device.mass": 0.1,
    "device.damping": 1.5,
    "environment.K_VE": 500.0,
    "environment.B_VE": 1.0,
}


@pytest.mark.sample(4)
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_spec_has_the_papers_values_and_serves_the_sweeping_commands(name):
    spec = load_paper(name)
    assert {path: spec.values[path] for path in PAPERS} == PAPERS
    assert len(intervals(spec, along="K_VE").columns["high"]) > 0
    assert len(intervals(spec).columns["high"]) > 0
    assert responses([spec]).columns["admittance_abs"].min() > 0


def test_the_loops_of_one_section_are_the_same():
    six, seven, eight, pmw, two = (load_paper(name).values for name in ("fig6", "fig7", "fig8", "pmw", "fig2"))
    five = load_paper("fig5").values
    assert dict(six) == dict(seven) == dict(eight) == {**five, "controller.Kp": 20.0}
    read_by_both = [path for path in pmw if not path.startswith(("controller.k", "controller.K"))]
    assert [path for path in read_by_both if pmw[path] != six[path]] == []
    assert dict(two) == dict(pmw)
    explicit = load_paper("fig5-explicit").values
    assert dict(explicit) == {**five, "environment.integration": "explicit"}


def test_what_is_inside_an_installed_package_goes_first_and_nothing_anywhere_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(bundled, "__file__", str(tmp_path / "wavesweep" / "core" / "bundled.py"))
    with pytest.raises(UsageError, match="sweeps/paper: expected it in"):
        bundled.bundled("sweeps/paper")
    for place in ("sweeps/paper", "wavesweep/_bundled/sweeps/paper"):
        (tmp_path / place).mkdir(parents=True)
        assert bundled.bundled("sweeps/paper") == tmp_path / place
