"""File-system steps that are done or not done after a kill.

New names have a random part, and files are made with O_EXCL and, if the system has it, O_NOFOLLOW.
"""

import errno
import filecmp
import os
import stat
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from wavesweep.core.platform_compat import OPEN, READ

_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.EACCES)  # folders of some file systems, or of other users


def random_part() -> str:
    """Twelve random hexadecimal digits."""
    return os.urandom(6).hex()


def read_file(path: Path) -> bytes:
    """The content of a regular file. Raises OSError, also if the path is a link, a folder or a device."""
    with open_file(path, OPEN) as file:
        return file.read()


def open_file(path: Path, how: int = READ) -> BinaryIO:
    """Open a regular file for reading; a link to one is followed. Raises OSError, at once also for a pipe or a device."""
    descriptor = os.open(path, how)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    return os.fdopen(descriptor, "rb")


def write_file(path: Path, *pieces: bytes) -> None:
    """Write a file under a temporary name and rename it, so that it is there whole or not at all."""
    write_files({path: pieces})


def write_files(files: Mapping[Path, Iterable[bytes]]) -> None:
    """Write files under temporary names, and rename them once all are written, so that each is there whole or not at all.

    Raises OSError with the path of the file that could not be written.
    """
    temporary, path = {}, None
    try:
        for path, pieces in files.items():
            scratch = path.with_name(f"{path.name}.{random_part()}.tmp")
            descriptor = os.open(scratch, os.O_WRONLY | os.O_CREAT | os.O_EXCL | OPEN, 0o666)
            temporary[path] = scratch
            with os.fdopen(descriptor, "wb") as file:
                file.writelines(pieces)
        for path in files:
            temporary[path].replace(path)
            del temporary[path]
    except OSError as error:  # which names the temporary file, or none if the disk is full
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        for scratch in temporary.values():
            with suppress(OSError):
                scratch.unlink()


def put(new: Path, place: Path) -> None:
    """Rename a file to its place; if a file with equal bytes is there, that one stays, with its time."""
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


def sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk; nothing is done if the file system does not offer it.

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
