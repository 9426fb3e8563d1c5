"""The CSV of every kind of table, read without an option by programs that users have, holds what the Parquet file does."""

from contextlib import closing

import numpy as np
import pytest
from click.testing import CliRunner

from wavesweep.program import results
from wavesweep.program.results import fields, publish, read
from wavesweep.program.tables import kinds
from wavesweep.program.tables.table import Table

TEXTS = ["", "rounding", 'b = 3, "slow"', "grün", "two, of them"]
SOME = [0.0, -0.0, 1.0, 0.5, 1e10, -9999999999.0, 1e-7, 5e-324, 1.7976931348623157e308, 1 / 3, 2.0**53, 1234567.0, 0.00001]


def made(kind, rows, seed=3):
    """Columns of all that this kind of table may have; the first row has no gaps, from which readers guess types."""
    rng, given = np.random.default_rng(seed), {}
    for field in fields(kind, ["b"], extra=[each.name for each in kinds()[kind].fields]):
        numbers = np.where(
            rng.random(rows) < 0.5, rng.choice(SOME, rows), rng.normal(size=rows) * 10.0 ** rng.integers(-9, 9, rows)
        )
        numbers[1:] = np.where(rng.random(rows - 1) < 0.3, np.nan, numbers[1:])
        words = np.array(rng.choice(TEXTS, rows), object)
        words[0] = "first"
        column = {"number": numbers, "integer": rng.integers(0, 40, rows), "boolean": rng.random(rows) < 0.5, "string": words}
        given[field.name] = column[field.kind]
    return given | ({"along": np.full(rows, "K_VE", object)} if "along" in given else {})


def pandas_columns(path):
    table = pytest.importorskip("pandas").read_csv(path)
    return {name: [None if each != each else each for each in table[name].tolist()] for name in table}  # noqa: PLR0124 - NaN


def polars_columns(path):
    return pytest.importorskip("polars").read_csv(path).to_dict(as_series=False)


def duckdb_columns(path):
    found = pytest.importorskip("duckdb").read_csv(str(path))
    return dict(zip(found.columns, map(list, zip(*found.fetchall(), strict=True)), strict=True))


def sqlite_columns(path):
    commands = pytest.importorskip("sqlite_utils.cli").cli
    import sqlite3

    words = ["insert", path.with_suffix(".db"), "t", path, "--csv", "--empty-null"]
    CliRunner().invoke(commands, [*map(str, words)], catch_exceptions=False)
    with closing(sqlite3.connect(path.with_suffix(".db"))) as database:
        found = database.execute("SELECT * FROM t ORDER BY rowid")
        names = [each[0] for each in found.description]
        return dict(zip(names, map(list, zip(*found.fetchall(), strict=True)), strict=True))


READERS = [pandas_columns, polars_columns, duckdb_columns, sqlite_columns]


def assert_same(found, expected):
    """All values are equal; a missing number and an empty text are both nothing, 1 and 0 are true and false."""
    assert list(found) == list(expected)
    for name, column in expected.items():
        if column.dtype == object:
            assert [each or "" for each in found[name]] == column.tolist(), name
            continue
        given = [np.nan if each is None else float(each) for each in found[name]]
        assert np.array_equal(given, column.astype(float), equal_nan=True), name


@pytest.mark.sample(25)
@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("kind", [name for name, kind in kinds().items() if kind.fields])
def test_every_table_is_read_right_without_an_option(kind, reader, facts, tmp_path):
    publish(Table.of(kind, made(kind, 60), facts), tmp_path)
    assert_same(reader(tmp_path / f"{kind}.csv"), read(tmp_path / f"{kind}.parquet"))


def test_no_name_of_a_column_is_a_word_of_sql():
    import sqlite3

    names = {field.name for kind in kinds().values() for field in kind.fields}
    with closing(sqlite3.connect(":memory:")) as database:
        for name in names:
            database.execute(f"SELECT {name} FROM (SELECT 1 AS '{name}')")  # noqa: S608 - names of our own
    duckdb = pytest.importorskip("duckdb")
    words = "SELECT keyword_name FROM duckdb_keywords() WHERE keyword_category = 'reserved'"
    assert names & {word for (word,) in duckdb.sql(words).fetchall()} == set()


@pytest.mark.slow
@pytest.mark.parametrize("power", [*range(-12, 20), 300])
def test_every_number_has_a_point_or_an_exponent(power, facts, tmp_path):
    """The bounds of Arrow's own way to write whole numbers, on both sides."""
    values = np.array([10.0**power, -(10.0**power), 10.0**power - 1, 10.0**power + 1, np.nan, 0.0])
    columns = {"slope": values, "other": np.resize([1.0, np.nan], 6)}
    own = tuple(results.Field(name, "number", "1", name) for name in columns)
    publish(Table.of("own", columns, facts, fields=own), tmp_path)
    lines = (tmp_path / "own.csv").read_text().splitlines()[1:]
    for line, value in zip(lines, values, strict=True):
        cell = line.split(",")[0]
        assert cell == "" if np.isnan(value) else float(cell) == value and ("." in cell or "e" in cell)
