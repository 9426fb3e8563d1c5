"""`--prove`: the rows of columns in doubt are replaced, and the facts of the table say how many."""

import json

import pytest

from wavesweep.cli import main
from wavesweep.results.verify import verify
from wavesweep.spec import load
from wavesweep.tables.intervals import intervals

SPEC = """
[rates]
tick_hz = 1000.0
[numbers]
p = 1.0
q = 1.0
[block.g]
type = "ss"
discrete = true
A = [[-0.5, 2.25, 0.0], [0.0, 1.0, 0.0], [-2.9999999999999982, 4.499999999999999, 0.9999999999999991]]
B = [[0.5], [0.0], [1.0]]
C = [[3.125, -2.25, -0.75]]
D = [[0.0]]
[wire]
"g.u" = "-p*q*g.y"
[sweep]
along = "p"
p = { start = 0.2, stop = 0.4 }
q = [0.3, 0.4]
"""


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder of a run with proofs."""
    folder = tmp_path_factory.mktemp("proved")
    (folder / "mine.toml").write_text(SPEC)
    command = ["stability-region", str(folder / "mine.toml"), "--out", str(folder), "--no-plot", "--quiet"]
    assert main([*command, "--prove"]) == 0
    return folder


def test_the_facts_say_how_many_columns_are_proved_and_how(written):
    facts = json.loads((written / "stability-region.datapackage.json").read_text())["wavesweep"]
    assert (facts["proved"]["in_doubt"], facts["proved"]["columns"]) == (2, 2)
    assert sum(facts["proved"]["bits"].values()) == sum(facts["proved"]["ways"].values()) == 2
    assert facts["slices"]["certified"] == 2
    assert any("2 of 2 columns in doubt are proved" in notice for notice in facts["notices"])


def test_the_rows_have_the_usual_columns_and_are_certified(written):
    lines = (written / "stability-region.csv").read_text().splitlines()
    assert lines[0].startswith("q,along,intervals,interval,low,high,low_omega,high_omega,certified,residual,doubt")
    assert [line.split(",")[8] for line in lines[1:]] == ["1", "1"]


def test_rows_are_proved_again_if_they_are_verified(written):
    assert verify(written).differences == ()


def test_a_table_without_proofs_has_no_facts_about_them(tmp_path):
    table = intervals(load(_file(tmp_path)), jobs=1)
    assert "proved" not in table.facts
    assert not table.columns["certified"].any()


def _file(folder):
    (folder / "mine.toml").write_text(SPEC)
    return folder / "mine.toml"


def test_a_controller_is_proved_as_well():
    tables = {"controller": {"kind": "pmw"}, "sweep": {"K_VE": {"start": 0, "stop": 2000}, "B_VE": [1]}}
    table = intervals(load(tables), "K_VE", prove=True, jobs=1)
    assert table.columns["certified"].all()
    assert "proved" in table.facts
