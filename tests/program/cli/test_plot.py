"""`wavesweep plot`: the figure of a table again, in every format; and figures of every command."""

import json
import os
import shutil

import pytest

pytestmark = pytest.mark.slow

SPEC = """[controller]
kind = "pmw"
[sweep]
K_VE = { start = 0, stop = 4000 }
B_VE = [0.5, 1.0, 2.0]
b = [20, 40]
"""
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
def test_the_figure_again_from_either_table_has_the_same_bytes(wavesweep, spec, tmp_path):
    made = tmp_path / "made"
    assert wavesweep("zwidth", spec, "--out", made)[0] == 0
    package = json.loads((made / "zwidth.datapackage.json").read_text())
    for table in (made / "zwidth.csv", made / "zwidth.parquet"):
        out = tmp_path / table.suffix[1:]
        formats = FORMATS if table.suffix == ".csv" else ()
        assert wavesweep("plot", table, *formats, "--out", out)[0] == 0
        assert (out / "zwidth.png").read_bytes() == (made / "zwidth.png").read_bytes()
        assert {path.suffix for path in out.iterdir()} == {".png", *([".svg", ".pdf"] if formats else [])}
    names = [resource["name"] for resource in package["resources"]]
    assert names == [f"zwidth-{form}" for form in ("csv", "parquet", "png")]


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
@pytest.mark.sample(7)
@pytest.mark.parametrize("thing", ["pipe", "folder", "link to nothing", "link to a file"])
@pytest.mark.parametrize(
    "words",
    [
        ["init", "--overwrite", "--out", "taken"],
        ["explore", "SPEC", "--overwrite", "--save", "taken.html"],
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
    names = {
        "explore": "taken.html",
        "plot": "figures/zwidth.png",
        "check": "figures/diagram.png",
        "export": "figures/Makefile",
    }
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
