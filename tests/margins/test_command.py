"""`wavesweep margins` from the spec to its files and its words."""

import json
import re
from dataclasses import replace
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


def test_one_margin_in_doubt_leaves_the_others_certified(arm, monkeypatch):
    """A report said "not known" above gain and phase that are certified."""
    from wavesweep.engine.doubts import Doubt
    from wavesweep.margins import lifted_margins, table
    from wavesweep.program.analyses.claim_words import known_in_words
    from wavesweep.program.analyses.claims import Claim
    from wavesweep.program.spec import load

    found = lifted_margins.margins_of

    def with_doubt(names):
        def crowded(loop):
            margins, doubt = found(loop)
            return [replace(each, doubt=Doubt.CROWDED) if each.name in names else each for each in margins], doubt

        return crowded

    for names, known in (
        (("disk",), "certified, but for what a line says is not"),
        (tuple(table.UNITS) + MARGINS, "not known"),
    ):
        monkeypatch.setattr(lifted_margins, "margins_of", with_doubt(names))
        facts = table.margins(load(arm), "camera.y").facts
        said = known_in_words([Claim.read(facts["claims"]["spec"])])
        assert said == f"Margins with the spec's own numbers: {known}."


@pytest.mark.parametrize(("cut", "used"), [("camera.y", {"pencil"}), ("arm.v", {"rim of a disk"})])
def test_the_methods_of_a_table_are_those_that_were_used(arm, cut, used):
    from wavesweep.margins.table import margins
    from wavesweep.program.spec import load

    said = margins(load(arm), cut).facts["methods"]["margins"]
    assert {word for word in ("pencil", "dead time", "rim of a disk") if word in said} == used


MARGINS = ("gain_up", "gain_down", "phase", "delay", "disk", "disk_gain", "disk_phase", "sensitivity", "complementary")
