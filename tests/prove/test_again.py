"""Certified rows proved again, by `verify --prove`."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from wavesweep.program import results
from wavesweep.program.analyses.interval_jobs import job_of, searches_of
from wavesweep.program.cli import main
from wavesweep.program.results import publish
from wavesweep.program.spec import load
from wavesweep.program.sweep.job import cut_otherwise
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.table import Table
from wavesweep.prove.again import prove_again

SWEEPS = Path(__file__).parents[2] / "sweeps"


@pytest.mark.slow
def test_certified_rows_are_proved_again_and_false_ones_are_refuted(tmp_path, capfd):
    folder = str(tmp_path)
    publish(intervals(load(SWEEPS / "paper" / "fig4.toml"), "K_VE", jobs=1), tmp_path)
    assert main(["verify", folder, "--prove", "--json"]) == 0
    confirmed = {"table": str(tmp_path / "zwidth.parquet"), "certified": 151, "proved_again": 20, "whole": 20}
    assert json.loads(capfd.readouterr().out)["proved"] == [confirmed | {"ends": 0, "unsettled": 0, "refuted": 0}]
    columns, facts = (
        results.read(tmp_path / "zwidth.parquet"),
        json.loads((tmp_path / "zwidth.datapackage.json").read_text())["wavesweep"],
    )
    true, factors = columns["high"], np.ones(len(columns["high"]))
    factors[[0, -1]] = 1.001, 100
    publish(Table.of("zwidth", columns | {"high": true * factors}, facts), tmp_path)
    assert main(["verify", folder, "--prove", "7"]) == 1
    out, err = capfd.readouterr()
    assert "7 of 151 certified slices proved again in ball arithmetic: 5 confirmed on the whole range" in out
    refuted = "is certified, but ball arithmetic refutes it"
    assert f"row 1 {refuted}, high is {str(true[0])[:12]}" in err
    assert f" and not {true[0].item() * 1.001!r}; unless the file was changed, this is a fault of wavesweep" in err
    assert f"row 151 {refuted}, its ends are not in order within 0.0 and " in err
    assert main(["verify", "--prove", folder]) == 2
    assert "--prove: expected a number of slices from 1 on, or none behind DIR, found " in capfd.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("recipe", "wires", "operations", "change", "verdict"),
    [
        ("batch-reactor", {}, 1e8, 1, "whole"),
        ("batch-reactor", {}, 3e6, 1, "ends"),  # the whole range takes more
        ("batch-reactor", {}, 3e6, 1.001, "refuted"),
        ("batch-reactor", {}, 1e4, 1, "unsettled"),
        ("current-loop", {}, 1e8, 1, "whole"),  # with dead times
        ("current-loop", {}, 1e8, 1.001, "refuted"),
        ("current-loop", {"pwm.u": "pi.y - 0.1*motor.y"}, 1e8, 1, "unsettled"),  # a plant that is sampled for itself
    ],
)
def test_a_slice_is_proved_on_the_whole_range_or_about_its_ends(recipe, wires, operations, change, verdict):
    tables = tomllib.loads((SWEEPS / "recipes" / f"{recipe}.toml").read_text(encoding="utf-8"))
    job = cut_otherwise(job_of(load(tables | {"wire": tables["wire"] | wires})), deep=1, wide=1)
    (search,), (row,) = searches_of(job, job.chunks[1]).searches, job.task(job.chunks[1])()
    claim = row["low"].item(), row["high"].item() * change, row["low_omega"].item(), row["high_omega"].item()
    assert prove_again(search, [claim], operations).verdict == verdict
