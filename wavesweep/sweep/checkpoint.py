"""Finished chunks: in memory or in a folder that survives a crash, and from there to the rows of the table.

A folder has a manifest, which names the run in words, and a file for each finished chunk. The name of a file has the
number of its chunk and the first digits of the run's digest; its header has both in full, and a checksum over all of it.
"""

import hashlib
import json
import os
import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from wavesweep.arithmetic import versions
from wavesweep.disk import TEMPORARY, is_folder, make_folders, put_away, read_file, remove_folder, remove_old, write_file
from wavesweep.errors import CheckpointError
from wavesweep.sweep.job import Job
from wavesweep.sweep.tasks import RECORD

MANIFEST = "manifest.json"
SUFFIX = ".records"
DAMAGED = ".damaged"  # behind the name of a file that was set aside
LAYOUT = 4  # of the files
MAGIC = b"wavepart"
HEADER = struct.Struct("<8s32sQQI")  # magic, digest of the run, number of the chunk, bytes of records, checksum of all else
IN_MEMORY = 1 << 26  # bytes of records; more go to a file without a name
_PART = re.compile(rf"(\d{{7,18}})-([0-9a-f]{{8}}){re.escape(SUFFIX)}")
OURS = re.compile(rf"(manifest\.json|{_PART.pattern})({TEMPORARY}|{re.escape(DAMAGED)})?")


class DamagedError(Exception):
    """The file of a finished chunk is not the one that was written; the text says why."""


class MemoryCheckpoint:
    """Finished chunks in memory or, if they are many, in a file without a name, which a kill removes as well."""

    def __init__(self, dtype=RECORD):
        self._dtype, self._kept, self._places = dtype, {}, {}
        self._file, self._bytes = None, 0

    def __del__(self):
        self.remove()

    @property
    def place(self) -> Path | None:
        """None: nothing is kept if the run is stopped."""
        return None

    def finished(self) -> list[int]:
        """Numbers of the finished chunks."""
        return sorted([*self._kept, *self._places])

    def save(self, number: int, records: np.ndarray) -> None:
        """Keep a finished chunk."""
        self._bytes += records.nbytes
        if self._bytes <= IN_MEMORY:
            self._kept[number] = records
            return
        if self._file is None:
            from tempfile import TemporaryFile  # a small run needs none

            self._file = TemporaryFile()  # noqa: SIM115 - closed by `remove`, or with this object
        start = self._file.seek(0, os.SEEK_END)
        self._file.write(records.tobytes())
        self._places[number] = (start, records.nbytes)

    def load(self, number: int) -> np.ndarray:
        """The records of a finished chunk."""
        if number in self._kept:
            return self._kept[number]
        start, size = self._places[number]
        self._file.seek(start)
        return np.frombuffer(self._file.read(size), self._dtype)

    def remove(self) -> None:
        """Forget everything."""
        self._kept.clear()
        self._places.clear()
        if self._file is not None:
            self._file.close()


class FolderCheckpoint:
    """Finished chunks as files of one folder, each with the run's identity and a checksum, which every reading compares.

    `warnings` is a list to which a sentence is added for each file that turns out to be damaged.
    """

    def __init__(self, folder: Path, digest: bytes, numbers: set[int], dtype, warnings: list[str]):
        self._folder, self._digest, self._numbers, self._dtype = folder, digest, set(numbers), dtype
        self.warnings = warnings

    @property
    def place(self) -> Path:
        """The folder."""
        return self._folder

    def finished(self) -> list[int]:
        """Numbers of the finished chunks."""
        return sorted(self._numbers)

    def save(self, number: int, records: np.ndarray) -> None:
        """Write a finished chunk."""
        content = records.tobytes()
        write_file(self._path(number), self._header(number, content), content)
        self._numbers.add(number)

    def load(self, number: int) -> np.ndarray:
        """Read a finished chunk. Raises DamagedError if its file is not the one that was written for it."""
        try:
            found = read_file(self._path(number))
        except OSError as error:
            raise DamagedError(error.strerror or str(error)) from error
        header, content = found[: HEADER.size], found[HEADER.size :]
        if header != self._header(number, content):
            raise DamagedError(_difference(header, self._digest, number))
        return np.frombuffer(content, self._dtype)

    def set_aside(self, number: int, why: Exception) -> None:
        """Rename the file of a chunk that cannot be used, so that the chunk is computed again, and add a warning."""
        path = self._path(number)
        self._numbers.discard(number)
        self.warnings.append(f"{path}: {why}; these slices are computed again")
        if os.path.lexists(path):
            path.replace(path.with_name(path.name + DAMAGED))

    def remove(self) -> None:
        """Remove the folder: it is renamed first, so that an interrupted removal is not taken for a checkpoint."""
        _remove(self._folder, self.warnings)

    def _path(self, number):
        return self._folder / f"{number:07d}-{self._digest.hex()[:8]}{SUFFIX}"

    def _header(self, number, content):
        known = HEADER.pack(MAGIC, self._digest, number, len(content), 0)
        return HEADER.pack(MAGIC, self._digest, number, len(content), zlib.crc32(content, zlib.crc32(known)))


def _difference(header, digest, number):
    """Why a header is not the expected one."""
    if len(header) < HEADER.size:
        return "it is cut off"
    magic, found, other, *_ = HEADER.unpack(header)
    if magic == MAGIC and found != digest:
        return "it is of another run"
    if magic == MAGIC and other != number:
        return f"it is a copy of chunk {other}"
    return "it was damaged"


def _remove(folder, warnings):
    away = put_away(folder)
    if not remove_folder(away, OURS):
        away.rename(folder)
        warnings.append(f"{folder}: it stays, since it holds files that are not of this program")


def records_of(job: Job, store, number: int) -> np.ndarray:
    """The records of a finished chunk; if its file was damaged meanwhile, the chunk is computed again."""
    try:
        return store.load(number)
    except DamagedError as error:
        store.set_aside(number, error)
        store.save(number, job.task(job.chunks[number]).records())
        return store.load(number)


def checkpoint_of(job: Job, folder: Path | None, force: bool, warnings: list[str]) -> MemoryCheckpoint | FolderCheckpoint:
    """The checkpoint of a job: in the folder, or in memory without a folder or for a single chunk.

    force: begin anew, whatever the folder holds. warnings: receives a sentence for each damaged file.
    Raises CheckpointError if the folder is of another run, which may be a night of work, or no folder of this program.
    """
    if folder is None:
        return MemoryCheckpoint(job.dtype)
    remove_old(folder, OURS)
    if len(job.chunks) < 2 and not os.path.lexists(folder):
        return MemoryCheckpoint(job.dtype)
    if os.path.lexists(folder) and not is_folder(folder):
        raise CheckpointError(f"{folder}: expected a folder for finished chunks, found a file or a link; move it away")
    run = identity_of(job)
    digest = _digest(run)
    _prepare(folder, run, digest, force, warnings)
    return FolderCheckpoint(folder, digest, _numbers(folder, digest, len(job.chunks)), job.dtype, warnings)


def _prepare(folder, run, digest, force, warnings):
    """Let the folder be one with the manifest of this run, or raise CheckpointError."""
    if force and is_folder(folder):
        _remove(folder, warnings)
    damage = _refuse_other_run(folder, run, digest)
    make_folders(folder)
    manifest = folder / MANIFEST
    if damage is not None:
        warnings.append(f"{manifest}: {damage}; it is written again")
        if os.path.lexists(manifest):
            manifest.replace(manifest.with_name(MANIFEST + DAMAGED))
    if not manifest.exists():
        write_file(manifest, json.dumps(run | {"digest": digest.hex()}, indent=1).encode())


def _digest(run):
    return hashlib.sha256(json.dumps(run, sort_keys=True).encode()).digest()


def identity_of(job: Job) -> dict[str, object]:
    """What a finished chunk depends on, JSON-able: chunks of runs that differ in any of it are never mixed."""
    chunks = job.chunks
    return {
        "layout": LAYOUT,
        "spec_sha256": job.grid.spec.sha256,
        **versions(),
        "chunks": [chunks.loops, chunks.walls, chunks.deep, chunks.wide],
        **job.identity,
    }


def _refuse_other_run(folder, run, digest) -> str | None:
    """Raise CheckpointError if the folder is of another run; otherwise say if its manifest is damaged, and how."""
    found, damage = {}, None
    try:
        found = json.loads(read_file(folder / MANIFEST))
        if found.pop("digest") != _digest(found).hex():
            damage = "it was damaged"
    except FileNotFoundError:
        damage = ""
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        damage = f"it cannot be read ({error})"
    if damage is None:
        different = [f"{name} ({found.get(name)}, not {run[name]})" for name in run if found.get(name) != run[name]]
        if different:
            raise _of_another_run(folder, f", which differs in {', '.join(different)}")
        return None
    runs = {match[2] for match in _parts(folder)}
    if runs - {digest.hex()[:8]}:  # without a manifest, the parts say whose they are
        raise _of_another_run(folder, f", as {MANIFEST} is {'damaged' if damage else 'missing'} and its files say")
    return damage or ("it is missing" if runs else None)


def _parts(folder):
    try:
        names = [path.name for path in folder.iterdir()]
    except FileNotFoundError:
        return []
    return [match for match in map(_PART.fullmatch, sorted(names)) if match]


def _numbers(folder, digest, chunks):
    found = [int(match[1]) for match in _parts(folder) if match[2] == digest.hex()[:8]]
    return {number for number in found if number < chunks}


def _of_another_run(folder, how):
    return CheckpointError(
        f"{folder}: cannot go on from this checkpoint: it is of another run{how}; "
        "remove the folder, or give --restart to begin anew"
    )


BLOCK = 1 << 17  # combinations; 13 columns of them take some 15 MB, 22 of responses 25 MB


def blocks(job: Job, store) -> Iterator[Mapping[str, np.ndarray]]:
    """Yield the table's columns for consecutive combinations; store: a checkpoint in which all chunks are finished."""
    for combination in stretches(job.size):
        which, records = gather(job, store, job.slice_of(combination))
        yield job.columns(combination[which], records)


def stretches(size: int) -> Iterator[np.ndarray]:
    """Yield the numbers of the combinations of each block."""
    for start in range(0, size, BLOCK):
        yield np.arange(start, min(start + BLOCK, size))


def gather(job: Job, store, slices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For the records of the slices, in their order, the index of the slice in `slices`; and the records.

    If the wall's axes are not the last ones, neighbouring rows are in different chunks, and each chunk is read again for
    every block that has rows of it: from the page cache, at a cost far below that of computing it.
    """
    if len(job.chunks) == 1 and slices.size == job.slices and (slices == np.arange(slices.size)).all():
        records = records_of(job, store, 0)
        return records["slice"], records
    owner = job.chunks.of(slices)
    order = np.argsort(owner, kind="stable")
    borders = np.flatnonzero(np.diff(owner[order])) + 1
    which, records = [], []
    for members in np.split(order, borders):
        chunk = job.chunks[int(owner[members[0]])]
        found = records_of(job, store, chunk.number)
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
