"""Folders that a killed run left behind, told from those in which a run is at work by a lock that dies with it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # not on this system: nothing is locked there, and nothing removed
    fcntl = None


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
    """Remove the folders of that prefix in which nobody is at work."""
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
