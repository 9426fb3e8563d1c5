"""One run at a time for a table of a folder: a lock of the operating system, which ends with the process that holds it."""

import errno
import os
import stat
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

from wavesweep.engine.arguments import boolean
from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.atomic_files import make_folders, read_file, sync
from wavesweep.program.platform_compat import OPEN
from wavesweep.program.results.folder import refuse_folders, refuse_unusable, remove_unfinished


@contextmanager
def at_work(
    kinds: Sequence[str],
    directory: str | Path,
    wait: bool = False,
    say: Callable[[str], None] = lambda _: None,
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
            path = directory / f".{kind}.lock"
            opened.callback(_release, path, _acquired(kind, path, wait, say))
            remove_unfinished(kind, directory)
            refuse_folders(kind, directory)
        for folder in made:
            sync(folder.parent)
        yield


def _acquired(kind: str, path: Path, wait: bool, say: Callable[[str], None]) -> Callable[[], None]:
    """What releases the lock of a table, once it is ours; its file has the name of the holder beside it."""
    holder = path.with_suffix(".holder")
    for file in (path, holder):
        if os.path.lexists(file) and not stat.S_ISREG(file.lstat().st_mode):
            raise UsageError(
                f"{file}: expected a lock file or none, found something else; move it away"
            )
    unlock = _locked(path, wait=False)
    while unlock is None:
        busy = f"{path.parent}: another run is at work on {kind} here{_name_in(holder)}"
        if not wait:
            raise WavesweepError(f"{busy}; give --wait to wait for it, or another --out")
        say(f"{busy}; waiting for it")
        unlock = _locked(path, wait=True)
    with suppress(OSError):  # the name is for people alone
        host = (
            os.uname().nodename
            if hasattr(os, "uname")
            else os.environ.get("COMPUTERNAME", "this machine")
        )
        since = time.strftime("%Y-%m-%d %H:%M:%S")
        holder.unlink(
            missing_ok=True
        )  # what another run left, whatever has taken its place meanwhile
        with os.fdopen(
            os.open(holder, os.O_WRONLY | os.O_CREAT | os.O_EXCL | OPEN, 0o644),
            "w",
            encoding="utf-8",
        ) as written:
            written.write(f"process {os.getpid()} on {host}, since {since}")
    return unlock


def _locked(path: Path, wait: bool) -> Callable[[], None] | None:
    """Lock a file; return what unlocks it, or None if another run has it. wait: wait until it has not."""
    try:
        import fcntl
    except ImportError:  # Windows
        return _locked_elsewhere(path, wait)
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | OPEN, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BaseException as error:
            os.close(descriptor)
            if isinstance(error, BlockingIOError):
                return None
            if isinstance(error, OSError) and error.errno in (
                errno.ENOSYS,
                errno.ENOTSUP,
            ):  # a file system without locks
                return _locked_elsewhere(path, wait)
            raise
        if os.fstat(descriptor).st_nlink:
            return partial(os.close, descriptor)
        os.close(descriptor)  # the run before removed the file while this one waited


def _locked_elsewhere(path: Path, wait: bool) -> Callable[[], None] | None:
    """`_locked` by filelock, whose import takes longer than all the rest of a lock."""
    from filelock import FileLock, Timeout

    lock = FileLock(path)
    try:
        lock.acquire(blocking=wait)
    except Timeout:
        return None
    return lock.release


def _name_in(holder: Path) -> str:
    """The name of the holder of a lock, in brackets; empty if it is not there yet."""
    try:
        return f" ({read_file(holder).decode()})"
    except (OSError, ValueError):
        return ""


def _release(path: Path, unlock: Callable[[], None]) -> None:
    """Remove the files of a lock while it is still held, so that they are nobody else's, and release it."""
    for file in (path.with_suffix(".holder"), path):
        with suppress(OSError):  # on Windows the lock's own file cannot go before the lock does
            file.unlink()
    unlock()


def _remove_empty(folders: Sequence[Path]) -> None:
    with suppress(OSError):
        for folder in reversed(folders):
            folder.rmdir()
