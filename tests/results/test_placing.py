"""Interrupted runs are finished or undone by the next one, one run at a time works on a table, and foreign files stay."""

import errno
import os
import re
import subprocess
import sys
import threading
import time

import pytest

from wavesweep import atomic_files, platform_compat
from wavesweep.errors import UsageError, WavesweepError
from wavesweep.results import at_work, lock, placing, publish
from wavesweep.results.folder import HEADER
from wavesweep.tables.table import Table

RANDOM = "0123456789ab"


@pytest.fixture
def decided(columns, facts, tmp_path):
    """A folder of results, and beside it a complete table of another spec that was decided but not placed."""
    publish(Table.of("zwidth", columns, facts), tmp_path)
    (tmp_path / "zwidth.png").write_bytes(b"the old figure")
    other = Table.of("zwidth", {name: column[:3] for name, column in columns.items()}, facts | {"spec_sha256": "cd" * 32})
    publish(other, tmp_path / "other")
    folder = tmp_path / f".zwidth.put-{RANDOM}"
    (tmp_path / "other").rename(folder)
    return folder


def names(folder):
    return sorted(path.name for path in folder.iterdir())


FILES = ["zwidth.csv", "zwidth.datapackage.json", "zwidth.parquet"]


@pytest.mark.parametrize("moved", range(5))
def test_a_decided_table_is_placed_by_the_next_run(decided, tmp_path, moved):
    content = {name: (decided / name).read_bytes() for name in FILES}
    for name in ("zwidth.csv", "zwidth.parquet", "zwidth.png", "zwidth.datapackage.json")[:moved]:
        (decided / name).replace(tmp_path / name) if name in FILES else (tmp_path / name).unlink()
    with at_work(["zwidth"], tmp_path):
        assert names(tmp_path) == [".zwidth.lock", *FILES]
    assert {name: (tmp_path / name).read_bytes() for name in FILES} == content
    assert names(tmp_path) == FILES


def test_a_table_that_was_not_decided_is_removed(decided, tmp_path):
    before = {name: (tmp_path / name).read_bytes() for name in FILES}
    decided.rename(tmp_path / f".zwidth.new-{RANDOM}")
    with at_work(["zwidth"], tmp_path):
        pass
    assert names(tmp_path) == sorted([*FILES, "zwidth.png"])
    assert {name: (tmp_path / name).read_bytes() for name in FILES} == before


def test_a_removal_that_stopped_at_the_empty_folder_is_finished(tmp_path):
    (tmp_path / f".zwidth.put-{RANDOM}").mkdir()
    with at_work(["zwidth"], tmp_path):
        pass
    assert names(tmp_path) == []


def test_a_signal_during_the_moves_is_passed_on_when_all_are_done(columns, facts, tmp_path, monkeypatch):
    seen = []

    def interrupted(path):
        seen.append(path)
        if len(seen) == 6:  # three files, their folder, and the results before and after the moves
            raise KeyboardInterrupt

    monkeypatch.setattr(placing, "sync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        publish(Table.of("zwidth", columns, facts), tmp_path)
    assert names(tmp_path) == FILES


@pytest.mark.parametrize("name", [".wavesweep-backup", f".zwidth.new-{RANDOM}", f".zwidth.put-{RANDOM}", ".zwidth.new-backup"])
def test_a_folder_of_somebody_else_stays(columns, facts, tmp_path, name):
    (tmp_path / name / "notes").mkdir(parents=True)
    (tmp_path / name / "precious.txt").write_text("mine")
    (tmp_path / name / "zwidth.csv.txt").write_text("mine")
    publish(Table.of("zwidth", columns, facts), tmp_path)
    assert names(tmp_path / name) == ["notes", "precious.txt", "zwidth.csv.txt"]


@pytest.mark.parametrize("suffix", ["new", "put"])
def test_links_and_pipes_with_our_names_are_left_alone(columns, facts, tmp_path, suffix):
    elsewhere, out = tmp_path / "elsewhere", tmp_path / "out"
    elsewhere.mkdir()
    (elsewhere / "zwidth.csv").write_text("mine")
    out.mkdir()
    (out / f".zwidth.{suffix}-{RANDOM}").symlink_to(elsewhere)
    os.mkfifo(out / f".zwidth.{suffix}-{RANDOM[::-1]}")
    publish(Table.of("zwidth", columns, facts), out)
    assert (elsewhere / "zwidth.csv").read_text() == "mine"
    assert len(names(out)) == 5


def test_files_of_the_table_alone_are_moved_and_removed(decided, tmp_path):
    for folder, name in ((decided, "bode.csv"), (tmp_path, "bode.png"), (tmp_path, "zwidth.txt")):
        (folder / name).write_text("mine")
    with at_work(["zwidth"], tmp_path):
        pass
    assert names(decided) == ["bode.csv"]
    assert names(tmp_path) == sorted([decided.name, "bode.png", *FILES, "zwidth.txt"])


def test_a_second_run_is_refused_with_the_first_ones_name_and_another_table_is_not(tmp_path):
    with at_work(["zwidth"], tmp_path / "new"), at_work(["bode"], tmp_path / "new"):
        with pytest.raises(
            WavesweepError, match=rf"another run is at work on zwidth here \(process {os.getpid()} on .*, since 2"
        ):
            at_work(["zwidth"], tmp_path / "new").__enter__()
        assert names(tmp_path / "new") == [".bode.lock", ".zwidth.lock"]
    assert names(tmp_path) == []


def test_a_run_waits_if_it_may(tmp_path):
    said, order = [], []
    (tmp_path / "new").mkdir()

    def second():
        with at_work(["zwidth"], tmp_path / "new", wait=True, say=said.append):
            order.append("second")

    with at_work(["zwidth"], tmp_path / "new"):
        waiting = threading.Thread(target=second)
        waiting.start()
        while not said:
            time.sleep(0.01)
        order.append("first")
    waiting.join()
    assert order == ["first", "second"]
    assert said[0].endswith("; waiting for it")
    assert names(tmp_path / "new") == []


def test_a_lock_dies_with_its_holder(tmp_path):
    program = (
        "import os, signal, sys; from wavesweep.results import at_work\n"
        "with at_work(['zwidth'], sys.argv[1]): os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", program, tmp_path], check=False)
    assert names(tmp_path) == [".zwidth.lock"]
    with at_work(["zwidth"], tmp_path):
        pass
    assert names(tmp_path) == []


def test_without_locks_the_run_says_so_once_and_goes_on(tmp_path, monkeypatch):
    def unsupported(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(platform_compat.fcntl, "flock", unsupported)
    said = []
    with at_work(["simulate", "simulate-response"], tmp_path, say=said.append):
        pass
    assert len(said) == 1
    assert "has no locks" in said[0]
    assert names(tmp_path) == []


@pytest.mark.parametrize("kind", ["file", "link", "pipe", "folder"])
def test_a_lock_file_that_is_not_ours_is_refused_and_stays(tmp_path, kind):
    path = tmp_path / ".zwidth.lock"
    (tmp_path / "target").write_text("mine")
    make = {
        "file": lambda: path.write_text("mine"), "link": lambda: path.symlink_to(tmp_path / "target"),
        "pipe": lambda: os.mkfifo(path), "folder": path.mkdir,
    }  # fmt: skip
    make[kind]()
    with pytest.raises(UsageError, match="expected a lock file"), at_work(["zwidth"], tmp_path):
        pass
    assert names(tmp_path) == [".zwidth.lock", "target"]
    assert (tmp_path / "target").read_text() == "mine"


def test_what_belongs_to_another_user_and_cannot_be_removed_does_not_end_the_run(columns, facts, tmp_path, monkeypatch):
    foreign = tmp_path / f".zwidth.new-{RANDOM}"
    foreign.mkdir()
    (foreign / "zwidth.csv").write_text("half")

    def refused(path, *_):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(placing, "remove_folder", refused)
    publish(Table.of("zwidth", columns, facts), tmp_path)
    assert [name for name in names(tmp_path) if not name.startswith(".")] == FILES


def test_a_folder_in_the_place_of_a_file_is_refused_before_anything_is_moved(columns, facts, tmp_path):
    (tmp_path / "zwidth.parquet").mkdir()
    with pytest.raises(UsageError, match=r"zwidth\.parquet: expected a file of results or none, found a folder"):
        publish(Table.of("zwidth", columns, facts), tmp_path)
    assert names(tmp_path) == ["zwidth.parquet"]


def test_the_folder_of_results_may_be_a_link(columns, facts, tmp_path):
    (tmp_path / "real").mkdir()
    link = tmp_path / "link"
    link.symlink_to("real")
    for _ in range(2):
        publish(Table.of("zwidth", columns, facts), link)
        assert names(tmp_path / "real") == FILES


def test_a_lock_whose_file_was_removed_meanwhile_is_taken_again(tmp_path, monkeypatch):
    """The last holder removes the file after another run has opened it; a third one then makes a new file."""
    removed, locked = [], lock._locked

    def late(descriptor, path, *given):
        if not removed:
            removed.append(path)
            path.unlink()
        return locked(descriptor, path, *given)

    monkeypatch.setattr(lock, "_locked", late)
    with at_work(["zwidth"], tmp_path):
        assert removed
        with pytest.raises(WavesweepError, match="at work"), at_work(["zwidth"], tmp_path):
            pass


def test_a_link_in_a_folder_that_is_removed_stays_with_it(tmp_path):
    """Its name may be one of ours: what it leads to is somebody else's."""
    (folder := tmp_path / "old").mkdir()
    (tmp_path / "precious").write_text("precious")
    (folder / "part-1").write_text("ours")
    (folder / "part-2").symlink_to(tmp_path / "precious")
    assert not atomic_files.remove_folder(folder, re.compile(r"part-\d"))
    assert names(folder) == ["part-2"]
    assert (tmp_path / "precious").read_text() == "precious"


def designs_in(directory, *texts):
    """A complete table `design` with its specs, not yet in place."""
    directory.mkdir(exist_ok=True)
    folder = placing.new_folder("design", directory)
    (folder / "design.datapackage.json").write_text("{}")
    (folder / "best").mkdir()
    for number, text in enumerate(texts):
        (folder / f"best/design-{number:02d}.toml").write_text(f"{HEADER}{text}")
    return folder


def test_the_specs_of_designs_appear_with_their_table_and_take_the_place_of_older_ones(tmp_path):
    placing.put_in_place("design", designs_in(tmp_path, "a", "b"), tmp_path)
    left = designs_in(tmp_path, "c")
    with at_work(["design"], tmp_path):
        assert names(tmp_path / "best") == ["design-00.toml", "design-01.toml"]
    assert not left.exists()
    decided = designs_in(tmp_path, "c")
    decided.rename(tmp_path / f".design.put-{RANDOM}")
    with at_work(["design"], tmp_path):
        assert names(tmp_path / "best") == ["design-00.toml"]
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
