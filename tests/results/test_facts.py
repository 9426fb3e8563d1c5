"""The facts of a run stand in the Parquet file and in the data package."""

import hashlib
import json
import re

import pyarrow.parquet
import pytest

from wavesweep import results
from wavesweep.results import publish
from wavesweep.sweep import Table


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
        assert resource["schema"]["missingValues"] == ["NaN"]
        assert [field["name"] for field in resource["schema"]["fields"]] == list(columns)
        for field in resource["schema"]["fields"]:
            assert field["type"] in {"number", "integer", "boolean", "string"}
            assert field["description"]
            assert "unit" in field


def test_the_facts_are_in_both_places_but_timings_only_in_the_package(package, facts, tmp_path):
    assert package["wavesweep"] == facts
    stored = json.loads(pyarrow.parquet.read_schema(tmp_path / "zwidth.parquet").metadata[b"wavesweep"])
    assert stored == {name: fact for name, fact in facts.items() if name != "timings"}


def test_every_parquet_field_has_its_unit(package, tmp_path):
    schema = pyarrow.parquet.read_schema(tmp_path / "zwidth.parquet")
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert units["B_VE"] == "N*s/m"
    assert units["low"] == units["high"] == "N/m"
    assert units["environment.delay"] == "tick"
    described = {field["name"]: field["unit"] for field in package["resources"][0]["schema"]["fields"]}
    assert described == units


def test_the_ends_have_the_unit_of_their_axis():
    units = {field.name: field.unit for field in results.fields("stability-region", ["B_VE"], along="b")}
    assert units["low"] == units["high"] == "N*s/m"
