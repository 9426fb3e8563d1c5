"""The benchmark runs, and its errors and counts are what they must be; its run times are nobody's business here."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import bench
from bench.stiffness import COMMAND, LIBRARY
from wavesweep.program import results


def rows(run, **wanted):
    chosen = np.logical_and.reduce([run.columns[name] == value for name, value in wanted.items()])
    return {name: column[chosen] for name, column in run.columns.items()}


@pytest.mark.slow
def test_this_tool_finds_every_interval_to_rounding(quick):
    for method in (LIBRARY, COMMAND):
        seen = rows(quick, part="stiffness", method=method)
        assert (seen["found"] == seen["there"]).all()
        assert (seen["wrong"] == 0).all()
        assert (seen["error_max"] < 1e-12).all()


def test_a_grid_is_as_good_as_its_step_and_bisection_misses_the_hole(quick):
    grid = rows(quick, part="stiffness", method="numpy, batched grid")
    assert 1e-3 < grid["error_max"][0] < 0.3  # half a step of 6000/25 N/m over stiffnesses from 400 N/m on
    search = rows(quick, part="stiffness", method="bisection, all columns at once")
    assert search["wrong"][0] > 0
    assert search["found"][0] < search["there"][0]


def test_all_responses_agree_and_this_tools_is_the_best(quick):
    seen = rows(quick, part="response")
    assert (seen["error_max"] < 1e-6).all()
    assert (seen["error_max"][:2] < 1e-11).all()


def test_the_program_writes_and_draws_what_was_measured(quick, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(os, "environ", dict(os.environ))
    from bench.__main__ import main

    monkeypatch.setattr(bench, "measure", lambda *, quick, run=quick: run if quick else None)
    main(["--quick", "--out", str(tmp_path / "out")])
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"bench.csv", "bench.parquet", "bench.datapackage.json", "bench.png"}
    back = results.read(tmp_path / "out/bench.parquet")
    assert list(back) == [field.name for field in bench.FIELDS]
    assert "this tool finds" in capsys.readouterr().out


def test_the_threads_are_limited_before_numpy_is_loaded():
    program = (
        "import os, runpy, sys\n"
        "class Watch:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'numpy':\n"
        "            print(os.environ.get('OPENBLAS_NUM_THREADS'))\n"
        "            sys.exit(0)\n"
        "sys.meta_path.insert(0, Watch())\n"
        f"runpy.run_path({str(Path(bench.__file__).parent)!r}, run_name='__main__')\n"
    )
    inherited = {name: value for name, value in os.environ.items() if not name.endswith("_THREADS")}
    done = subprocess.run([sys.executable, "-c", program], env=inherited, capture_output=True, text=True, check=True)
    assert done.stdout == "1\n"


def promises():
    """(quantity, condition) -> what the document promises."""
    found = {}
    for line in (Path(__file__).parents[3] / "docs" / "accuracy.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| ") and len(cells) <= 3 and re.fullmatch(r"1e-\d+", cells[-1]):
            for quantity in cells[0].split(" and ") if len(cells) == 3 else ["end of a stable interval"]:
                found[quantity, cells[-2]] = float(cells[-1])
    return found


def test_the_document_promises_what_is_measured(quick):
    seen = rows(quick, part="accuracy")
    measured = dict(zip(zip(seen["problem"], seen["setting"], strict=True), seen["error_max"], strict=True))
    promised = promises()
    assert promised.keys() == measured.keys()
    assert {case: error for case, error in measured.items() if not error <= promised[case]} == {}
