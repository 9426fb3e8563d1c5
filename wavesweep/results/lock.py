"""One run at a time for a table of a folder: a lock of the operating system, which ends with the process that holds it."""

import errno
import os
import stat
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from wavesweep.arguments import boolean
from wavesweep.atomic_files import make_folders, sync
from wavesweep.errors import UsageError, WavesweepError
from wavesweep.platform_compat import OPEN, lock
from wavesweep.results.folder import refuse_unusable
from wavesweep.results.placing import refuse_folders, settle

WORD = "wavesweep: "  # which a lock file of this program begins with
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EINVAL)


@contextmanager
def at_work(
    kinds: Sequence[str], directory: str | Path, wait: bool = False, say: Callable[[str], None] = lambda _: None
) -> Iterator[None]:
    """Be the only run that writes tables of these kinds in the directory, which is made if it is missing.

    First, an interrupted run that wrote these tables is finished or undone. At the end, the lock files are removed, and
    the directory if it is still empty and was made here. wait: wait for another run; if false, it is an error. say: is
    called with a sentence if there is something to wait for, or if the file system has no locks.
    Raises WavesweepError if another run is at work, UsageError if the directory cannot be used.
    """
    directory, wait = Path(directory), boolean("wait", wait)
    refuse_unusable(directory)
    made, said = make_folders(directory), []

    def once(text):
        if text not in said:
            said.append(text)
            say(text)

    with ExitStack() as opened:
        opened.callback(_remove_empty, made)
        for kind in kinds:
            opened.callback(_release, *_acquired(kind, directory, wait, once))
        settle(kinds, directory)
        refuse_folders(kinds, directory)
        for folder in made:
            sync(folder.parent)
        yield


def _acquired(kind, directory, wait, say) -> tuple[Path, int]:
    """The path of the lock file and its descriptor, once the lock is ours."""
    path = directory / f".{kind}.lock"
    while True:
        descriptor = _opened(path)
        try:
            if not _locked(descriptor, path, kind, wait, say):
                return path, descriptor
            if _is_still(path, descriptor):  # and was not removed by its last holder meanwhile
                _sign(descriptor)
                return path, descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _opened(path):
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | OPEN, 0o666)
    except FileNotFoundError:  # another run has just removed the folder, which was empty
        make_folders(path.parent)
        return _opened(path)
    except PermissionError:
        descriptor = os.open(path, os.O_RDONLY | OPEN)  # somebody else's, which can be locked but not signed
    except OSError as error:
        if error.errno not in (errno.ELOOP, errno.EISDIR):
            raise
        raise UsageError(f"{path}: expected a lock file, found a link or a folder; move it away") from error
    found = os.read(descriptor, len(WORD)) if stat.S_ISREG(os.fstat(descriptor).st_mode) else b"?"
    if found not in (b"", WORD.encode()):
        os.close(descriptor)
        raise UsageError(f"{path}: expected a lock file of this program, found something else; move it away")
    return descriptor


def _locked(descriptor, path, kind, wait, say) -> bool:
    """Lock the file; False if its file system has no locks."""
    try:
        lock(descriptor, wait=False)
    except BlockingIOError as error:
        busy = f"{path.parent}: another run is at work on {kind} here{_holder(descriptor)}"
        if not wait:
            raise WavesweepError(f"{busy}; give --wait to wait for it, or another --out") from error
        say(f"{busy}; waiting for it")
        lock(descriptor, wait=True)
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        say(f"{path.parent}: this file system has no locks; do not start a second run in this folder before this one ends")
        return False
    return True


def _is_still(path, descriptor):
    with suppress(FileNotFoundError):
        return os.path.samestat(os.lstat(path), os.fstat(descriptor))
    return False


def _sign(descriptor):
    """Write who has the lock and since when, for whoever asks."""
    import socket

    since = time.strftime("%Y-%m-%d %H:%M:%S")
    with suppress(OSError):  # nobody needs it to work
        os.ftruncate(descriptor, 0)
        os.lseek(descriptor, 0, os.SEEK_SET)
        os.write(descriptor, f"{WORD}process {os.getpid()} on {socket.gethostname()}, since {since}\n".encode())


def _holder(descriptor):
    """The signature in the lock file, in brackets; empty if it is not there yet."""
    os.lseek(descriptor, 0, os.SEEK_SET)
    line = os.read(descriptor, 200).decode("ascii", "replace").partition("\n")[0].removeprefix(WORD)
    return f" ({line})" if line.isprintable() and line else ""


def _release(path, descriptor):
    """Remove the lock file while it is still locked, and close it, which ends the lock."""
    try:
        with suppress(OSError):
            if _is_still(path, descriptor):
                path.unlink()
    finally:
        os.close(descriptor)


def _remove_empty(folders):
    with suppress(OSError):
        for folder in reversed(folders):
            folder.rmdir()
