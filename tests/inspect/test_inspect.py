"""`wavesweep inspect`: what a table has, without opening it in another program."""

import json
import os
import random
import re
import shutil
from contextlib import suppress

import numpy as np
import pandas
import pyarrow.parquet
import pytest

from wavesweep.engine.errors import UsageError
from wavesweep.program.results import publish, read, read_table
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals

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
    assert columns["doubt"]["missing"] == 2
    assert table["facts"]["spec_sha256"] == load(SPEC).sha256
    out = wavesweep("inspect", asked)[1]
    assert "3 rows; in doubt: search 1" in out
    assert "N*s/m" in out
    assert re.search(r"along +1 different  ", out)
    assert re.search(r"doubt +1 different, 2 missing  ", out)


@pytest.mark.usefixtures("folder")
def test_plot_says_which_tables_a_folder_has(wavesweep):
    code, _, err = wavesweep("plot", "results/wall")
    assert (code, err) == (
        2,
        "Error: results/wall: expected the CSV or Parquet file of a table, found a folder, with zwidth.parquet\n",
    )


def test_a_folder_without_results_is_refused(tmp_path, wavesweep):
    code, out, err = wavesweep("inspect", str(tmp_path))
    assert (code, out) == (2, "")
    assert "found none" in err


@pytest.mark.parametrize("command", ["inspect", "verify"])
def test_a_name_that_is_too_long_is_a_mistake_of_the_command_line(command, wavesweep):
    code, out, err = wavesweep(command, "a" * 300 + ".csv")
    assert (code, out) == (2, "")
    # From Python 3.13 on there just is no such file.
    assert err.rstrip().endswith(("; choose another name", "found none"))


def test_pandas_has_the_units_of_a_parquet_file(folder):
    units = pandas.read_parquet(folder / "zwidth.parquet").attrs["units"]
    assert (units["B_VE"], units["high"], units["along"]) == ("N*s/m", "N/m", "")


def changed(folder, change):
    """The Parquet table with a change of its rows, or of the text of its facts."""
    place = folder / "zwidth.parquet"
    table = pyarrow.parquet.read_table(place)
    facts = table.schema.metadata[b"wavesweep"].decode()
    made = change(table, facts)
    made = table.replace_schema_metadata({"wavesweep": made}) if isinstance(made, str) else made
    pyarrow.parquet.write_table(made, place)
    return str(place)


def without(facts, name, value):
    return json.dumps(json.loads(facts) | {name: value})


CHANGES = {
    "a column dropped": lambda table, _: table.drop_columns(["interval"]),
    "many dropped": lambda table, _: table.select(["B_VE", "low", "high"]),
    "an unknown column": lambda table, _: table.append_column("strange", table.column("low")),
    "deep facts": lambda _, facts: facts[:-1] + ', "deep": ' + "[" * 100_000 + "]" * 100_000 + "}",
    "no table for facts": lambda *_: "[1, 2]",
    "a list for the spec": lambda _, facts: without(facts, "spec", [1]),
    "a number for its blocks": lambda _, facts: without(facts, "spec", {"block": 3}),
    "a block without a type": lambda _, facts: without(facts, "spec", {"block": {"a": {}}}),
    "a text for its ports": lambda _, facts: without(facts, "spec", {"ports": "x"}),
    "a text for units": lambda _, facts: without(facts, "unlike_units", "x"),
}


@pytest.mark.sample(8)
@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("command", ["inspect", "plot"])
def test_a_table_that_is_not_whole_is_refused_in_a_line(change, command, folder, wavesweep):
    code, out, err = wavesweep(command, changed(folder, CHANGES[change]))
    if change == "an unknown column":  # of another program, which is left out
        assert code == 0
    else:
        assert (code, out, err.count("\n")) == (2, "", 1), err
        assert "zwidth.parquet: expected" in err


def test_a_foreign_table_of_many_rows_is_refused_before_they_are_read(folder, wavesweep, monkeypatch):
    monkeypatch.setattr("wavesweep.program.results.table_files._read_parquet", lambda _: pytest.fail("the rows were read"))
    code, _, err = wavesweep("inspect", changed(folder, lambda table, _: table.select(["low"])))
    assert (code, "expected a whole table zwidth, found none with " in err) == (2, True)


@pytest.mark.slow
def test_a_package_that_lists_its_files_again_and_again_is_answered_by_a_screen(folder, wavesweep, monkeypatch):
    from wavesweep.program.results import verification

    package, hashed = folder / "zwidth.datapackage.json", []
    content = json.loads(package.read_text())
    again = [entry | {"path": f"{start}{entry['path']}"} for entry in content["resources"] for start in ("", "./", "x/../")]
    package.write_text(
        json.dumps(content | {"resources": again + [each | {"path": f"./{n}"} for n in range(500) for each in again]})
    )
    taken = verification.file_facts
    monkeypatch.setattr(verification, "file_facts", lambda path: hashed.append(path) or taken(path))
    code, _, err = wavesweep("verify", str(folder))
    assert (code, len(hashed)) == (1, 2)
    assert f"{500 * (len(again) - 1)} of its files are listed again" in err
    assert err.count("\n") < 60


@pytest.mark.slow
@pytest.mark.asks("designs")
def test_the_columns_of_a_design_study_are_those_that_its_files_describe(tmp_path, monkeypatch, wavesweep):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(
        '[controller]\nkind = "pmw"\n[design]\npopulation = 8\ngenerations = 1\n[design.vary]\nb = { start = 5, stop = 50 }\n'
        "[design.wish]\nz_width = { B_VE = [1] }\n"
    )
    assert wavesweep("design", "mine.toml", "--no-plot", "--out", "here")[0] == 0
    for name in ("here/design.csv", "here/design.parquet"):
        code, out, _ = wavesweep("inspect", name, "--json")
        (table,) = json.loads(out)["tables"].values()
        described = {column["name"]: (column["unit"], column["kind"]) for column in table["columns"]}
        assert (code, table["kind"]) == (0, "design")
        assert (
            described.items() >= {"b": ("N*s/m", "number"), "z_width": ("N/m", "number"), "certified": ("", "boolean")}.items()
        )


HOSTILE = [None, True, 0, -1, 1.5, 1e308, float("nan"), 10**30, "", "x", "a\0b", "\ud800", "../x", "\u2028", [], {}, [[]], [{}]]


def places_in(value, above=()):
    """The place of each value in a tree of JSON."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for name, each in inner:
        yield (*above, name)
        yield from places_in(each, (*above, name))


def damage(rng, content):
    """Put another value in the place of one, or leave it out; places near the root are as likely as all others."""
    deepest = rng.choice([1, 2, 3, 9])
    *above, last = rng.choice([place for place in places_in(content) if len(place) <= deepest])
    for name in above:
        content = content[name]
    if rng.random() < 0.3:
        del content[last]
    else:
        content[last] = rng.choice(HOSTILE)


@pytest.mark.slow
def test_a_damaged_package_or_schema_is_told_as_such_by_all_that_reads_it(folder, tmp_path, wavesweep):
    """WAVESWEEP_FUZZ=2000 in the environment asks for so many tries in place of the sample."""
    rng, refused = random.Random(2), 0  # noqa: S311 - a fixed sample, no secret
    whole = shutil.copytree(folder, tmp_path / "whole")
    for number in range(int(os.environ.get("WAVESWEEP_FUZZ", "12"))):
        shutil.rmtree(folder)
        shutil.copytree(whole, folder)
        package, parquet = folder / "zwidth.datapackage.json", folder / "zwidth.parquet"
        if number % 2:
            content = json.loads(package.read_text())
            damage(rng, content)
            package.write_text(json.dumps(content))
        else:
            table = pyarrow.parquet.read_table(parquet)
            facts = json.loads(table.schema.metadata[b"wavesweep"])
            damage(rng, facts)
            pyarrow.parquet.write_table(table.replace_schema_metadata({"wavesweep": json.dumps(facts)}), parquet)
        path = str(rng.choice([parquet, folder / "zwidth.csv"]))
        for reads in (read, read_table):
            with suppress(UsageError):
                reads(path)
        words = rng.choice([("inspect", path), ("inspect", "wall"), ("plot", path), ("verify", str(folder))])
        code, _, err = wavesweep(*words)
        assert code in (0, 1, 2), err
        assert "fault of wavesweep" not in err
        refused += code > 0
    assert refused
