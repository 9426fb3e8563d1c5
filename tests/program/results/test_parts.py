"""A table in parts: a folder of Parquet files that reads as one table, put in place and verified as a single file is."""

import json

import numpy as np
import pyarrow.parquet
import pytest

from wavesweep.engine.errors import UsageError
from wavesweep.program import results
from wavesweep.program.cli import main
from wavesweep.program.results import publish
from wavesweep.program.results import table_writing as writing_module
from wavesweep.program.results.verification import verify
from wavesweep.program.tables.table import Table

SPEC = """
[controller]
kind = "pmw"
[sweep]
along = "K_VE"
K_VE = { start = 0, stop = 20000 }
B_VE = { start = 0, stop = 5, num = 6 }
Kp = [0.0, 20.0]
[bode]
frequency_hz = [1.0, 10.0]
b = [20.0, 40.0, 80.0]
"""


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(SPEC)
    return tmp_path


def run(*arguments):
    assert main([*arguments, "--quiet"]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("command", ["zwidth"])
def test_parts_read_as_the_single_file_does(home, same, command):
    import pandas

    run(command, "mine.toml", "--out", "one")
    run(command, "mine.toml", "--out", "parts", "--partition", "5")
    whole, folder = results.read(home / f"one/{command}.parquet"), home / f"parts/{command}.parquet"
    rows = len(next(iter(whole.values())))
    assert [path.name for path in sorted(folder.iterdir())] == [f"part-{n:05d}.parquet" for n in range(-(-rows // 5))]
    assert not (home / f"parts/{command}.csv").exists()
    assert (home / f"parts/{command}.png").read_bytes() == (home / f"one/{command}.png").read_bytes()
    same(results.read(folder), whole)
    same(results.read_table(folder)[1], whole)
    pandas.testing.assert_frame_equal(pandas.read_parquet(folder), pandas.read_parquet(home / f"one/{command}.parquet"))
    entries = json.loads((home / f"parts/{command}.datapackage.json").read_text())["resources"]
    assert [entry["path"] for entry in entries[:-1]] == [f"{command}.parquet/{path.name}" for path in sorted(folder.iterdir())]
    found = verify(home / "parts")
    assert found.differences == ()
    assert len(found.checked) == 2
    (home / f"parts/{command}.png").unlink()
    assert main(["plot", f"parts/{command}.parquet/"]) == 0
    assert (home / f"parts/{command}.png").read_bytes() == (home / f"one/{command}.png").read_bytes()


def test_a_folder_with_files_of_somebody_else_is_no_table_in_parts(home, capfd):
    run("bode", "mine.toml", "--out", "o", "--no-plot", "--partition", "4")
    (home / "o/bode.parquet/notes.txt").write_text("mine")
    assert main(["bode", "mine.toml", "--out", "o", "--no-plot", "--overwrite"]) == 2
    assert "expected a file of results or none, found a folder" in capfd.readouterr().err
    assert (home / "o/bode.parquet/notes.txt").read_text() == "mine"
    assert any("notes.txt is not in its list of files" in text for text in verify(home / "o").differences)


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_a_lost_part_is_noticed_and_so_is_a_changed_one(home, lost):
    run("bode", "mine.toml", "--out", "o", "--no-plot", "--partition", "2")
    part = home / f"o/bode.parquet/part-{lost:05d}.parquet"
    content = part.read_bytes()
    part.write_bytes(content[:-40] + b"x" + content[-39:])
    assert any(part.name in text and "in the package" in text for text in verify(home / "o").differences)
    part.unlink()
    assert any(f"{part}: No such file" in text for text in verify(home / "o").differences)
    with pytest.raises(UsageError, match=r"expected 3 parts from part-00000\.parquet on, found 2 or others"):
        results.read_table(home / "o/bode.parquet")


@pytest.mark.parametrize("partition", [3, 64])
def test_blocks_and_groups_leave_no_trace_in_the_parts(columns, facts, same, partition, tmp_path, monkeypatch):
    from wavesweep.program.results.table_files import read_rows

    monkeypatch.setattr(writing_module, "GROUP_ROWS", 10)
    table = {name: np.resize(column, 64) for name, column in columns.items()}
    for size in (64, 7, 1):
        blocks = [{name: column[start : start + size] for name, column in table.items()} for start in range(0, 64, size)]
        publish(Table("zwidth", lambda blocks=blocks: blocks, facts), tmp_path / str(size), partition=partition)
    folder = tmp_path / "64" / "zwidth.parquet"
    assert len(list(folder.iterdir())) == -(-64 // partition)
    parts = [pyarrow.parquet.ParquetFile(part).metadata for part in folder.iterdir()]
    sizes = [part.row_group(number).num_rows for part in parts for number in range(part.num_row_groups)]
    assert max(sizes) == min(10, partition)  # a part that is larger than a group is read a group at a time
    for other in ("7", "1"):
        for part in folder.iterdir():
            assert (tmp_path / other / "zwidth.parquet" / part.name).read_bytes() == part.read_bytes()
    same(results.read(folder), table)
    for first, end in ((0, 64), (5, 23), (16, 17), (40, None), (64, None)):
        same(read_rows(folder, first, end), {name: column[first:end] for name, column in table.items()})
