"""Finished chunks of a run: in memory, or in one SQLite file, from which a run that was stopped
goes on.

The table `runs` of the file says in words whose chunks it holds, with a row for each job of a run.
The table `chunks` has a row for each finished chunk, under the digest of its job's words, with a
checksum that every reading compares.

The file has a write-ahead log, `-wal`, which SQLite brings to the disk before it changes the file
itself. So a kill loses nothing, and a power cut the last chunks alone, while a chunk costs no
`fsync` of its own.
"""

import errno
import hashlib
import json
import os
import stat
import zlib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.program.atomic_files import make_folders

SUFFIX = ".sqlite"  # of the name of a checkpoint
# behind it: the file itself, and those that SQLite puts beside it
BESIDE = ("", "-journal", "-wal", "-shm")
DAMAGED = ".damaged"  # behind the name of a file that was moved away
LOCK_SECONDS = 2.0  # s for a lock
# What SQLite says of the disk or of other programs, and not of the file, each with what helps.
IN_USE = "; another program has it open: close it there, or give --restart to begin anew"
OF_DISK = dict.fromkeys(("IOERR", "FULL", "CANTOPEN", "PERM", "NOMEM", "READONLY"), "")
OF_DISK |= dict.fromkeys(("BUSY", "LOCKED", "PROTOCOL"), IN_USE)
OURS = 0x77617665  # application_id of the file
TABLES = f"""
BEGIN;
PRAGMA application_id = {OURS};
CREATE TABLE IF NOT EXISTS runs (name TEXT PRIMARY KEY, digest BLOB, identity TEXT);
CREATE TABLE IF NOT EXISTS chunks (run BLOB, number INTEGER, checksum INTEGER, records BLOB, PRIMARY KEY (run, number));
COMMIT;
"""


class CheckpointError(UsageError):
    """A half-finished run on disk is damaged or belongs to another spec."""


def _formats(place: Path) -> bytes:
    """The versions of the format that a file of SQLite names, for those who write and read it: 1
    or, with a log, 2."""
    with place.open("rb") as file:
        return file.read(20)[18:]


class DamagedError(Exception):
    """A finished chunk is not the one that was written; the text says why."""


class MemoryCheckpoint:
    """Finished chunks in memory: nothing is kept if the run is stopped."""

    place = None

    def __init__(self):
        self._kept: dict[int, np.ndarray] = {}

    def finished(self) -> list[int]:
        """Numbers of the finished chunks."""
        return sorted(self._kept)

    def save(self, number: int, records: np.ndarray) -> None:
        """Keep a finished chunk."""
        self._kept[number] = records

    def load(self, number: int) -> np.ndarray:
        """The records of a finished chunk."""
        return self._kept[number]

    def remove(self) -> None:
        """Forget everything."""
        self._kept.clear()

    def close(self) -> None:
        """Nothing needs closing."""


class FileCheckpoint:
    """Finished chunks of a job in a SQLite file, which may hold those of other jobs as well.

    place: path of the file; None for one without a name, which ends with this object or its
    process. name: of the job among those of the file. identity: what the chunks depend on,
    JSON-able; chunks of jobs that differ in any of it are never mixed. dtype: of the records.
    force: begin anew, whatever the file holds of a job of this name. warnings: receives a sentence
    for whatever turns out to be damaged. Raises CheckpointError if the file holds such a job, which
    may be a night of work, or something else is in its place; OSError if it cannot be used.
    """

    def __init__(
        self,
        place: Path | None,
        name: str,
        identity: Mapping[str, object],
        dtype,
        force: bool,
        warnings: list[str],
    ):
        self._db, self.place, self._name, self._dtype, self._force = None, place, name, dtype, force
        self._numbers: set[int] = set()  # of finished chunks
        self._entered = False  # whether the file is of this job
        self._identity, self.warnings = (
            json.dumps({"job": name, **identity}, sort_keys=True),
            warnings,
        )
        self._digest = hashlib.sha256(self._identity.encode()).digest()
        numbers = self._do(
            "SELECT number FROM chunks WHERE run = ? AND typeof(number) = 'integer'", self._digest
        )
        self._numbers = {number for (number,) in numbers}
        self._entered = True

    def __del__(self):
        self.close()

    def finished(self) -> list[int]:
        """Numbers of the finished chunks."""
        return sorted(self._numbers)

    def save(self, number: int, records: np.ndarray) -> None:
        """Write a finished chunk."""
        content = records.tobytes()
        row = (self._digest, number, self._checksum(number, content), content)
        self._do(
            "INSERT OR REPLACE INTO chunks (run, number, checksum, records) VALUES (?, ?, ?, ?)",
            *row,
        )
        self._numbers.add(number)

    def load(self, number: int) -> np.ndarray:
        """Read a finished chunk. Raises DamagedError if its row is not the one that was written
        for it."""
        # damaged, it may be a text
        row = "SELECT checksum, CAST(records AS BLOB) FROM chunks WHERE run = ? AND number = ?"
        rows = self._do(row, self._digest, number)
        if not rows or rows[0][0] != self._checksum(number, rows[0][1] or b""):
            raise DamagedError("it was damaged" if rows else "it is lost")
        return np.frombuffer(rows[0][1], self._dtype)

    def set_aside(self, number: int, why: Exception) -> None:
        """Let a chunk that cannot be used be computed again, and add a warning."""
        self._numbers.discard(number)
        self.warnings.append(
            f"{self.place}, chunk {number}: {why}; these slices are computed again"
        )

    def remove(self) -> None:
        """Remove the file, which is one step, or the rows of this job if the file has those of
        others."""
        other_runs = self._do("SELECT name FROM runs WHERE name != ?", self._name)
        if other_runs:
            self._forget()
        else:
            self._do("PRAGMA synchronous = OFF")  # what is removed need not be on the disk
        self._shut()
        for path in () if other_runs else self._files():
            path.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file, so that nothing is beside it; what comes next opens it again. One without
        a finished chunk is removed."""
        if self._db is not None and self._entered and not self._numbers:
            with suppress(OSError):
                self.remove()
        self._shut()

    def _shut(self):
        if self._db is not None:
            self._db.close()
            self._db = None

    def _checksum(self, number, content):
        return zlib.crc32(content, zlib.crc32(self._digest + number.to_bytes(8, "big")))

    def _files(self):
        if self.place:
            return [self.place.with_name(self.place.name + suffix) for suffix in BESIDE]
        return []

    def _do(self, statement, *values, again=False):
        """The rows of a statement; if the file is no checkpoint, or not any more, it is moved away,
        and a new one begun.

        Any error but one of OF_DISK means so: a single flipped bit may give a column another name.
        """
        import sqlite3

        try:
            if self._db is None:
                self._open(sqlite3)
            return self._db.execute(statement, values).fetchall()
        except (sqlite3.Error, UnicodeDecodeError) as error:
            code = getattr(error, "sqlite_errorcode", 0) & 0xFF
            hint = next(
                (
                    hint
                    for name, hint in OF_DISK.items()
                    if code == getattr(sqlite3, f"SQLITE_{name}")
                ),
                None,
            )
            if self.place is None or again or (hint is not None and not self._force):
                hint = hint or ""
                raise OSError(
                    errno.EIO, f"{error}{hint}", str(self.place or "a file of finished chunks")
                ) from error
            self._move_away(error)
        return self._do(statement, *values, again=True)

    def _open(self, sqlite3):
        """Open the file, and enter this job in it."""
        for path in self._files():
            if os.path.lexists(path) and not stat.S_ISREG(path.lstat().st_mode):
                raise CheckpointError(
                    f"{path}: expected a file of finished chunks, found something else; move it away"
                )
        if self.place:
            make_folders(self.place.parent)
        try:
            self._prepare(sqlite3, "")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF not in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_IOERR):
                raise
            self._shut()
            try:
                self._prepare(sqlite3, "&nolock=1")  # a file system without locks
            except sqlite3.OperationalError:
                raise error from None
        rows = self._db.execute(
            "SELECT digest, identity FROM runs WHERE name = ?", [self._name]
        ).fetchall()
        if self._force:
            self._forget()
        elif rows and rows[0][0] != self._digest and rows[0][1] != self._identity:
            raise self._of_another_run(rows[0][1])
        self._db.execute(
            "INSERT OR REPLACE INTO runs VALUES (?, ?, ?)",
            (self._name, self._digest, self._identity),
        )
        self._force = False  # it is anew, and will not be thrown away if the disk is full later on

    def _prepare(self, sqlite3, options):
        if self.place:
            address = f"{self.place.absolute().as_uri()}?mode=rwc{options}"
        else:
            address = ""
        self._db = sqlite3.connect(
            address, timeout=LOCK_SECONDS, isolation_level=None, check_same_thread=False, uri=True
        )
        # Format that SQLite has.
        if self.place and self.place.exists() and max(_formats(self.place), default=0) > 2:
            raise sqlite3.DatabaseError(
                "a file of an unknown format"
            )  # SQLite would call it read-only
        self._db.execute("PRAGMA synchronous = OFF")  # there are no chunks yet
        if self._db.execute("PRAGMA page_count").fetchall() == [(0,)]:
            self._db.execute("PRAGMA page_size = 65536")  # chunks have hundreds of kB
            self._db.executescript(TABLES)
        if self._db.execute("PRAGMA application_id").fetchall() != [(OURS,)]:
            raise sqlite3.DatabaseError("another program's database")
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = NORMAL")
        if (problems := self._db.execute("PRAGMA integrity_check(1)").fetchall()) != [
            ("ok",)
        ]:  # 0.1 s for a GB
            raise sqlite3.DatabaseError(problems[0][0])

    def _forget(self):
        """Remove the rows of this job."""
        self._db.execute("DELETE FROM runs WHERE name = ?", [self._name])
        self._db.execute("DELETE FROM chunks WHERE run NOT IN (SELECT digest FROM runs)")

    def _move_away(self, error):
        self._shut()
        for path in filter(Path.exists, self._files()):
            path.replace(path.with_name(path.name + DAMAGED))
        moved = f"it was moved to {self.place.name}{DAMAGED}, and its slices are computed again"
        self.warnings.append(f"{self.place}: {error}; {moved}")

    def _of_another_run(self, identity):
        try:
            ours, theirs = json.loads(self._identity), json.loads(identity)
            names = [
                f"{name} ({theirs.get(name)}, not {ours[name]})"
                for name in ours
                if theirs.get(name) != ours[name]
            ]
        except (ValueError, TypeError, AttributeError):
            names = ["words that cannot be read"]
        return CheckpointError(
            f"{self.place}: cannot go on from this checkpoint: it is of another run, which differs in {', '.join(names)}; "
            "remove the file, or give --restart to begin anew"
        )
