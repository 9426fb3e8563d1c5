"""One run at a time for a table of a folder, by the locks of filelock, which end with the process that holds them."""

import os
import platform
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from wavesweep.engine.arguments import boolean
from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.atomic_files import make_folders, read_file, remove_empty, sync
from wavesweep.program.results.folder import refuse_folders, refuse_unusable, remove_unfinished

if TYPE_CHECKING:
    from filelock import BaseFileLock


@contextmanager
def at_work(
    kinds: Sequence[str],
    directory: str | Path,
    wait: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> Iterator[None]:
    """Be the only run that writes tables of these kinds in the directory, which is made if it is missing.

    First, what an interrupted run left of these tables is removed. At the end the lock files are
    removed, and the directory if it is still empty and was made here. wait: wait for another run;
    if false, it is an error. say: is called with a sentence if there is something to wait for.
    Raises WavesweepError if another run is at work, UsageError if the directory cannot be used.
    """
    directory, wait = Path(directory), boolean("wait", wait)
    refuse_unusable(directory)
    made = make_folders(directory)
    with ExitStack() as opened:
        opened.callback(remove_empty, made)
        for kind in kinds:
            path = directory / f".{kind}.lock"
            opened.callback(_release, path, _lock(kind, path, wait, say))
            remove_unfinished(kind, directory)
            refuse_folders(kind, directory)
        for folder in made:
            sync(folder.parent)
        yield


def _lock(kind: str, path: Path, wait: bool, say: Callable[[str], None]) -> "BaseFileLock":
    """The lock of a table, once it is ours; a file beside it has process and host of the holder, and
    is the lock itself where the file system refuses locks, in whichever way."""
    from filelock import FileLock, SoftFileLock, Timeout

    holder = path.with_suffix(".holder")
    for file in (path, holder):
        if os.path.lexists(file) and not stat.S_ISREG(file.lstat().st_mode):
            raise UsageError(
                f"{file}: expected a lock file or none, found something else; move it away"
            )

    def acquired(lock: "BaseFileLock", hint: str) -> "BaseFileLock":
        try:
            lock.acquire(blocking=False)
        except Timeout:
            busy = f"{path.parent}: another run is at work on {kind} here{_name_in(holder)}"
            if not wait:
                raise WavesweepError(
                    f"{busy}; give --wait to wait for it, or another --out{hint}"
                ) from None
            say(f"{busy}; waiting for it{hint}")
            lock.acquire()
        return lock

    try:
        lock = acquired(FileLock(path, fallback_to_soft=False), "")
    except OSError:
        hint = f" (the file system has no locks: if that process has ended, remove {holder})"
        return acquired(SoftFileLock(holder), hint)
    with suppress(OSError):
        holder.unlink(missing_ok=True)
        with holder.open("x", encoding="utf-8") as written:
            written.write(f"{os.getpid()}\n{platform.node()}\n")
    return lock


def _name_in(holder: Path) -> str:
    """The holder of a lock, in brackets; empty if its file is not there yet."""
    try:
        process, host, *_ = read_file(holder).decode().split("\n")
    except (OSError, ValueError):
        return ""
    return f" (process {process} on {host})"


def _release(path: Path, lock: "BaseFileLock") -> None:
    """Remove the files of a lock while it is still held, so that they are nobody else's, and release it."""
    for file in (path.with_suffix(".holder"), path):
        with suppress(OSError):  # on Windows the lock's own file cannot go before the lock does
            file.unlink()
    lock.release()
