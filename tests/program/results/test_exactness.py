"""What is written reads back to the same bits, from both files and with the tools that users have."""

import csv
import os
import struct
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program import results
from wavesweep.program.results import publish
from wavesweep.program.results import table_files as files
from wavesweep.program.tables.table import Table


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_both_files_read_back_to_the_same_bits(columns, facts, same, tmp_path, suffix):
    publish(Table.of("zwidth", columns, facts), tmp_path)
    same(results.read(tmp_path / f"zwidth.{suffix}"), columns)


@pytest.mark.parametrize("name", ["s3:", os.fsdecode(b"d\xff")])
def test_a_folder_may_have_any_name(name, columns, facts, same, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    publish(Table.of("zwidth", columns, facts), name)
    for suffix in ("csv", "parquet"):
        found = results.read(f"{name}/zwidth.{suffix}")
        same(found, columns)
    assert files.read_rows(Path(name) / "zwidth.parquet", 1, 3)["low"].size == 2


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
        "9.007199254740992e+15,9.007199254740992e+15,1.0,1.0,1,1.0,1.0"
    )
    assert lines[4] == "-0.0,4,K_VE,1,0,1e+15,-0.0,,4.0,1,1e-16,,1e+15,1e+15,1.0,1.0,1,1.0,1.0"


def test_pandas_reads_what_we_write(columns, facts, tmp_path):
    import pandas

    publish(Table.of("zwidth", columns, facts), tmp_path)
    frame = pandas.read_csv(tmp_path / "zwidth.csv")
    assert list(frame.columns) == list(columns)
    assert frame["high"].dtype == np.float64
    assert frame["certified"].tolist() == columns["certified"].astype(int).tolist()
    assert np.array_equal(frame["high"].to_numpy(), columns["high"], equal_nan=True)
    assert pyarrow.parquet.read_table(tmp_path / "zwidth.parquet")["high"].null_count == np.isnan(columns["high"]).sum()
    stored = pandas.read_parquet(tmp_path / "zwidth.parquet")
    assert np.array_equal(stored["high"].to_numpy(), columns["high"], equal_nan=True)
    assert stored["certified"].dtype == bool


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


def test_a_name_that_is_no_unicode_is_refused(columns, facts, tmp_path):
    columns["along"][2] = "\udc80"
    fields = results.fields_of("zwidth", {**columns, "along": ["K_VE"]})
    with pytest.raises(WavesweepError, match="cannot be written as UTF-8"):
        publish(Table.of("zwidth", columns, facts, fields=fields), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_table_of_its_own_kind_reads_back_by_the_package_beside_it(facts, same, tmp_path):
    fields = tuple(results.Field(name, kind, "1", name) for name, kind in (("slope", "number"), ("island", "boolean")))
    columns = {"slope": np.array([1.0, 2.0, -0.0]), "island": np.array([True, False, True])}
    publish(Table.of("own", columns, facts, fields=fields), tmp_path)
    same(results.read(tmp_path / "own.csv"), columns)
    (tmp_path / "own.datapackage.json").write_text("torn")
    assert results.read(tmp_path / "own.csv")["island"].tolist() == [1, 0, 1]


def test_columns_in_chunks_and_slices_read_as_arrow_gives_them():
    numbers = [1.5, None, float("nan"), -0.0, 5e-324] * 5
    flags, whole = [True, False, False, True, True] * 5, [2**62, 0, -1, 3, 4] * 5
    for values, kind in ((numbers, pyarrow.float64()), (flags, pyarrow.bool_()), (whole, pyarrow.int64())):
        column = pyarrow.chunked_array([pyarrow.array(values, kind).slice(first, 6) for first in (0, 3, 9, 25)])
        found = files._numpy(column)
        expected = column.to_numpy()
        assert found.dtype == expected.dtype
        assert found.tobytes() == expected.tobytes() or np.array_equal(found, expected, equal_nan=True)
        assert files._numpy(pyarrow.chunked_array([], kind)).size == 0
    lacking = files._numpy(pyarrow.chunked_array([pyarrow.array([1, None, 3], pyarrow.int64())]))
    assert np.array_equal(lacking, [1, np.nan, 3], equal_nan=True)
    assert files._numpy(pyarrow.chunked_array([pyarrow.array([1.5], pyarrow.float32())])).tolist() == [1.5]


def test_a_file_of_another_kind_is_refused(tmp_path):
    with pytest.raises(UsageError, match=r"found the suffix '\.txt', expected \.csv or \.parquet"):
        results.read(tmp_path / "zwidth.txt")


def test_a_table_in_another_encoding_is_refused_in_a_sentence(tmp_path):
    (tmp_path / "zwidth.csv").write_bytes("größe,B_VE\n1,2\n".encode("latin-1"))
    with pytest.raises(UsageError, match=r"zwidth\.csv: expected a whole table, found a file .* can't decode byte"):
        results.read(tmp_path / "zwidth.csv")


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
