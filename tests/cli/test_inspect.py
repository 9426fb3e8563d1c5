"""`wavesweep inspect`: what a table has, without opening it in another program."""

import json

import numpy as np
import pandas
import pytest

from wavesweep.core.results import publish
from wavesweep.core.spec import load
from wavesweep.core.tables.intervals import intervals

SPEC = {"controller": {"kind": "pmw"}, "sweep": {"K_VE": {"start": 0, "stop": 2000}, "B_VE": [0.5, 1.0, 2.0]}}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder results/wall in the current one with a table of two intervals and one without any, in doubt."""
    monkeypatch.chdir(tmp_path)
    table = intervals(load(SPEC))
    columns = {name: values.copy() for name, values in table.columns.items()}
    columns["low"][2], columns["certified"][2], columns["doubt"][2] = np.nan, False, "search"
    publish(table.of("zwidth", columns, table.facts), tmp_path / "results" / "wall", False, ())
    return tmp_path / "results" / "wall"


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("asked", ["wall", "results/wall", "results/wall/zwidth.parquet", "results/wall/zwidth.csv"])
def test_a_table_is_found_by_its_path_its_folder_or_the_name_of_the_spec(asked, wavesweep):
    code, out, _ = wavesweep("inspect", asked, "--json")
    (table,) = json.loads(out)["tables"].values()
    columns = {each["name"]: each for each in table["columns"]}
    assert (code, table["kind"], table["rows"], table["doubts"]) == (0, "zwidth", 3, {"search": 1})
    assert columns["B_VE"] | {"description": ""} == {
        "name": "B_VE",
        "unit": "N*s/m",
        "kind": "number",
        "description": "",
        "missing": 0,
        "least": 0.5,
        "largest": 2.0,
    }
    assert (columns["low"]["missing"], columns["certified"]["true"], columns["doubt"]["different"]) == (1, 2, 2)
    assert table["facts"]["spec_sha256"] == load(SPEC).sha256
    out = wavesweep("inspect", asked)[1]
    assert "3 rows; in doubt: search 1" in out
    assert "N*s/m" in out


def test_a_folder_without_results_is_refused(tmp_path, wavesweep):
    code, out, err = wavesweep("inspect", str(tmp_path))
    assert (code, out) == (2, "")
    assert "found none" in err


def test_pandas_has_the_units_of_a_parquet_file(folder):
    units = pandas.read_parquet(folder / "zwidth.parquet").attrs["units"]
    assert (units["B_VE"], units["high"], units["along"]) == ("N*s/m", "N/m", "")
