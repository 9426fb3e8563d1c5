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


@pytest.mark.asks("check")
def test_check_says_that_a_model_does_not_explain_limits(wavesweep, tmp_path):
    spec_of(tmp_path, "z_width", "B_VE,K_VE\n" + 3 * "0,1000\n0,1200\n2,3500\n")
    lines = wavesweep("check", str(tmp_path / "mine.toml"), "--all")[1].splitlines()
    start = next(number for number, line in enumerate(lines) if "measured limits" in line)
    assert lines[start : start + 4] == [
        (
            "  measured limits (points.csv): computed over measured is 2.51 in the median, 3.01 at worst, at B_VE = 0 N*s/m "
            "(3008 for"
        ),
        "      1000 N/m)",
        "    of 9 limits the model promises more than was measured, the dangerous side, at 9, by 201 % at most",
        "    the model does not explain them: 2561 N/m rms, 213 % of their median; repeated limits scatter by 92.6 N/m",
    ]


@pytest.mark.parametrize("command", ["zwidth", "bode", pytest.param("check", marks=pytest.mark.asks("check"))])
def test_a_file_that_cannot_be_used_ends_a_command_before_its_work(command, wavesweep, sweep, tmp_path, monkeypatch):
    spec_of(tmp_path, "response" if command == "bode" else "z_width", "B_VE\n1\n")
    monkeypatch.chdir(tmp_path)
    code, out, err = wavesweep(command, "mine.toml")
    assert (code, out, err.count("\n"), sweep.seen) == (2, "", 1, [])
    assert err.startswith("Error: points.csv: expected")
    assert not (tmp_path / "results").exists()
