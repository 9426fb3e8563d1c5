"""Finished chunks: in memory or in a folder that survives a crash, and from there to the rows of the table."""

import json
import os
import shutil
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from wavesweep.analysis.doubt import words
from wavesweep.errors import CheckpointError
from wavesweep.sweep.job import Chunks, Job
from wavesweep.sweep.tasks import HAND_RECORD, RECORD, is_whole

MANIFEST = "manifest.json"
SUFFIX = ".records"


class MemoryCheckpoint:
    """Finished chunks of a run that is too short for a folder."""

    def __init__(self):
        self._records = {}

    @property
    def place(self) -> Path | None:
        """None: there is no folder."""
        return None

    def finished(self) -> list[int]:
        """Numbers of the finished chunks."""
        return sorted(self._records)

    def save(self, number: int, records: np.ndarray) -> None:
        """Keep a finished chunk."""
        self._records[number] = records

    def load(self, number: int) -> np.ndarray:
        """The records of a finished chunk."""
        return self._records[number]

    def remove(self) -> None:
        """Forget everything."""
        self._records.clear()


class FolderCheckpoint:
    """Finished chunks as files of one folder, with a manifest that identifies the run.

    A chunk's file is written under a temporary name and renamed, and has the checksum of its records in its name. So if the
    process is killed, the file is there whole or not at all, and later damage is noticed.
    """

    def __init__(self, folder: Path, chunks: Chunks, names: Mapping[int, str], dtype=RECORD):
        self._folder, self._chunks, self._names, self._dtype = folder, chunks, dict(names), dtype
        self._sound = set()  # numbers of the chunks whose checksum was compared

    @property
    def place(self) -> Path:
        """The folder."""
        return self._folder

    def finished(self) -> list[int]:
        """Numbers of the finished chunks."""
        return sorted(self._names)

    def save(self, number: int, records: np.ndarray) -> None:
        """Write a finished chunk."""
        content = records.tobytes()
        name = f"{number:07d}-{zlib.crc32(content):08x}{SUFFIX}"
        temporary = self._folder / f"{name}.tmp"
        temporary.write_bytes(content)
        temporary.replace(self._folder / name)
        self._names[number] = name
        self._sound.add(number)

    def load(self, number: int) -> np.ndarray:
        """Read a finished chunk. Raises CheckpointError if its file was damaged."""
        path = self._folder / self._names[number]
        records = np.fromfile(path, self._dtype)
        if number not in self._sound:
            checksum = path.stem.rpartition("-")[2]
            if f"{zlib.crc32(records.tobytes()):08x}" != checksum or not is_whole(records, self._chunks[number].slices):
                raise _unusable(self._folder, f"{path.name} is not what was written")
            self._sound.add(number)
        return records

    def remove(self) -> None:
        """Remove the folder."""
        shutil.rmtree(self._folder)


def checkpoint_of(job: Job, folder: Path | None, force: bool) -> MemoryCheckpoint | FolderCheckpoint:
    """The checkpoint of a job: in the folder, or in memory without a folder or for a single chunk."""
    if folder is None or (len(job.chunks) < 2 and not folder.exists()):
        return MemoryCheckpoint()
    from wavesweep import __version__

    run = {"spec_sha256": job.grid.spec.sha256, "along": job.axis.name, "tool_version": __version__, "layout": 3}
    if job.guarantee is None:
        return open_folder(folder, run, job.chunks, force)
    return open_folder(folder, run | {"guarantee": repr(job.guarantee)}, job.chunks, force, HAND_RECORD)


def open_folder(
    folder: Path, facts: Mapping[str, object], chunks: Chunks, force: bool = False, dtype=RECORD
) -> FolderCheckpoint:
    """Open the folder of a run, made if it is missing; `facts` (JSON-able) identify the run.

    dtype: of its records. force: remove a checkpoint that cannot be used. Raises CheckpointError if a checkpoint is
    damaged or of another run: it may hold a night of work, so it is not silently removed.
    """
    expected = {**facts, "chunks": [chunks.loops, chunks.walls, chunks.deep, chunks.wide]}
    try:
        return _opened(folder, expected, chunks, dtype)
    except CheckpointError:
        if not force:
            raise
        shutil.rmtree(folder)
        return _opened(folder, expected, chunks, dtype)


def _opened(folder, expected, chunks, dtype):
    folder.mkdir(parents=True, exist_ok=True)
    manifest = folder / MANIFEST
    if manifest.exists():
        _compare(folder, _read(manifest), expected)
    elif any(folder.glob(f"*{SUFFIX}")):
        raise _unusable(folder, f"it has parts but no {MANIFEST}")
    else:
        temporary = folder / f"{MANIFEST}.{os.getpid()}.tmp"
        temporary.write_text(json.dumps(expected, indent=1), encoding="utf-8")
        temporary.replace(manifest)
    store = FolderCheckpoint(folder, chunks, _names(folder, len(chunks)), dtype)
    for number in store.finished():
        store.load(number)
    return store


def _names(folder, chunks):
    names = {}
    for path in folder.glob(f"*{SUFFIX}"):
        number = path.name.partition("-")[0]
        if not number.isdigit() or int(number) >= chunks:
            raise _unusable(folder, f"{path.name} is no part of this run")
        names[int(number)] = path.name
    return names


def _read(manifest):
    try:
        return json.loads(manifest.read_text(encoding="utf-8"))
    except ValueError as error:
        raise _unusable(manifest.parent, f"{MANIFEST} cannot be read ({error})") from error


def _compare(folder, found, expected):
    different = [name for name in expected if not isinstance(found, dict) or found.get(name) != expected[name]]
    if different:
        raise _unusable(folder, f"it is of another run, which differs in {', '.join(different)}")


def _unusable(folder, why):
    return CheckpointError(
        f"{folder}: cannot go on from this checkpoint: {why}; remove the folder, or give --force to begin anew"
    )


BLOCK = 1 << 17  # combinations; 13 columns of them take some 15 MB


def blocks(job: Job, store) -> Iterator[dict[str, np.ndarray]]:
    """Yield the table's columns for consecutive combinations; store: a checkpoint in which all chunks are finished."""
    grid = job.grid
    for start in range(0, grid.size, BLOCK):
        combination = np.arange(start, min(start + BLOCK, grid.size))
        which, records = _gather(job.chunks, store, grid.slice_of(combination))
        yield _columns(grid, job.axis.name, combination[which], records)


def _gather(chunks, store, slices):
    """The records of the slices in their order, and for each the index of its slice in `slices`.

    If the wall's axes are not the last ones, neighbouring rows are in different chunks, and each chunk is read again for
    every block that has rows of it: from the page cache, at a cost far below that of computing it.
    """
    owner = chunks.of(slices)
    order = np.argsort(owner, kind="stable")
    borders = np.flatnonzero(np.diff(owner[order])) + 1
    which, records = [], []
    for members in np.split(order, borders):
        chunk = chunks[int(owner[members[0]])]
        found = store.load(chunk.number)
        wanted = slices[members] - chunk.first
        first, end = (np.searchsorted(found["slice"], wanted, side=side) for side in ("left", "right"))
        rows = end - first
        at = np.repeat(first - np.concatenate([[0], np.cumsum(rows)[:-1]]), rows) + np.arange(rows.sum())
        which.append(np.repeat(members, rows))
        records.append(found[at])
    which, records = np.concatenate(which), np.concatenate(records)
    if borders.size and np.any(np.diff(which) < 0):
        back = np.argsort(which, kind="stable")
        which, records = which[back], records[back]
    return which, records


def _columns(grid, along, combination, records):
    found = {name: np.ascontiguousarray(records[name]) for name in records.dtype.names if name != "slice"}
    found["doubt"] = words(found["doubt"])
    leading = grid.axis_columns(combination)
    return leading | {"along": np.full(records.size, along, dtype=object)} | found
