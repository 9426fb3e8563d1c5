"""What is written reads back to the same bits, from both files and with the tools that users have."""

import csv
import struct

import numpy as np
import pytest

from wavesweep.program import results
from wavesweep.program.results import publish
from wavesweep.program.tables.table import Table


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_both_files_read_back_to_the_same_bits(columns, facts, same, tmp_path, suffix):
    publish(Table.of("zwidth", columns, facts), tmp_path)
    same(results.read(tmp_path / f"zwidth.{suffix}"), columns)


def test_any_finite_double_survives_the_csv(columns, facts, tmp_path):
    bits = np.random.default_rng(1).integers(0, 2**64, 20_000, dtype=np.uint64)
    values = bits.view(np.float64)[np.isfinite(bits.view(np.float64))]
    table = {name: np.resize(column, len(values)) for name, column in columns.items()} | {"low": values}
    publish(Table.of("zwidth", table, facts), tmp_path)
    assert results.read(tmp_path / "zwidth.csv")["low"].tobytes() == values.tobytes()
    with (tmp_path / "zwidth.csv").open(newline="", encoding="utf-8") as file:
        python = [float(row["low"]) for row in csv.DictReader(file)]
    assert struct.pack(f"{len(python)}d", *python) == values.tobytes()


def test_the_text_is_what_the_contract_says(columns, facts, tmp_path):
    publish(Table.of("zwidth", columns, facts), tmp_path)
    text = (tmp_path / "zwidth.csv").read_bytes()
    header, *lines, end = text.decode("ascii").split("\n")
    assert header == ",".join(columns)
    assert end == ""
    assert b"\r" not in text
    assert b'"' not in text
    assert (
        lines[3] == "20000.0,3,K_VE,0,0,9.007199254740992e+15,20000.0,,3.0,0,1e-16,rounding,"
        "9.007199254740992e+15,9.007199254740992e+15,1.0,1.0,1,1.0,1.0,"
    )
    assert lines[4] == "-0.0,4,K_VE,1,0,1e+15,-0.0,,4.0,1,1e-16,,1e+15,1e+15,1.0,1.0,1,1.0,1.0,"


@pytest.mark.parametrize("stem", ["a,b", 'say "hi"', "two\nlines", "123", "NaN", "grün"])
def test_a_spec_with_an_awkward_name_reads_back(stem, tmp_path, facts):
    fields = results.fields("bode")
    values = {"number": 1.5, "boolean": True, "string": stem}
    columns = {
        field.name: np.array([values[field.kind]] * 2, dtype=object if field.kind == "string" else None) for field in fields
    }
    publish(Table.of("bode", columns, facts), tmp_path)
    for suffix in ("csv", "parquet"):
        assert results.read(tmp_path / f"bode.{suffix}")["spec"].tolist() == [stem, stem]
    with (tmp_path / "bode.csv").open(newline="", encoding="utf-8") as file:
        assert [row["spec"] for row in csv.DictReader(file)] == [stem, stem]


def test_a_table_of_its_own_kind_reads_back_by_the_package_beside_it(facts, same, tmp_path):
    fields = tuple(results.Field(name, kind, "1", name) for name, kind in (("slope", "number"), ("island", "boolean")))
    columns = {"slope": np.array([1.0, 2.0, -0.0]), "island": np.array([True, False, True])}
    publish(Table.of("own", columns, facts, fields=fields), tmp_path)
    same(results.read(tmp_path / "own.csv"), columns)
    (tmp_path / "own.datapackage.json").write_text("torn")
    assert results.read(tmp_path / "own.csv")["island"].tolist() == [1, 0, 1]


def test_texts_come_back_from_parquet_as_they_were(tmp_path):
    """Repeated ones, in several row groups, and missing ones of another program."""
    import pyarrow
    import pyarrow.parquet

    texts = ["", "a", "a", "b,c", "\u00e9", "a"] * 3 + ["z"]
    for written in (texts, [*texts, None]):
        table = pyarrow.table({"doubt": pyarrow.array(written)})
        pyarrow.parquet.write_table(table, tmp_path / "t.parquet", row_group_size=4)
        found = results.read(tmp_path / "t.parquet")["doubt"]
        assert found.dtype == object
        assert found.tolist() == written
