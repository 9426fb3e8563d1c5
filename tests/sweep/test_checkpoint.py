"""A checkpoint is gone on from where it is of the same run and whole, and refused aloud where it is not."""

import json
import shutil

import pytest

from wavesweep import sweep
from wavesweep.errors import CheckpointError


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
    assert run.facts["timings"]["slices_from_checkpoint"] == 8100
    same(run.columns, long_table)
    run.forget()
    assert not stopped.exists()


def test_a_checkpoint_of_another_spec_is_refused_and_thrown_away_with_force(stopped, mixed):
    with pytest.raises(CheckpointError, match=rf"{stopped}.* of another run, which differs in spec_sha256.*--force"):
        sweep.intervals(mixed, checkpoint=stopped)
    assert len(parts_in(stopped)) == 2
    run = sweep.intervals(mixed, checkpoint=stopped, force=True)
    assert run.facts["timings"]["slices_from_checkpoint"] == 0


def test_force_keeps_a_checkpoint_of_the_same_run(stopped, long):
    run = sweep.intervals(long, jobs=1, checkpoint=stopped, force=True)
    assert run.facts["timings"]["slices_from_checkpoint"] == 8100


def truncate(folder):
    path = parts_in(folder)[0]
    path.write_bytes(path.read_bytes()[:-100])


def flip_a_bit(folder):
    path = parts_in(folder)[1]
    content = bytearray(path.read_bytes())
    content[-200] ^= 4
    path.write_bytes(content)


def empty(folder):
    parts_in(folder)[0].write_bytes(b"")


def lose_the_manifest(folder):
    (folder / "manifest.json").unlink()


def tear_the_manifest(folder):
    (folder / "manifest.json").write_text('{"spec_sha')


def come_from_another_version(folder):
    facts = json.loads((folder / "manifest.json").read_text()) | {"tool_version": "0.0.1"}
    (folder / "manifest.json").write_text(json.dumps(facts))


def slip_in_a_part(folder):
    (folder / "0000099-12345678.records").write_bytes(b"")


@pytest.mark.parametrize(
    "damage",
    [truncate, flip_a_bit, empty, lose_the_manifest, tear_the_manifest, come_from_another_version, slip_in_a_part],
)
def test_a_damaged_checkpoint_is_refused_and_stays_as_it_is(stopped, long, damage):
    damage(stopped)
    before = {path.name: path.read_bytes() for path in stopped.iterdir()}
    with pytest.raises(CheckpointError, match="remove the folder, or give --force") as caught:
        sweep.intervals(long, jobs=1, checkpoint=stopped)
    assert str(stopped) in str(caught.value)
    assert {path.name: path.read_bytes() for path in stopped.iterdir()} == before


def test_what_a_killed_run_was_writing_is_no_part(stopped, long):
    (stopped / "0000003-12345678.records.tmp").write_bytes(b"half")
    run = sweep.intervals(long, jobs=1, checkpoint=stopped)
    assert run.facts["slices"]["computed"] == 16200


def test_a_single_chunk_needs_no_folder(mixed, tmp_path):
    sweep.intervals(mixed, checkpoint=tmp_path / "parts")
    assert not (tmp_path / "parts").exists()
