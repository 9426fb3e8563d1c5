"""The facts of a run stand in the Parquet file and in the data package."""

import hashlib
import json
import re

import pyarrow.parquet
import pytest

from wavesweep.program.results import publish
from wavesweep.program.results.folder import changes
from wavesweep.program.tables.table import Table


@pytest.fixture
def package(columns, facts, tmp_path):
    publish(Table.of("zwidth", columns, facts), tmp_path)
    return json.loads((tmp_path / "zwidth.datapackage.json").read_text())


def test_the_package_vouches_for_both_files(package, tmp_path):
    assert [resource["path"] for resource in package["resources"]] == ["zwidth.csv", "zwidth.parquet"]
    for resource in package["resources"]:
        content = (tmp_path / resource["path"]).read_bytes()
        assert resource["bytes"] == len(content)
        assert resource["hash"] == f"sha256:{hashlib.sha256(content).hexdigest()}"


def test_the_package_keeps_frictionless_rules(package, columns):
    names = [package["name"], *(resource["name"] for resource in package["resources"])]
    assert all(re.fullmatch(r"[-a-z0-9._/]+", name) for name in names)
    assert len(set(names)) == len(names)
    for resource in package["resources"]:
        assert resource["schema"]["missingValues"] == [""]
        assert [field["name"] for field in resource["schema"]["fields"]] == list(columns)
        for field in resource["schema"]["fields"]:
            assert field["type"] in {"number", "integer", "boolean", "string"}
            assert field["description"]
            assert "unit" in field


def test_the_facts_are_in_both_places_but_what_differs_between_equal_runs_only_in_the_package(columns, facts, tmp_path):
    of_the_run = {"timings": {"total": 0.5}, "warnings": ["a damaged file"], "spec_place": "cd" * 32}
    publish(Table.of("zwidth", columns, facts | of_the_run), tmp_path)
    package = json.loads((tmp_path / "zwidth.datapackage.json").read_text())
    assert package["wavesweep"] == facts | of_the_run
    stored = json.loads(pyarrow.parquet.read_schema(tmp_path / "zwidth.parquet").metadata[b"wavesweep"])
    assert stored == {name: fact for name, fact in facts.items() if name not in of_the_run}


def test_every_parquet_field_has_its_unit(package, tmp_path):
    schema = pyarrow.parquet.read_schema(tmp_path / "zwidth.parquet")
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert units["B_VE"] == "N*s/m"
    assert units["low"] == units["high"] == "N/m"
    assert units["environment.delay"] == "tick"
    described = {field["name"]: field["unit"] for field in package["resources"][0]["schema"]["fields"]}
    assert described == units


@pytest.mark.parametrize(
    ("before", "now", "text"),
    [
        ({}, {"b": [10.0, 20.0]}, ["sweep.b not given -> [10, 20]"]),
        ({"b": [10.0]}, {}, ["sweep.b [10] -> not given"]),
        (
            {"b": {"start": 1.0, "stop": 9.0}},
            {"b": {"start": 1.0, "stop": 8.0, "num": 3}},
            ["sweep.b.stop 9 -> 8", "sweep.b.num not given -> 3"],
        ),
        ({"b": {"start": 1.0, "stop": 9.0}}, {"b": {"start": 1.0, "stop": 9.0}}, []),
    ],
)
def test_each_changed_part_of_an_axis_is_a_change(before, now, text):
    facts = [{"spec": {"sweep": axes}} for axes in (before, now)]
    assert changes(*facts) == text
    several = [{"specs": {"mine": each["spec"]}} for each in facts]
    assert changes(*several) == [f"mine: {each}" for each in text]
