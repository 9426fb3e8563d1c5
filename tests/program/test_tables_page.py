"""The page on other programs: each of its examples gives the same three numbers."""

import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

from wavesweep.program import results
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals

PAGE = (pathlib.Path(__file__).parents[2] / "docs" / "tables.md").read_text(encoding="utf-8")
# Two slices with an interval, whose ends have different numbers of digits, one without: that is what the traps are about.
SPEC = {
    "controller": {"kind": "dc-slow"},
    "environment": {"delay": 10},
    "sweep": {"K_VE": {"start": 0, "stop": 20000}, "B_VE": [1.0, 12.0, 20.0]},
}
EXPECTED = [124.0499027569, 80.78186538087, 1]


def blocks(title, language):
    """The examples under a heading."""
    section = PAGE.split(f"\n### {title}\n", 1)[1].split("\n### ", 1)[0]
    return re.findall(rf"```{language}\n(.*?)```", section, re.DOTALL)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A table, in the folder that the examples run in."""
    results.publish(intervals(load(SPEC), "K_VE"), tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def printed(text):
    return [float(number) for number in re.findall(r"[\d.]+(?:e-?\d+)?", text)]


@pytest.mark.parametrize(("title", "number"), [("pandas", 0), ("pandas", 1), ("polars", 0)])
@pytest.mark.usefixtures("folder")
def test_python_examples(title, number, capsys):
    exec(blocks(title, "python")[number], {})  # noqa: S102 - the document's own code
    assert printed(capsys.readouterr().out) == pytest.approx(EXPECTED, rel=1e-13)


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.usefixtures("folder")
def test_duckdb_examples(number):
    import duckdb

    assert list(duckdb.sql(blocks("DuckDB", "sql")[number]).fetchall()[0]) == pytest.approx(EXPECTED, rel=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("title", ["SQLite", "sqlite-utils and datasette"])
def test_shell_examples(title, folder):
    if title == "SQLite" and shutil.which("sqlite3") is None:
        pytest.skip("no sqlite3 on this machine")
    programs = folder / "programs"
    programs.mkdir()
    (programs / "sqlite-utils").write_text(f'#!/bin/sh\nexec {sys.executable} -W ignore -m sqlite_utils "$@"\n')
    (programs / "sqlite-utils").chmod(0o755)
    path = {"PATH": f"{programs}:{os.environ['PATH']}"}
    words = ["sh", "-ec", blocks(title, "sh")[0]]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=os.environ | path)
    assert printed(done.stdout) == pytest.approx(EXPECTED, rel=1e-12)


def test_a_program_that_takes_the_csv_apart_by_the_rule_for_octave_finds_the_numbers(folder):
    """The regular expression of that example, in a table whose texts have commas."""
    pattern = re.search(r"regexp \(\[line \",\"\], '(.*?)', \"match\"\)", PAGE)[1]
    row = '0.5,"b = 3, c = ""4""",,1'
    assert [match[0][:-1] for match in re.finditer(pattern, row + ",")] == ["0.5", '"b = 3, c = ""4"""', "", "1"]
    lines = (folder / "zwidth.csv").read_text().strip().split("\n")
    assert {len(re.findall(pattern, line + ",")) for line in lines} == {len(lines[0].split(","))}
