"""File-system steps that are done or not done after a kill.

New names have a random part, and files are made with O_EXCL and, if the system has it, O_NOFOLLOW.
"""

import errno
import filecmp
import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from wavesweep.program.platform_compat import OPEN, READ

SCRATCH = ".wavesweep.new-"  # what the names of folders of incomplete files begin with
# folders of some file systems, or of other users
_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.EACCES)


def random_part() -> str:
    """Twelve random hexadecimal digits."""
    return os.urandom(6).hex()


def read_file(path: Path) -> bytes:
    """The content of a regular file. Raises OSError, also if the path is a link, a folder or a
    device."""
    with open_file(path, OPEN) as file:
        return file.read()


def open_file(path: Path, how: int = READ) -> BinaryIO:
    """Open a regular file for reading; a link to one is followed. Raises OSError, at once also
    for a pipe or a device."""
    descriptor = os.open(path, how)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    return os.fdopen(descriptor, "rb")


def write_file(path: Path, *pieces: bytes) -> None:
    """Write a file in a folder beside it and rename it, so that it is there whole or not at all."""
    write_files({path: pieces})


def write_files(files: Mapping[Path, Iterable[bytes]]) -> None:
    """Write files in a folder beside each, and rename them once all are written, so that each is
    there whole or not at all.

    Raises OSError with the path of the file that could not be written.
    """
    with ExitStack() as opened:
        folders = {
            parent: opened.enter_context(scratch(parent))
            for parent in dict.fromkeys(path.parent for path in files)
        }
        path = None
        try:
            for path, pieces in files.items():
                descriptor = os.open(
                    folders[path.parent] / path.name,
                    os.O_WRONLY | os.O_CREAT | os.O_EXCL | OPEN,
                    0o666,
                )
                with os.fdopen(descriptor, "wb") as file:
                    file.writelines(pieces)
            for path in files:
                (folders[path.parent] / path.name).replace(path)
        except OSError as error:  # which names the temporary file, or none if the disk is full
            raise OSError(error.errno, error.strerror or str(error), str(path)) from error


@contextmanager
def scratch(parent: Path) -> Iterator[Path]:
    """A new folder in `parent` for files that are not complete yet; what runs that were killed have
    left of such is removed.

    The folder is locked while it is used, and the lock ends with the process. Without locks,
    leftovers stay.
    """
    from shutil import rmtree

    for abandoned in parent.glob(f"{SCRATCH}*"):
        with suppress(OSError):
            if re.fullmatch("[0-9a-f]{12}", abandoned.name.removeprefix(SCRATCH)) and is_folder(
                abandoned
            ):
                lock = _held(abandoned, wait=False)
                rmtree(abandoned, ignore_errors=True)
                os.close(lock)
    while True:
        folder = parent / f"{SCRATCH}{random_part()}"
        try:
            folder.mkdir(0o700)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(parent)) from error
        try:
            lock = _held(folder, wait=True)
        except FileNotFoundError:  # another run took it for a leftover
            continue
        except OSError:  # a system without locks of folders
            lock = None
        if lock is None or os.fstat(lock).st_nlink:
            break
        os.close(lock)
    try:
        yield folder
    finally:
        rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _held(folder: Path, wait: bool) -> int:
    """Lock a folder and return what is closed to release it. Raises OSError if that cannot be,
    or not now and wait is false."""
    try:
        import fcntl
    except ImportError as error:  # Windows
        raise OSError(errno.ENOTSUP, "no locks of folders") from error
    descriptor = os.open(folder, READ)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def put(new: Path, place: Path) -> None:
    """Rename a file to its place; if a file with equal bytes is there, that one stays, with its
    time."""
    if place.is_file() and not place.is_symlink() and filecmp.cmp(new, place, shallow=False):
        new.unlink()
    else:
        new.replace(place)


def free_bytes(folder: Path) -> int:
    """Bytes that are free for us on the disk of a folder."""
    import shutil

    return shutil.disk_usage(folder).free


def make_folders(folder: Path) -> list[Path]:
    """Make a folder and its parents; the list of those that were missing, the innermost last."""
    made, missing = [], folder
    while not missing.exists() and missing != missing.parent:
        made.insert(0, missing)
        missing = missing.parent
    folder.mkdir(parents=True, exist_ok=True)
    return made


def remove_empty(folders: Sequence[Path]) -> None:
    """Remove folders that `make_folders` has made, as far as they are empty."""
    with suppress(OSError):
        for folder in reversed(folders):
            folder.rmdir()


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Make a folder for files; if they cannot be written, it is removed again as far as it is
    empty and was made here."""
    made = make_folders(folder)
    try:
        yield
    except BaseException:
        remove_empty(made)
        raise


def sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk; nothing is done if the file
    system does not offer it.

    The folder of results may be a link, which is followed.
    """
    try:
        descriptor = os.open(path, READ)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in _CANNOT_SYNC:
            raise


def is_folder(path: Path) -> bool:
    """Whether the path itself, not the target of a link, is a folder."""
    try:
        return stat.S_ISDIR(path.lstat().st_mode)
    except OSError:
        return False
