"""The commands on a drawn loop with inputs and outputs and no hand."""

import json

import pytest
from support.drawn import DRIVE, NETWORK, WALL

from wavesweep.program.cli import main
from wavesweep.program.results import read


@pytest.fixture
def run(tmp_path, monkeypatch, capfd):
    """Run a command in a new folder with specs; give the exit code, what was printed, and the folder."""
    monkeypatch.chdir(tmp_path)
    for name, text in (("drive", DRIVE), ("network", NETWORK), ("wall", WALL)):
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")

    def run(*arguments):
        return main([*arguments]), "".join(capfd.readouterr()), tmp_path / "results" / "drive"

    return run


@pytest.mark.slow
@pytest.mark.thorough
def test_bode_writes_the_responses_of_all_pairs_and_replaces_those_of_the_hand(run):
    code, text, results = run("bode", "drive.toml", "--set", "bode.frequency_hz=[1, 20]", "--out", "results/drive")
    assert (code, "8 curves of 2 frequencies" in text) == (0, True)
    assert sorted(path.suffix for path in results.glob("bode-ports.*")) == [".csv", ".json", ".parquet", ".png"]
    columns = read(results / "bode-ports.csv")
    assert columns["unit"][columns["to_output"] == "twice"].tolist() == [""] * 4
    other = ("--set", "bode.frequency_hz=[1, 30]", "--set", "bode.to=speed", "--out", "results/drive")
    code, text, _ = run("bode", "drive.toml", *other, "--no-plot")
    assert (code, "changed: bode.to all -> speed" in text.replace('"', "")) == (0, True), text
    assert {*read(results / "bode-ports.csv")["to_output"]} == {"speed"}
    code, text, _ = run("verify", str(results))
    assert code == 0, text


@pytest.mark.slow
@pytest.mark.whole
def test_check_draws_a_root_locus_and_lists_the_pairs(run):
    code, text, results = run("check", "drive.toml", "--root-locus", "kp", "--all")
    assert (code, "bode: 8 curves (ref to speed, " in text, "passivity: not possible" in text) == (0, True, True)
    assert [path.name for path in results.iterdir()] == ["root-locus.png"]
    code, text, _ = run("check", "drive.toml", "--root-locus", "kq")
    assert (code, "kq: expected the name of a numeric key" in text) == (2, True)
    code, text, _ = run("check", "drive.toml", "--out", "there")
    assert (code, "--out: expected --plot or --root-locus" in text) == (2, True)


@pytest.mark.whole
def test_the_facts_of_a_run_name_the_input(run):
    code, text, _ = run("simulate", "drive.toml", "--set", "simulate.from=load", "--no-plot", "--json")
    summary = json.loads(text)["tables"]["simulate"]
    assert (code, summary["from"], summary["energy"]) == (0, "load", None)
    assert summary["outputs"]["speed"]["settles_at"] == 0
