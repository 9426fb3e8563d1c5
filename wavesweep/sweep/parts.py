"""Finished chunks: in memory, or in a folder that survives a crash."""

import json
import os
import shutil
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from wavesweep.errors import CheckpointError
from wavesweep.sweep.chunks import Chunks
from wavesweep.sweep.records import DTYPE, is_whole

MANIFEST = "manifest.json"
SUFFIX = ".records"


class MemoryParts:
    """Finished chunks of a run that is too short to be worth a folder."""

    def __init__(self):
        self._records = {}

    @property
    def place(self) -> Path | None:
        """The folder; None, there is none."""
        return None

    def finished(self) -> list[int]:
        """Numbers of the chunks that are finished."""
        return sorted(self._records)

    def save(self, number: int, records: np.ndarray) -> None:
        """Keep a finished chunk."""
        self._records[number] = records

    def load(self, number: int) -> np.ndarray:
        """Give a finished chunk back."""
        return self._records[number]

    def remove(self) -> None:
        """Forget everything."""
        self._records.clear()


class FolderParts:
    """Finished chunks as files of one folder, with a manifest that says of which run.

    A part is written under a temporary name and renamed, and has the checksum of its records in its name: whatever
    happens to the process, a part is there whole or not at all, and what the disk did to it later is seen.
    """

    def __init__(self, folder: Path, chunks: Chunks, names: Mapping[int, str], dtype=DTYPE):
        self._folder, self._chunks, self._names, self._dtype = folder, chunks, dict(names), dtype
        self._sound = set()  # of those whose checksum needs no second look

    @property
    def place(self) -> Path:
        """The folder."""
        return self._folder

    def finished(self) -> list[int]:
        """Numbers of the chunks that are finished."""
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
        """Read a finished chunk. Raises CheckpointError where it is not what was written."""
        path = self._folder / self._names[number]
        records = np.fromfile(path, self._dtype)
        if number not in self._sound:
            checksum = path.stem.rpartition("-")[2]
            if f"{zlib.crc32(records.tobytes()):08x}" != checksum or not is_whole(records, self._chunks[number].columns):
                raise _unusable(self._folder, f"{path.name} is not what was written")
            self._sound.add(number)
        return records

    def remove(self) -> None:
        """Remove the folder."""
        shutil.rmtree(self._folder)


def open_folder(
    folder: Path, facts: Mapping[str, object], chunks: Chunks, force: bool = False, dtype=DTYPE
) -> FolderParts:
    """Open the folder of a run, made if it is missing; `facts` (JSON-able) say which run it is.

    dtype: of its records. force: throw away what is there where it is of no use. Raises CheckpointError where a
    checkpoint is torn or of another run: it may be somebody's night of work, so it is not silently begun anew.
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
    parts = FolderParts(folder, chunks, _names(folder, len(chunks)), dtype)
    for number in parts.finished():
        parts.load(number)
    return parts


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
