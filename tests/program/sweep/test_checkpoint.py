"""A checkpoint is gone on from if it is of the same run, without its damaged chunks, and is refused if it is of another run."""

import errno
import os
import shutil
import sqlite3

import numpy as np
import pytest
from support.chunks import changed, finished_in

from wavesweep.engine.errors import UsageError
from wavesweep.haptics.felt import RECORD
from wavesweep.program.store import checkpoint
from wavesweep.program.store.checkpoint import CheckpointError
from wavesweep.program.tables.interval_table import intervals


class Stopped(BaseException):
    """Somebody stopped the run."""


@pytest.fixture(scope="module")
def kept(long, tmp_path_factory):
    """A file with two finished chunks of four."""
    place = tmp_path_factory.mktemp("stopped") / ".zwidth.sqlite"
    told = []

    def stop(*counts):
        told.append(counts)
        if len(told) == 3:  # the first one is of what the checkpoint had
            raise Stopped

    with pytest.raises(Stopped) as caught:
        intervals(long, jobs=1, checkpoint=place, progress=stop)
    assert f"are kept in {place}; the same command goes on from there" in caught.value.__notes__[0]
    del caught
    return place


@pytest.fixture
def stopped(kept, tmp_path):
    """A copy of it."""
    for path in kept.parent.iterdir():
        shutil.copy(path, tmp_path)
    return tmp_path / kept.name


@pytest.mark.slow
def test_a_run_goes_on_where_it_was_stopped(stopped, long, long_table, same):
    assert finished_in(stopped) == [0, 2]
    told = []
    run = intervals(long, jobs=1, checkpoint=stopped, progress=lambda *counts: told.append(counts))
    assert [done for done, *_ in told] == [8192, 12288, 16200]
    assert run.facts["timings"]["slices_from_checkpoint"] == 8192
    same(run.columns, long_table)
    run.forget()
    assert list(stopped.parent.iterdir()) == []


def test_a_checkpoint_of_another_spec_is_refused_and_thrown_away_with_force(stopped, other, tmp_path):
    with pytest.raises(CheckpointError, match=rf"{stopped}.* of another run, which differs in spec_sha256.*--restart"):
        intervals(other, jobs=1, checkpoint=stopped)
    assert finished_in(stopped) == [0, 2]
    run = intervals(other, jobs=1, checkpoint=stopped, force=True)
    assert run.facts["timings"]["slices_from_checkpoint"] == 0
    assert finished_in(stopped) == [0, 1, 2, 3]
    run.forget()
    assert list(tmp_path.iterdir()) == []


def test_a_request_that_is_refused_on_its_way_keeps_what_is_finished(long, tmp_path):
    """One that is refused at once leaves nothing."""

    def refuse(done, *_):
        if done:
            raise UsageError("no")

    with pytest.raises(UsageError) as caught:
        intervals(long, jobs=1, checkpoint=tmp_path / "kept.sqlite", progress=refuse)
    assert finished_in(tmp_path / "kept.sqlite") == [0]
    assert "4096 of 16200 slices are kept" in caught.value.__notes__[0]


FLIP = "UPDATE chunks SET records = CAST(substr(records, 1, 99) || x'2a' || substr(records, 101) AS BLOB) WHERE number = 2"
DAMAGES = {
    "cut off": "UPDATE chunks SET records = substr(records, 1, 100) WHERE number = 2",
    "a copy": "UPDATE chunks SET (checksum, records) = "
    "(SELECT checksum, records FROM chunks WHERE number = 0) WHERE number = 2",
}


@pytest.mark.slow
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_chunk_costs_that_chunk_alone(stopped, long, long_table, same, damage):
    changed(stopped, DAMAGES[damage])
    run = intervals(long, jobs=1, checkpoint=stopped)
    assert run.facts["timings"]["slices_from_checkpoint"] == 4096
    assert run.facts["warnings"] == [f"{stopped}, chunk 2: it was damaged; these slices are computed again"]
    same(run.columns, long_table)


@pytest.mark.slow
@pytest.mark.parametrize("damage", [FLIP, "DELETE FROM chunks WHERE number = 2"])
def test_a_chunk_that_is_damaged_during_the_run_is_computed_again(stopped, long, long_table, same, damage):
    run = intervals(long, jobs=1, checkpoint=stopped)
    changed(stopped, damage)  # it was read, and found whole, before
    for _ in range(2):
        same(run.columns, long_table)
        assert len(run.facts["warnings"]) == 1


def test_a_chunk_of_another_run_is_not_read(stopped, long):
    """Also if its row is in the place of one of this run."""
    other, records = checkpoint.FileCheckpoint(stopped, "other", {}, RECORD, False, []), np.zeros(4096, RECORD)
    other.save(0, records)
    other.save(2, records)
    changed(stopped, "DELETE FROM chunks WHERE number = 0 AND run = (SELECT digest FROM runs WHERE name = '')")
    changed(stopped, "UPDATE chunks SET run = (SELECT digest FROM runs WHERE name = '') WHERE number = 0")
    run = intervals(long, jobs=1, checkpoint=stopped)
    assert run.facts["timings"]["slices_from_checkpoint"] == 4096
    assert run.facts["warnings"] == [f"{stopped}, chunk 0: it was damaged; these slices are computed again"]
    run.forget()
    assert finished_in(stopped) == [2]
    assert other.load(2).tobytes() == records.tobytes()


@pytest.mark.parametrize("key", ["tool_version", "numpy_version", "layout"])
def test_a_checkpoint_of_another_version_is_refused_and_stays_as_it_is(stopped, long, key):
    changed(stopped, "UPDATE runs SET digest = zeroblob(32), identity = json_set(identity, ?, '0.0.1')", f"$.{key}")
    for _ in range(2):
        with pytest.raises(
            CheckpointError, match=rf"{stopped}.* differs in {key} \(0.0.1, not .*remove the file, or give --restart"
        ):
            intervals(long, jobs=1, checkpoint=stopped)
    assert finished_in(stopped) == [0, 2]


def some_text(path):
    path.write_text("mine, and long enough to be a page of something" * 100)


def of_another_program(path):
    path.unlink()
    with sqlite3.connect(path) as other:
        other.execute("CREATE TABLE mine (a)")
    other.close()


@pytest.mark.slow
@pytest.mark.parametrize("damage", [some_text, of_another_program])
def test_a_file_that_is_no_checkpoint_is_moved_away_and_all_is_computed(stopped, long, long_table, same, damage):
    damage(stopped)
    before = stopped.read_bytes()
    run = intervals(long, jobs=1, checkpoint=stopped)
    assert run.facts["timings"]["slices_from_checkpoint"] == 0
    (warning,) = run.facts["warnings"]
    assert warning.startswith(f"{stopped}: ")
    assert warning.endswith("it was moved to .zwidth.sqlite.damaged, and its slices are computed again")
    same(run.columns, long_table)
    run.forget()
    (left,) = stopped.parent.iterdir()
    assert (left.name, left.read_bytes()) == (".zwidth.sqlite.damaged", before)


@pytest.fixture(scope="module")
def four(tmp_path_factory):
    """A small file with four chunks, and their records."""
    place = tmp_path_factory.mktemp("four") / "kept.sqlite"
    records = [np.array([(number, 1.0)], [("slice", "i8"), ("low", "f8")]) for number in range(4)]
    store = checkpoint.FileCheckpoint(place, "zwidth", {"layout": 1}, records[0].dtype, False, [])
    for number, each in enumerate(records):
        store.save(number, each)
    store.close()
    return place.read_bytes(), records


def used_bytes(content):
    """Bytes of the file that are not zero, or beside one that is not: its words, its structure and the chunks."""
    used = np.frombuffer(content, np.uint8) > 0
    return np.flatnonzero(np.convolve(used, np.ones(3), "same"))


def is_gone_through(place, records):
    """Go on from the file, and end with all chunks right and nothing left in its place."""
    store = checkpoint.FileCheckpoint(place, "zwidth", {"layout": 1}, records[0].dtype, True, [])
    for number in store.finished():
        try:
            assert store.load(number).tobytes() == records[number].tobytes()
        except checkpoint.DamagedError as error:
            store.set_aside(number, error)
    for number in set(range(len(records))) - set(store.finished()):
        store.save(number, records[number])
    assert [store.load(number).tobytes() for number in range(len(records))] == [each.tobytes() for each in records]
    store.remove()
    assert not place.exists()


@pytest.mark.slow
def test_no_flipped_bit_stops_a_run_or_changes_a_chunk(four, tmp_path):
    """One in each tenth byte that is used: in the schema, in a name, in an index, in what SQLite says of the file itself."""
    content, records = four
    flips = np.random.default_rng(5)
    for at in used_bytes(content)[::10]:
        flipped = bytearray(content)
        flipped[at] ^= 1 << int(flips.integers(8))
        (tmp_path / "kept.sqlite").write_bytes(flipped)
        is_gone_through(tmp_path / "kept.sqlite", records)


def test_a_file_that_another_program_has_open_is_named_and_restart_begins_anew(four, tmp_path, monkeypatch):
    content, records = four
    monkeypatch.setattr(checkpoint, "LOCK_SECONDS", 0.01)
    place = tmp_path / "kept.sqlite"
    place.write_bytes(content)
    other = sqlite3.connect(place, isolation_level=None)
    other.execute("PRAGMA locking_mode = EXCLUSIVE")
    other.execute("UPDATE runs SET name = name")
    given = (place, "zwidth", {"layout": 1}, records[0].dtype)
    with pytest.raises(OSError, match="database is locked; another program has it open: close it there, or give --restart"):
        checkpoint.FileCheckpoint(*given, False, [])
    assert place.read_bytes() == content
    assert checkpoint.FileCheckpoint(*given, True, []).finished() == []
    other.close()


@pytest.mark.parametrize("suffix", checkpoint.BESIDE)
@pytest.mark.parametrize("force", [True, False])
def test_a_link_a_folder_or_a_pipe_in_place_of_the_file_is_refused(stopped, long, tmp_path, suffix, force):
    for number, make in enumerate((lambda path: path.symlink_to(stopped), os.mkdir, os.mkfifo)):
        place = tmp_path / f"{number}.sqlite"
        make(tmp_path / f"{place.name}{suffix}")
        with pytest.raises(CheckpointError, match="expected a file of finished chunks, found something else; move it away"):
            intervals(long, jobs=1, checkpoint=place, force=force)
    assert finished_in(stopped) == [0, 2]


def test_a_removal_that_fails_is_a_warning_and_is_finished_by_the_next_run(stopped, long, tmp_path, monkeypatch):
    def fail(*_, **__):
        raise OSError(errno.EIO, "Input/output error")

    run = intervals(long, jobs=1, checkpoint=stopped)
    with monkeypatch.context() as patched:
        patched.setattr("pathlib.Path.unlink", fail)
        run.forget()
    assert run.facts["warnings"] == [f"{stopped}: Input/output error; the next run removes this checkpoint"]
    intervals(long, jobs=1, checkpoint=stopped).forget()
    assert list(tmp_path.iterdir()) == []
