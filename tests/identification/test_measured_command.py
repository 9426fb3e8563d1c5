"""Measured points at the command line: the lines of `check`, refusals before any work, and figures from stored tables."""

import json
from pathlib import Path

import pytest

from tests.identification.test_points import spec_of

EXAMPLES = Path(__file__).parents[2] / "sweeps" / "examples"
BENCH = str(EXAMPLES / "bench.toml")
TRUE = [word for each in ("device.mass=0.09", "device.damping=1.1", "environment.delay=2") for word in ("--set", each)]


@pytest.mark.asks("check")
@pytest.mark.slow
def test_runs_of_the_simulation_are_on_the_right_side_of_the_boundary_of_the_same_device(wavesweep):
    found = json.loads(wavesweep("check", BENCH, *TRUE, "--json")[1])["verdict"]["measured"]
    assert (found["tried"]["count"], found["tried"]["wrong"]) == (42, 0)
    assert found["response"]["worst"]["ratio"] == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("command", ["zwidth", "bode", pytest.param("check", marks=pytest.mark.asks("check"))])
def test_a_file_that_cannot_be_used_ends_a_command_before_its_work(command, wavesweep, sweep, tmp_path, monkeypatch):
    spec_of(tmp_path, "response" if command == "bode" else "z_width", "B_VE\n1\n")
    monkeypatch.chdir(tmp_path)
    code, out, err = wavesweep(command, "mine.toml")
    assert (code, out, err.count("\n"), sweep.seen) == (2, "", 1, [])
    assert err.startswith("Error: points.csv: expected")
    assert not (tmp_path / "results").exists()
