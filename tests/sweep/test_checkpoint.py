"""A checkpoint is gone on from if it is of the same run, without its damaged parts, and is refused if it is of another run."""

import errno
import json
import os
import shutil

import pytest

from wavesweep import sweep
from wavesweep.errors import CheckpointError
from wavesweep.sweep import checkpoint
from wavesweep.sweep.interval_job import job_of


class Stopped(BaseException):
    """Somebody stopped the run."""


@pytest.fixture(scope="module")
def kept(long, tmp_path_factory):
    """A folder with two finished chunks of four."""
    folder = tmp_path_factory.mktemp("stopped") / ".zwidth.parts"
    told = []

    def stop(*counts):
        told.append(counts)
        if len(told) == 2:
            raise Stopped

    with pytest.raises(Stopped) as caught:
        sweep.intervals(long, jobs=1, checkpoint=folder, progress=stop)
    assert f"are kept in {folder}; the same command goes on from there" in caught.value.__notes__[0]
    return folder


@pytest.fixture
def stopped(kept, tmp_path):
    """A copy of it."""
    return shutil.copytree(kept, tmp_path / kept.name)


def parts_in(folder):
    return sorted(folder.glob("*.records"))


@pytest.mark.slow
def test_a_run_goes_on_where_it_was_stopped(stopped, long, long_table, same):
    assert len(parts_in(stopped)) == 2
    told = []
    run = sweep.intervals(long, jobs=1, checkpoint=stopped, progress=lambda *counts: told.append(counts))
    assert len(told) == 2
    assert run.facts["timings"]["slices_from_checkpoint"] == 8192
    same(run.columns, long_table)
    run.forget()
    assert not stopped.exists()


def test_a_checkpoint_of_another_spec_is_refused_and_thrown_away_with_force(stopped, mixed):
    with pytest.raises(CheckpointError, match=rf"{stopped}.* of another run, which differs in spec_sha256.*--restart"):
        sweep.intervals(mixed, checkpoint=stopped)
    assert len(parts_in(stopped)) == 2
    run = sweep.intervals(mixed, checkpoint=stopped, force=True)
    assert run.facts["timings"]["slices_from_checkpoint"] == 0


def test_force_begins_the_same_run_anew(stopped, long):
    run = sweep.intervals(long, jobs=1, checkpoint=stopped, force=True)
    assert run.facts["timings"]["slices_from_checkpoint"] == 0


def truncate(folder):
    path = parts_in(folder)[0]
    path.write_bytes(path.read_bytes()[:-100])


def flip_a_bit(folder, at=-200):
    path = parts_in(folder)[1]
    content = bytearray(path.read_bytes())
    content[at] ^= 4
    path.write_bytes(content)


def flip_a_bit_of_the_header(folder):
    flip_a_bit(folder, at=40)


def empty(folder):
    parts_in(folder)[0].write_bytes(b"")


def copy_over_another_number(folder):
    first, second = parts_in(folder)
    shutil.copy(first, second)


def make_it_a_folder(folder):
    part = parts_in(folder)[0]
    part.unlink()
    part.mkdir()


def make_it_a_dangling_link(folder):
    part = parts_in(folder)[0]
    part.unlink()
    part.symlink_to("nowhere")


def make_it_a_pipe(folder):
    part = parts_in(folder)[0]
    part.unlink()
    os.mkfifo(part)


PART_DAMAGES = {
    truncate: "was damaged", flip_a_bit: "was damaged", flip_a_bit_of_the_header: "is a copy of chunk 5", empty: "is cut off",
    copy_over_another_number: "is a copy of chunk 0", make_it_a_folder: "not a regular file",
    make_it_a_dangling_link: "symbolic links", make_it_a_pipe: "not a regular file",
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("damage", PART_DAMAGES)
def test_a_damaged_part_costs_that_part_alone(stopped, long, long_table, same, damage):
    damage(stopped)
    run = sweep.intervals(long, jobs=1, checkpoint=stopped)
    assert run.facts["timings"]["slices_from_checkpoint"] == 4096
    (warning,) = run.facts["warnings"]
    assert PART_DAMAGES[damage] in warning
    assert warning.startswith(f"{stopped}/000000")
    assert warning.endswith("these slices are computed again")
    same(run.columns, long_table)


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("damage", [truncate, flip_a_bit, copy_over_another_number, make_it_a_pipe])
def test_a_part_that_is_damaged_during_the_run_is_computed_again(stopped, long, long_table, same, damage):
    run = sweep.intervals(long, jobs=1, checkpoint=stopped)
    for part in parts_in(stopped)[2:]:
        part.rename(part.with_suffix(".away"))
    damage(stopped)  # both of its parts were read, and found whole, before
    for part in stopped.glob("*.away"):
        part.rename(part.with_suffix(".records"))
    same(run.columns, long_table)
    assert len(run.facts["warnings"]) == 1
    same(run.columns, long_table)
    assert len(run.facts["warnings"]) == 1


def test_a_part_of_another_run_is_not_read(stopped, long, tmp_path):
    own = checkpoint.checkpoint_of(job_of(long), stopped, False, [])
    records = own.load(0)
    (tmp_path / "other").mkdir()
    other = checkpoint.FolderCheckpoint(tmp_path / "other", bytes(32), set(), records.dtype, [])
    other.save(0, records)
    shutil.copy(*(next(folder.glob("0000000-*.records")) for folder in (tmp_path / "other", stopped)))
    with pytest.raises(checkpoint.DamagedError, match="of another run"):
        own.load(0)


def tear(folder):
    (folder / "manifest.json").write_text('{"spec_sha')


def flip_a_bit_of_the_manifest(folder):
    text = (folder / "manifest.json").read_text()
    (folder / "manifest.json").write_text(text.replace('"K_VE"', '"K_VD"'))


def nest(folder):
    (folder / "manifest.json").write_text("[" * 100_000)


def lose(folder):
    (folder / "manifest.json").unlink()


def hide_behind_a_folder(folder):
    lose(folder)
    (folder / "manifest.json").mkdir()


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("damage", [tear, flip_a_bit_of_the_manifest, nest, lose, hide_behind_a_folder])
def test_a_damaged_manifest_costs_nothing_but_that_of_another_run_is_seen(stopped, long, mixed, damage):
    damage(stopped)
    with pytest.raises(CheckpointError, match=r"of another run, as manifest\.json is"):
        sweep.intervals(mixed, jobs=1, checkpoint=stopped)
    run = sweep.intervals(long, jobs=1, checkpoint=stopped)
    assert run.facts["timings"]["slices_from_checkpoint"] == 8192
    assert [warning.endswith("it is written again") for warning in run.facts["warnings"]] == [True]


@pytest.mark.parametrize("key", ["tool_version", "numpy_version", "layout"])
def test_a_checkpoint_of_another_version_is_refused_and_stays_as_it_is(stopped, long, key):
    facts = json.loads((stopped / "manifest.json").read_text()) | {key: "0.0.1"}
    del facts["digest"]
    (stopped / "manifest.json").write_text(json.dumps(facts | {"digest": checkpoint._digest(facts).hex()}))
    before = {path.name: path.read_bytes() for path in stopped.iterdir()}
    with pytest.raises(
        CheckpointError, match=rf"{stopped}.* differs in {key} \(0.0.1, not .*remove the folder, or give --restart"
    ):
        sweep.intervals(long, jobs=1, checkpoint=stopped)
    assert {path.name: path.read_bytes() for path in stopped.iterdir()} == before


@pytest.mark.parametrize("force", [True, False])
def test_a_link_or_a_file_in_place_of_the_folder_is_refused(stopped, long, tmp_path, force):
    link, file = tmp_path / "link", tmp_path / "file"
    link.symlink_to(stopped)
    file.write_text("")
    for place in (link, file):
        with pytest.raises(CheckpointError, match="expected a folder for finished chunks, found a file or a link"):
            sweep.intervals(long, checkpoint=place, force=force)
    assert len(parts_in(stopped)) == 2


def test_what_is_not_ours_stays(stopped, long):
    (stopped / "notes.txt").write_text("mine")
    (stopped / "0000009-1234.records.txt").write_text("mine")
    run = sweep.intervals(long, jobs=1, checkpoint=stopped)
    run.forget()
    assert sorted(path.name for path in stopped.iterdir()) == ["0000009-1234.records.txt", "notes.txt"]
    assert run.facts["warnings"] == [f"{stopped}: it stays, since it holds files that are not of this program"]


def test_an_interrupted_removal_is_finished_by_any_run(stopped, long, mixed, tmp_path):
    stopped.rename(tmp_path / ".zwidth.parts.old-0123456789ab")
    (tmp_path / ".zwidth.parts.old-notes").mkdir()
    (tmp_path / ".zwidth.parts.old-ba9876543210").symlink_to(tmp_path)
    sweep.intervals(mixed, jobs=1, checkpoint=stopped)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".zwidth.parts.old-ba9876543210", ".zwidth.parts.old-notes"]
    assert long


def test_a_checkpoint_in_memory_moves_to_a_file_if_it_is_large(long, long_table, same, monkeypatch):
    monkeypatch.setattr(checkpoint, "IN_MEMORY", 1000)
    run = sweep.intervals(long, jobs=1)
    same(run.columns, long_table)
    run.forget()


def test_what_a_killed_run_was_writing_is_no_part(stopped, long):
    (stopped / "0000003-12345678.records.0123456789ab.tmp").write_bytes(b"half")
    run = sweep.intervals(long, jobs=1, checkpoint=stopped)
    assert run.facts["slices"]["computed"] == 16200
    run.forget()
    assert not stopped.exists()


def test_a_single_chunk_needs_no_folder(mixed, tmp_path):
    sweep.intervals(mixed, checkpoint=tmp_path / "parts")
    assert not (tmp_path / "parts").exists()


def test_a_removal_that_fails_is_a_warning_and_is_finished_by_the_next_run(stopped, long, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(errno.EIO, "Input/output error")

    run = sweep.intervals(long, jobs=1, checkpoint=stopped)
    with monkeypatch.context() as patched:
        patched.setattr(checkpoint, "remove_folder", fail)
        run.forget()
    assert run.facts["warnings"] == [f"{stopped}: Input/output error; the next run removes this checkpoint"]
    assert [path.name.startswith(".zwidth.parts.old-") for path in tmp_path.iterdir()] == [True]
    sweep.intervals(long, jobs=1, checkpoint=stopped).forget()
    assert list(tmp_path.iterdir()) == []
