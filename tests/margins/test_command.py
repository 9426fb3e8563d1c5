"""`wavesweep margins` from the spec to its files and its words."""

import json
import re
from pathlib import Path

import pytest

from wavesweep.program import results

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def arm(tmp_path, monkeypatch):
    """The drawn loop of the page on a first drawing."""
    monkeypatch.chdir(tmp_path)
    page = (DOCS / "first-drawing.md").read_text(encoding="utf-8")
    Path("arm.toml").write_text(re.search(r"```toml\n(# arm\.toml.*?)```", page, re.DOTALL).group(1), encoding="utf-8")
    return "arm.toml"


@pytest.mark.slow
def test_a_row_for_each_margin_in_files_with_a_figure(wavesweep, arm):
    code, out, _ = wavesweep("margins", arm, "--cut", "camera.y", "--json")
    assert code == 0
    found = json.loads(out)["tables"]["margins"]
    rows = results.read(Path("results/arm/margins.csv"))
    assert rows["margin"].tolist() == list(found["margins"])
    assert Path("results/arm/margins.png").exists()
    assert rows["certified"].all()
    assert rows["value"][rows["margin"] == "gain_down"].tolist() == [0]
    assert rows["margin"][~rows["limited"]].tolist() == ["gain_down"]
    assert wavesweep("verify", "results/arm")[0] == 0
