"""A kill leaves the old or the new results, one run at a time works on a table, and foreign files stay."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import partial

import numpy as np
import pyarrow.parquet
import pytest
from support.tables import same

from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.results import at_work, publish, read, read_table, table_writing
from wavesweep.program.results.folder import HEADER, PACKAGE, names_of, refuse_other_spec
from wavesweep.program.results.package import file_facts
from wavesweep.program.results.table_files import read_rows
from wavesweep.program.tables.table import Table

FILES = ["zwidth.csv", "zwidth.datapackage.json", "zwidth.parquet"]
RENAMES = 6  # at most: two files or folders moved away, four put in place


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def killed(number, publishing):
    """Call a function in a child that is killed before the rename of that number."""
    child = os.fork()
    if child:
        return os.waitpid(child, 0)
    left, calls = [number], {name: getattr(os, name) for name in ("rename", "replace")}

    def counted(name, *paths):
        if not left[0]:
            os.kill(os.getpid(), signal.SIGKILL)
        left[0] -= 1
        return calls[name](*paths)

    for name in calls:
        setattr(os, name, partial(counted, name))
    try:
        publishing()
    finally:
        os._exit(0)


def vouched(folder):
    """The rows of the table if its package has the hashes of all its files, 0 if not."""
    package = folder / f"zwidth{PACKAGE}"
    entries = json.loads(package.read_text())["resources"] if package.exists() else [{"path": "none"}]
    if not all((file := folder / each["path"]).is_file() and file_facts(file)["hash"] == each["hash"] for each in entries):
        return 0
    return len(read(folder / "zwidth.parquet")["low"])


@pytest.mark.sample(6)
@pytest.mark.slow
@pytest.mark.parametrize("number", range(RENAMES))
@pytest.mark.parametrize("before", [False, True])
def test_a_kill_before_any_rename_leaves_old_or_new_results_and_no_mixture(columns, facts, tmp_path, before, number):
    """before: whether results are there."""
    out, old = tmp_path / "out", {name: column[:5] for name, column in columns.items()}
    new = partial(publish, Table.of("zwidth", columns, facts, figure=lambda path: path.write_bytes(b"a figure")), out)
    if before:
        table = Table.of("zwidth", old, facts | {"spec_sha256": "cd" * 32})
        publish(table, out)
    killed(number, partial(new, overwrite=True))
    lengths = (5, len(columns["low"]))
    for path in (out / "zwidth.csv", out / "zwidth.parquet"):  # each file is whole, and a CSV without its package is refused
        with suppress(UsageError):
            assert not path.exists() or len(read_table(path)[1]["low"]) in lengths
    assert vouched(out) in (0, *lengths)
    new(overwrite=before)
    same(read(out / "zwidth.parquet"), columns)
    assert names(out) == ["zwidth.csv", "zwidth.datapackage.json", "zwidth.parquet", "zwidth.png"]
    assert vouched(out) == lengths[1]


def test_blocks_of_rows_leave_no_trace_in_the_bytes(columns, facts, tmp_path, monkeypatch):
    monkeypatch.setattr(table_writing, "GROUP_ROWS", 10)
    table = {name: np.resize(column, 64) for name, column in columns.items()}
    for size in (64, 7, 1):
        blocks = [{name: column[start : start + size] for name, column in table.items()} for start in range(0, 64, size)]
        publish(Table("zwidth", lambda blocks=blocks: blocks, facts), tmp_path / str(size))
    whole = tmp_path / "64/zwidth.parquet"
    found = pyarrow.parquet.ParquetFile(whole).metadata
    assert [found.row_group(number).num_rows for number in range(found.num_row_groups)] == [10] * 6 + [4]
    for other in ("7", "1"):
        for suffix in (".csv", ".parquet"):
            assert (tmp_path / other / f"zwidth{suffix}").read_bytes() == whole.with_suffix(suffix).read_bytes()
    for first, end in ((0, 64), (5, 23), (16, 17), (40, None), (64, None)):
        same(read_rows(whole, first, end), {name: column[first:end] for name, column in table.items()})


def test_what_an_interrupted_run_wrote_is_removed_and_folders_of_other_names_stay(columns, facts, tmp_path):
    for name in (".zwidth.new-0123456789ab", ".zwidth.new-backup", ".bode.new-0123456789ab"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "zwidth.csv").write_text("half")
    (tmp_path / ".zwidth.new-ba9876543210").symlink_to(tmp_path / ".zwidth.new-backup")
    publish(Table.of("zwidth", columns, facts), tmp_path)
    assert names(tmp_path) == sorted([".bode.new-0123456789ab", ".zwidth.new-ba9876543210", ".zwidth.new-backup", *FILES])
    assert names(tmp_path / ".zwidth.new-backup") == ["zwidth.csv"]


def test_a_second_run_is_refused_with_the_name_of_the_first_whose_lock_stays(tmp_path):
    with at_work(["zwidth"], tmp_path / "new"), at_work(["bode"], tmp_path / "new"):
        for _ in range(2):  # the first refusal must not have taken the lock away
            with pytest.raises(WavesweepError, match=rf"another run is at work on zwidth here \(process {os.getpid()} on .*\)"):
                at_work(["zwidth"], tmp_path / "new").__enter__()
            assert [name for name in names(tmp_path / "new") if "lock" in name] == [".bode.lock", ".zwidth.lock"]
    assert names(tmp_path) == []


def test_a_run_waits_if_it_may(tmp_path):
    said, order = [], []
    (tmp_path / "new").mkdir()

    def second():
        with at_work(["zwidth"], tmp_path / "new", wait=True, say=said.append):
            order.append("second")
            with pytest.raises(WavesweepError, match="at work"):  # the first one removed its own lock alone
                at_work(["zwidth"], tmp_path / "new").__enter__()

    with at_work(["zwidth"], tmp_path / "new"):
        waiting = threading.Thread(target=second)
        waiting.start()
        while not said:
            time.sleep(0.01)
        order.append("first")
    waiting.join()
    assert order == ["first", "second"]
    assert "; waiting for it" in said[0]
    assert names(tmp_path / "new") == []


def test_a_lock_dies_with_its_holder(tmp_path):
    program = (
        "import os, signal, sys; from wavesweep.program.results import at_work\n"
        "with at_work(['zwidth'], sys.argv[1]): os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", program, tmp_path], check=False)
    assert names(tmp_path) == [".zwidth.holder", ".zwidth.lock"]
    with at_work(["zwidth"], tmp_path):
        pass
    assert names(tmp_path) == []


def put(kind, path):
    """Put what is no file in the place of one, beside the target of a link."""
    target = path.with_name("target")
    target.write_text("mine")
    make = {
        "link": lambda: path.symlink_to(target),
        "link to nothing": lambda: path.symlink_to(path.with_name("nothing")),
        "pipe": lambda: os.mkfifo(path),
        "folder": path.mkdir,
    }
    make[kind]()


@pytest.mark.parametrize("kind", ["link", "link to nothing", "pipe", "folder"])
@pytest.mark.parametrize("name", [".zwidth.lock", ".zwidth.holder"])
def test_what_cannot_be_a_file_of_a_lock_is_refused_and_stays(tmp_path, name, kind):
    put(kind, tmp_path / name)
    with pytest.raises(UsageError, match="expected a lock file"), at_work(["zwidth"], tmp_path):
        pass
    assert names(tmp_path) == [name, "target"]
    assert (tmp_path / "target").read_text() == "mine"


@pytest.mark.parametrize("kind", ["link", "link to nothing", "pipe"])
@pytest.mark.parametrize("name", names_of("zwidth"))
def test_what_stands_in_the_place_of_a_file_of_results_is_not_replaced_unasked(tmp_path, name, kind):
    put(kind, tmp_path / name)
    with pytest.raises(UsageError, match="found results of an unknown origin"):
        refuse_other_spec("zwidth", tmp_path, "0" * 64)


def test_the_specs_of_designs_appear_with_their_table_and_take_the_place_of_older_ones(tmp_path):
    for texts in (("a", "b"), ("c",)):
        folder = tmp_path / ".design.new"
        folder.mkdir()
        (folder / "design.datapackage.json").write_text("{}")
        (folder / "best").mkdir()
        for number, text in enumerate(texts):
            (folder / f"best/design-{number:02d}.toml").write_text(f"{HEADER}{text}")
        with at_work(["design"], tmp_path / "elsewhere"):
            table_writing.put_in_place("design", folder, tmp_path)
        shutil.rmtree(folder)
        assert len(names(tmp_path / "best")) == len(texts)
    assert names(tmp_path) == ["best", "design.datapackage.json"]


@pytest.mark.parametrize("kind", ["own spec", "other name", "link"])
def test_specs_of_somebody_else_are_refused_and_stay(tmp_path, kind):
    best = tmp_path / "best"
    if kind == "link":
        (tmp_path / "elsewhere").mkdir()
        best.symlink_to(tmp_path / "elsewhere")
    else:
        best.mkdir()
        (best / ("design-01.toml" if kind == "own spec" else "mine.toml")).write_text("[controller]")
    before = names(best)
    with (
        pytest.raises(UsageError, match="best: expected designs of this program or none, found others"),
        at_work(["design"], tmp_path),
    ):
        pass
    assert names(best) == before


REFUSALS = [errno.ENOSYS, errno.ENOLCK, errno.EIO]


@pytest.fixture(params=REFUSALS, ids=errno.errorcode.get)
def no_locks(request, monkeypatch):
    """A file system that refuses each lock, as network and user-space file systems do in their ways."""

    def refuse(*_):
        raise OSError(request.param, os.strerror(request.param))

    monkeypatch.setattr("fcntl.flock", refuse)


@pytest.mark.usefixtures("no_locks")
def test_where_locks_are_refused_a_file_with_the_process_is_one(tmp_path):
    hint = rf"\(process {os.getpid()} on .*; give --wait .*if that process has ended, remove {tmp_path}/new/.zwidth.holder"
    with at_work(["zwidth"], tmp_path / "new"), at_work(["bode"], tmp_path / "new"):
        for _ in range(2):
            with pytest.raises(WavesweepError, match=hint), at_work(["zwidth"], tmp_path / "new"):
                pass
    assert names(tmp_path) == []


@pytest.mark.usefixtures("no_locks")
def test_where_locks_are_refused_a_run_waits_for_another(tmp_path):
    test_a_run_waits_if_it_may(tmp_path)


@pytest.mark.usefixtures("no_locks")
@pytest.mark.parametrize("host", ["", "-elsewhere"])
def test_where_locks_are_refused_the_file_of_a_process_that_has_ended_is_no_lock_on_its_own_host(tmp_path, host):
    ended = subprocess.run([sys.executable, "-S", "-c", "import os; print(os.getpid())"], check=True, capture_output=True)
    holder = tmp_path / ".zwidth.holder"
    holder.write_text(f"{int(ended.stdout)}\n{os.uname().nodename}{host}\n")
    if host:
        with pytest.raises(WavesweepError, match=r"-elsewhere\).*remove"), at_work(["zwidth"], tmp_path):
            pass
        assert names(tmp_path) == [".zwidth.holder", ".zwidth.lock"]
    else:
        with at_work(["zwidth"], tmp_path):
            assert str(os.getpid()) in holder.read_text()
        assert names(tmp_path) == []
