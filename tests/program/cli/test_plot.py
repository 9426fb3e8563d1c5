"""`wavesweep plot`: the figure of a table again, in every format; and figures of every command."""

import json
import os
import shutil

import pyarrow.parquet
import pytest

pytestmark = pytest.mark.slow

SPEC = """[controller]
kind = "pmw"
[sweep]
K_VE = { start = 0, stop = 4000 }
B_VE = [0.5, 1.0, 2.0]
b = [20, 40]
[bode]
frequency_hz = [0, 1, 5, 20]
b = [20, 40]
[simulate]
frequency_hz = 2
duration_s = 0.5
"""
COMMANDS = {
    "zwidth": ("zwidth",),
    "stability-region": ("stability-region",),
    "bode": ("bode",),
    "passivity": ("passivity",),
    "simulate": ("simulate",),
    "passivity-filters": ("passivity", "--filters"),
    "why": ("why",),
    "margins": ("margins", "--cut", "avatar.out"),
}
FORMATS = ("--format", "png", "--format", "svg", "--format", "pdf")


@pytest.fixture
def wavesweep(wavesweep):
    """The command line, which takes paths as well."""
    return lambda *words: wavesweep(*map(str, words))


@pytest.fixture
def spec(tmp_path):
    """The path of a small spec."""
    path = tmp_path / "small.toml"
    path.write_text(SPEC)
    return path


@pytest.mark.whole
@pytest.mark.sample(1)
@pytest.mark.parametrize("kind", COMMANDS)
def test_the_figure_again_from_either_table_has_the_same_bytes(wavesweep, spec, tmp_path, kind):
    made = tmp_path / "made"
    command, *options = COMMANDS[kind]
    assert wavesweep(command, spec, *options, "--out", made)[0] == 0
    package = json.loads((made / f"{kind}.datapackage.json").read_text())
    for table in (made / f"{kind}.csv", made / f"{kind}.parquet"):
        out = tmp_path / table.suffix[1:]
        formats = FORMATS if table.suffix == ".csv" else ()
        assert wavesweep("plot", table, *formats, "--out", out)[0] == 0
        assert (out / f"{kind}.png").read_bytes() == (made / f"{kind}.png").read_bytes()
        assert {path.suffix for path in out.iterdir()} == {".png", *([".svg", ".pdf"] if formats else [])}
    names = [resource["name"] for resource in package["resources"]]
    assert names == [f"{kind}-{form}" for form in ("csv", "parquet", "png")]


@pytest.mark.whole
def test_a_new_figure_beside_the_table_is_entered_in_the_package(wavesweep, spec, tmp_path):
    wavesweep("zwidth", spec, "--no-plot", "--out", tmp_path)
    assert wavesweep("plot", tmp_path / "zwidth.csv", "--format", "svg")[0] == 0
    package = json.loads((tmp_path / "zwidth.datapackage.json").read_text())
    assert package["resources"][-1]["path"] == "zwidth.svg"
    assert package["resources"][-1]["bytes"] == (tmp_path / "zwidth.svg").stat().st_size
    assert wavesweep("plot", tmp_path / "zwidth.csv", "--format", "svg", "--quiet")[0] == 0
    assert json.loads((tmp_path / "zwidth.datapackage.json").read_text()) == package


def spoilt(made, case):
    """The path of a table that cannot be drawn, and a part of the message."""
    table = made / "zwidth.csv"
    if case == "missing":
        return made / "none.csv", "found no such file"
    if case == "alone":
        shutil.copy(table, made.parent / "alone.csv")
        return made.parent / "alone.csv", "data package"
    if case == "torn":
        table.write_bytes(table.read_bytes()[:-40])
        return table, "torn or was changed"
    if case == "torn parquet":
        parquet = made / "zwidth.parquet"
        parquet.write_bytes(parquet.read_bytes()[:-40])
        return parquet, "cannot be read"
    if case == "other program":
        import pyarrow
        import pyarrow.parquet

        pyarrow.parquet.write_table(pyarrow.table({"x": [1.0]}), made / "other.parquet")
        return made / "other.parquet", "no facts"
    (made / "table.txt").write_text("x")
    return made / "table.txt", "expected .csv or .parquet"


@pytest.mark.whole
@pytest.mark.parametrize("case", ["missing", "alone", "torn", "torn parquet", "other program", "other suffix"])
def test_bad_tables_get_one_line(wavesweep, spec, tmp_path, case):
    wavesweep("zwidth", spec, "--no-plot", "--out", tmp_path / "made")
    table, message = spoilt(tmp_path / "made", case)
    code, out, err = wavesweep("plot", table)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not table.with_suffix(".png").exists()


@pytest.mark.whole
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")  # which matplotlib's own sums say before they fail
@pytest.mark.parametrize(
    ("name", "value"), [("channel_norm", 1e308), ("spec_name", ["x"])], ids=["a number", "a fact that is no text"]
)
def test_a_table_with_what_cannot_be_drawn_is_refused(wavesweep, spec, tmp_path, name, value):
    kind = "passivity" if name == "channel_norm" else "zwidth"
    wavesweep(kind, spec, "--no-plot", "--out", tmp_path)
    path = tmp_path / f"{kind}.parquet"
    table = pyarrow.parquet.read_table(path)
    if name in table.column_names:
        changed = pyarrow.array([value] * table.num_rows)
        table = table.set_column(table.column_names.index(name), name, changed)
    else:
        (key,) = [key for key in table.schema.metadata if b"wavesweep" in key]
        facts = json.loads(table.schema.metadata[key]) | {name: value}
        table = table.replace_schema_metadata(table.schema.metadata | {key: json.dumps(facts).encode()})
    pyarrow.parquet.write_table(table, path)
    code, _, err = wavesweep("plot", path, "--out", tmp_path / "figures")
    assert (code, len(err.strip().splitlines())) == (2, 1)
    assert "expected numbers and facts that can be drawn" in err


@pytest.mark.whole
@pytest.mark.sample(7)
@pytest.mark.parametrize("thing", ["pipe", "folder", "link to nothing", "link to a file"])
@pytest.mark.parametrize(
    "words",
    [
        ["init", "--overwrite", "--out", "taken"],
        ["explore", "SPEC", "--overwrite", "--save", "taken"],
        ["plot", "made/zwidth.csv", "--out", "figures"],
        ["check", "SPEC", "--plot", "--out", "figures"],
        ["export", "SPEC", "--overwrite", "--out", "figures"],
    ],
    ids=lambda words: words[0],
)
def test_nothing_but_a_file_is_replaced(wavesweep, spec, tmp_path, monkeypatch, thing, words):
    monkeypatch.chdir(tmp_path)
    if words[0] == "plot":
        assert wavesweep("zwidth", spec, "--no-plot", "--out", "made")[0] == 0
    names = {"plot": "figures/zwidth.png", "check": "figures/diagram.png", "export": "figures/Makefile"}
    place = tmp_path / names.get(words[0], "taken")
    place.parent.mkdir(exist_ok=True)
    (tmp_path / "mine.txt").write_text("mine")
    if thing == "pipe":
        os.mkfifo(place)
    elif thing == "folder":
        place.mkdir()
    else:
        place.symlink_to(tmp_path / ("nowhere" if thing == "link to nothing" else "mine.txt"))
    before = place.lstat()
    code, out, err = wavesweep(*(spec if word == "SPEC" else word for word in words))
    assert (code, out) == (2, "")
    assert f"{place.name}: expected a file or none, found a {thing.split()[0]}" in err
    assert place.lstat() == before
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert sorted(each.name for each in place.parent.iterdir() if each.name.startswith(".")) == []


@pytest.mark.whole
def test_columns_that_other_programs_have_moved_or_added_change_no_figure(wavesweep, spec, tmp_path):
    assert wavesweep("zwidth", spec, "--out", tmp_path / "made")[0] == 0
    table = pyarrow.parquet.read_table(tmp_path / "made/zwidth.parquet")
    changed = table.select(table.column_names[::-1]).add_column(0, "note", [["theirs"] * len(table)])
    pyarrow.parquet.write_table(changed.replace_schema_metadata(table.schema.metadata), tmp_path / "zwidth.parquet")
    assert wavesweep("plot", tmp_path / "zwidth.parquet", "--out", tmp_path / "again")[0] == 0
    assert (tmp_path / "again/zwidth.png").read_bytes() == (tmp_path / "made/zwidth.png").read_bytes()


@pytest.mark.whole
def test_a_table_without_rows_is_refused(wavesweep, spec, tmp_path):
    assert wavesweep("zwidth", spec, "--no-plot", "--out", tmp_path / "made")[0] == 0
    pyarrow.parquet.write_table(
        pyarrow.parquet.read_table(tmp_path / "made/zwidth.parquet").slice(0, 0), tmp_path / "zwidth.parquet"
    )
    code, _, err = wavesweep("plot", tmp_path / "zwidth.parquet")
    assert code == 2
    assert err.endswith("zwidth.parquet: expected the rows of a table, found none\n")
