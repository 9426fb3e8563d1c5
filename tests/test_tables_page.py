"""The page on other programs: each of its examples gives the same three numbers."""

import pathlib
import re
import shutil
import subprocess

import pytest

from wavesweep import results
from wavesweep.spec import load
from wavesweep.tables.intervals import intervals

PAGE = (pathlib.Path(__file__).parents[1] / "wavesweep" / "TABLES.md").read_text(encoding="utf-8")
# Two slices with an interval, whose ends have different numbers of digits, one without: that is what the traps are about.
SPEC = {
    "controller": {"kind": "dc-slow"},
    "environment": {"delay": 10},
    "sweep": {"K_VE": {"start": 0, "stop": 20000}, "B_VE": [1.0, 12.0, 20.0]},
}
EXPECTED = [124.0499027569, 80.78186538087, 1]


def blocks(title, language):
    """The examples under a heading."""
    section = PAGE.split(f"\n## {title}\n", 1)[1].split("\n## ", 1)[0]
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
    pytest.importorskip(title)
    exec(blocks(title, "python")[number], {})  # noqa: S102 - the document's own code
    assert printed(capsys.readouterr().out) == pytest.approx(EXPECTED, rel=1e-13)


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.usefixtures("folder")
def test_duckdb_examples(number):
    duckdb = pytest.importorskip("duckdb")
    assert list(duckdb.sql(blocks("DuckDB", "sql")[number]).fetchall()[0]) == pytest.approx(EXPECTED, rel=1e-13)


@pytest.mark.usefixtures("folder")
def test_the_sqlite_example():
    if shutil.which("sqlite3") is None:
        pytest.skip("no sqlite3 on this machine")
    done = subprocess.run(["sh", "-c", blocks("SQLite", "sh")[0]], capture_output=True, text=True, check=True)  # noqa: S607
    assert printed(done.stdout) == pytest.approx(EXPECTED, rel=1e-12)


def test_the_csv_has_the_traps_that_the_page_is_about(folder):
    text = (folder / "zwidth.csv").read_text()
    assert "NaN,NaN" in text
    assert ",," in text
