"""The paper's specs: complete, marked, in agreement with each other, and part of what is installed."""

import tomllib
from pathlib import Path

import pytest

from wavesweep.errors import UsageError
from wavesweep.paper import specs
from wavesweep.tables.intervals import intervals
from wavesweep.tables.responses import responses

ROOT = Path(__file__).parents[2]
NAMES = sorted(path.stem for path in (ROOT / "sweeps" / "paper").glob("*.toml"))
PAPERS = {
    "rates.fast_hz": 1000.0,
    "rates.ratio": 20,
    "device.mass": 0.1,
    "device.damping": 1.5,
    "environment.K_VE": 500.0,
    "environment.B_VE": 1.0,
}


@pytest.mark.parametrize("name", NAMES)
def test_a_spec_says_what_is_the_papers_and_what_is_inferred(name):
    text = (specs.folder() / f"{name}.toml").read_text(encoding="utf-8")
    assert "The paper's own:" in text
    assert "Inferred" in text


@pytest.mark.sample(4)
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_spec_has_the_papers_values_and_serves_the_sweeping_commands(name):
    spec = specs.load_paper(name)
    assert {path: spec.values[path] for path in PAPERS} == PAPERS
    assert len(intervals(spec, along="K_VE").columns["high"]) > 0
    assert len(intervals(spec).columns["high"]) > 0
    assert responses([spec]).columns["admittance_abs"].min() > 0


def test_the_loops_of_one_section_are_the_same():
    six, seven, eight, pmw, two = (specs.load_paper(name).values for name in ("fig6", "fig7", "fig8", "pmw", "fig2"))
    five = specs.load_paper("fig5").values
    assert dict(six) == dict(seven) == dict(eight) == {**five, "controller.Kp": 20.0}
    read_by_both = [path for path in pmw if not path.startswith(("controller.k", "controller.K"))]
    assert [path for path in read_by_both if pmw[path] != six[path]] == []
    assert dict(two) == dict(pmw)
    explicit = specs.load_paper("fig5-explicit").values
    assert dict(explicit) == {**five, "environment.integration": "explicit"}


def test_every_spec_is_part_of_the_wheel():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    included = project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    examples = {
        f"sweeps/examples/{path.name}": f"wavesweep/examples/{path.name}"
        for path in (ROOT / "sweeps" / "examples").glob("*.toml")
    }
    assert included == {f"sweeps/paper/{name}.toml": f"wavesweep/paper/toml/{name}.toml" for name in NAMES} | examples


def test_specs_of_an_installed_package_go_first_and_none_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(specs, "__file__", str(tmp_path / "wavesweep" / "paper" / "specs.py"))
    with pytest.raises(UsageError, match="the paper's specs: expected them in"):
        specs.folder()
    for place in ("sweeps/paper", "wavesweep/paper/toml"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "fig4.toml").touch()
        assert specs.folder() == tmp_path / place
