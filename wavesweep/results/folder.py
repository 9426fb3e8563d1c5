"""The folder of the results: files of earlier runs and the specs that made them, and leftovers of killed runs.

Tables are written in a folder of their own inside it. A run at work holds a lock there, which dies with the run.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from wavesweep.errors import UsageError
from wavesweep.results.package import packaged_sha256

try:
    import fcntl
except ImportError:  # not on this system: nothing is locked there, and nothing removed
    fcntl = None

SUFFIXES = (".csv", ".parquet", ".png", ".datapackage.json")


def refuse_other_spec(kind: str, directory: str | Path, sha256: str) -> None:
    """Raise UsageError if the directory holds a table of this kind that another spec made, or an unknown one.

    sha256: the digest of the spec. Results of the same spec may be replaced: the new ones are equal.
    """
    found = existing_sha256(kind, directory)
    if found is None or found == sha256:
        return
    maker = f"another spec (SHA-256 {found[:12]}…, this one has {sha256[:12]}…)" if found else "an unknown origin"
    raise UsageError(f"{Path(directory) / kind}.*: found results of {maker}; give --force to replace them, or another --out")


def existing_sha256(kind: str, directory: str | Path) -> str | None:
    """Give the SHA-256 of the spec of the results in the folder: "" if it is unknown, None if there are no results."""
    files = [Path(directory) / f"{kind}{suffix}" for suffix in SUFFIXES]
    if not any(file.exists() for file in files):
        return None
    # Files without a readable package of ours belong to somebody as well, and are not replaced.
    return packaged_sha256(files[-1])


def discard(kind: str, directory: str | Path) -> None:
    """Remove the files of the table `kind` in a directory, if there are any; `refuse_other_spec` has checked their spec."""
    for suffix in SUFFIXES:
        (Path(directory) / f"{kind}{suffix}").unlink(missing_ok=True)


def refuse_unusable(directory: str | Path) -> None:
    """Raise UsageError if `directory`, the folder for the results, is a file, or cannot be made or written to."""
    place = Path(directory).absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    if not place.is_dir():
        raise UsageError(f"{directory}: {place} is a file; name another folder for the results")
    if not os.access(place, os.W_OK | os.X_OK):
        raise UsageError(f"{directory}: {place} may not be written to; name another folder for the results")


@contextmanager
def at_work_in(folder: Path) -> Iterator[None]:
    """Hold the folder's lock."""
    lock = _try_to_lock(folder)
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)


def remove_leftovers(directory: Path, prefix: str) -> None:
    """Remove the folders with this prefix that no run has locked."""
    for folder in directory.glob(f"{prefix}*"):
        lock = _try_to_lock(folder)
        if lock is not None:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(lock)


def _try_to_lock(folder: Path) -> int | None:
    if fcntl is None:
        return None
    try:
        lock = os.open(folder, os.O_RDONLY)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        return None
    return lock
