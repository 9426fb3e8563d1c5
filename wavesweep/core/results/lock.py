"""One run at a time for a table of a folder: a lock of the operating system, which ends with the process that holds it."""

import os
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from wavesweep.core.arguments import boolean
from wavesweep.core.atomic_files import make_folders, sync
from wavesweep.core.errors import UsageError, WavesweepError
from wavesweep.core.results.folder import refuse_folders, refuse_unusable, remove_unfinished


@contextmanager
def at_work(
    kinds: Sequence[str], directory: str | Path, wait: bool = False, say: Callable[[str], None] = lambda _: None
) -> Iterator[None]:
    """Be the only run that writes tables of these kinds in the directory, which is made if it is missing.

    First, what an interrupted run left of these tables is removed. At the end the lock files are removed, and the directory
    if it is still empty and was made here. wait: wait for another run; if false, it is an error. say: is called with a sentence
    if there is something to wait for.
    Raises WavesweepError if another run is at work, UsageError if the directory cannot be used.
    """
    directory, wait = Path(directory), boolean("wait", wait)
    refuse_unusable(directory)
    made = make_folders(directory)
    with ExitStack() as opened:
        opened.callback(_remove_empty, made)
        for kind in kinds:
            opened.callback(_release, _acquired(kind, directory, wait, say))
            remove_unfinished(kind, directory)
            refuse_folders(kind, directory)
        for folder in made:
            sync(folder.parent)
        yield


def _acquired(kind: str, directory: Path, wait: bool, say: Callable[[str], None]) -> Any:
    """The lock of a table, once it is ours; its file has the name of the holder beside it."""
    from filelock import FileLock, Timeout

    path = directory / f".{kind}.lock"
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise UsageError(f"{path}: expected a lock file or none, found something else; move it away")
    lock, holder = FileLock(path), path.with_suffix(".holder")
    try:
        lock.acquire(blocking=False)
    except Timeout as error:
        busy = f"{directory}: another run is at work on {kind} here{_name_in(holder)}"
        if not wait:
            raise WavesweepError(f"{busy}; give --wait to wait for it, or another --out") from error
        say(f"{busy}; waiting for it")
        lock.acquire()
    with suppress(OSError):  # the name is for people alone
        since = time.strftime("%Y-%m-%d %H:%M:%S")
        holder.write_text(f"process {os.getpid()} on {socket.gethostname()}, since {since}", encoding="utf-8")
    return lock


def _name_in(holder: Path) -> str:
    """The name of the holder of a lock, in brackets; empty if it is not there yet."""
    try:
        return f" ({holder.read_text(encoding='utf-8')})"
    except (OSError, ValueError):
        return ""


def _release(lock: Any) -> None:
    """Remove the files of a lock while it is still held, so that they are nobody else's, and release it."""
    path = Path(lock.lock_file)
    for file in (path.with_suffix(".holder"), path):
        with suppress(OSError):  # on Windows the lock's own file cannot go before the lock does
            file.unlink()
    lock.release()


def _remove_empty(folders: Sequence[Path]) -> None:
    with suppress(OSError):
        for folder in reversed(folders):
            folder.rmdir()
