"""The commands on a drawn loop with inputs and outputs and no hand."""

import json

import pytest
from support.drawn import DRIVE, NETWORK, WALL

from wavesweep.program.cli import main


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
@pytest.mark.whole
def test_check_lists_the_pairs(run):
    code, text, _ = run("check", "drive.toml", "--all")
    assert (code, "bode: 8 curves (ref to speed, " in text, "passivity: not possible" in text) == (0, True, True)
    code, text, _ = run("check", "drive.toml", "--out", "there")
    assert (code, "--out: expected --plot" in text) == (2, True)


@pytest.mark.whole
def test_the_facts_of_a_run_name_the_input(run):
    code, text, _ = run("simulate", "drive.toml", "--set", "simulate.from=load", "--no-plot", "--json")
    summary = json.loads(text)["tables"]["simulate"]
    assert (code, summary["from"], summary["energy"]) == (0, "load", None)
    assert summary["outputs"]["speed"]["settles_at"] == 0
