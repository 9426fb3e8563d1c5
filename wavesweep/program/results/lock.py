"""One run at a time for a table of a folder: a lock of the operating system, which ends with the process that holds it."""

import os
import re
import stat
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

from wavesweep.engine.arguments import boolean
from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.atomic_files import (
    make_folders,
    random_part,
    read_file,
    remove_empty,
    sync,
)
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
    try:
        return _locked(path, holder, wait=False)
    except _TakenError as taken:
        busy = f"{path.parent}: another run is at work on {kind} here{_name_in(holder)}"
        if not wait:
            raise WavesweepError(
                f"{busy}; give --wait to wait for it, or another --out{taken}"
            ) from None
        say(f"{busy}; waiting for it{taken}")
    return _locked(path, holder, wait=True)


class _TakenError(Exception):
    """Another run has the lock; the text is a hint, or empty."""


def _locked(path: Path, holder: Path, wait: bool) -> Callable[[], None]:
    """Lock a file and write the holder's name beside it; return what unlocks it. wait: wait until another run has not.

    Where the file system refuses locks, in whichever way, the file with the holder's name is the
    lock. Raises _TakenError if another run has it.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        unlock = _locked_elsewhere(path, wait)
        _name_holder(holder)
        return unlock
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | OPEN, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BaseException as error:
            os.close(descriptor)
            if isinstance(error, BlockingIOError):
                raise _TakenError from None
            if isinstance(error, OSError):
                return _locked_by_name(holder, wait)
            raise
        if os.fstat(descriptor).st_nlink:
            _name_holder(holder)
            return partial(os.close, descriptor)
        os.close(descriptor)  # the run before removed the file while this one waited


def _name_holder(holder: Path) -> None:
    """Write who holds a lock of the operating system, for people alone, in place of what another run left."""
    with suppress(OSError):
        holder.unlink(missing_ok=True)
        _write_name(holder)


def _write_name(holder: Path) -> None:
    """Write process and host into a new file. Raises FileExistsError if there is one."""
    since = time.strftime("%Y-%m-%d %H:%M:%S")
    with os.fdopen(
        os.open(holder, os.O_WRONLY | os.O_CREAT | os.O_EXCL | OPEN, 0o644),
        "w",
        encoding="utf-8",
    ) as written:
        written.write(f"process {os.getpid()} on {_host()}, since {since}")


def _host() -> str:
    if hasattr(os, "uname"):
        return os.uname().nodename
    return os.environ.get("COMPUTERNAME", "this machine")


def _locked_by_name(holder: Path, wait: bool) -> Callable[[], None]:
    """`_locked` by a file that one process alone can make. That of a process of this host that has ended is removed.

    `_release` removes the file, so that nothing else unlocks it.
    """
    while True:
        try:
            _write_name(holder)
        except FileExistsError:
            if not _ended(holder):
                if not wait:
                    raise _TakenError(
                        f" (the file system has no locks: if that process has ended, remove {holder})"
                    ) from None
                time.sleep(0.2)  # s, while a run waits for a file that is a lock
        else:
            return lambda: None


def _ended(holder: Path) -> bool:
    """Whether the process that a file names was of this host and has ended; then the file is moved away.

    It is read once more under a name of its own: another run may have removed it and made its own
    meanwhile.
    """
    written = _name_of_ended(holder)
    if not written:
        return not os.path.lexists(holder)
    aside = holder.with_name(f"{holder.name}.{random_part()}")
    with suppress(OSError):
        holder.rename(aside)
        if read_file(aside) != written:
            with suppress(OSError):
                os.link(aside, holder)
        aside.unlink()
    return True


def _name_of_ended(holder: Path) -> bytes:
    """What a file says of a process of this host that has ended, empty if it does not."""
    try:
        written = read_file(holder)
    except OSError:
        return b""
    named = re.match(rf"process (\d+) on {re.escape(_host())}, since ".encode(), written)
    if not named:
        return b""
    try:
        os.kill(int(named[1]), 0)
    except (ProcessLookupError, OverflowError):
        return written
    except OSError:  # another user's
        return b""
    return b""


def _locked_elsewhere(path: Path, wait: bool) -> Callable[[], None]:
    """`_locked` by filelock, for systems without locks of POSIX. Raises _TakenError if another run has it."""
    from filelock import FileLock, Timeout

    lock = FileLock(path)
    try:
        lock.acquire(blocking=wait)
    except Timeout:
        raise _TakenError from None
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
