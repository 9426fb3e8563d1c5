"""Where the files of commands go: the folder of a spec, places that are refused, and files written whole or not at all."""

import os
import re
import stat
from collections.abc import Iterable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from wavesweep.engine.errors import UsageError
from wavesweep.program.atomic_files import read_file, write_files

LETTERS_SHOWN = 60  # of a name that is too long for a file, in its message


def own_folder(names: Iterable[str], overrides: Iterable[str]) -> Path:
    """Return the folder for results without --out: `mine`, or `mine,b=40` with --set b=40, which keeps the spec's own results.

    Characters other than letters, digits and . = , + - become _, for all file systems and shells.
    If something was changed or cut off, a digest distinguishes such names.
    """
    stems, said = "+".join(names), ",".join(overrides)
    # Letters of what --set changes, in the name of a folder.
    plain = re.sub(r"[^\w.=,+-]+", "_", said, flags=re.ASCII)[:80].rstrip(".")
    digest = "" if plain == said else f"-{sha256(said.encode()).hexdigest()[:8]}"
    return Path("results", f"{stems},{plain}{digest}" if said else stems)


def refuse_other_things(*files: Path) -> None:
    """Raise UsageError if something else than a file is in the place of one of these, or a name is too long."""
    for path in files:
        try:
            mode = path.lstat().st_mode
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as error:
            raise UsageError(
                f"{str(path)[:LETTERS_SHOWN]}: {error.strerror}; choose another name"
            ) from error
        if not stat.S_ISREG(mode):
            if stat.S_ISLNK(mode):
                kind = "a link"
            elif stat.S_ISDIR(mode):
                kind = "a folder"
            else:
                kind = "a pipe or a device"
            raise UsageError(
                f"{path}: expected a file or none, found {kind}; move it away, or choose another name"
            )


def refuse_inputs(read: Iterable[str | Path], *written: Path) -> None:
    """Raise UsageError if a command would replace a file that it reads, or a folder with one in it.

    read: paths of files; one that does not exist, or cannot be looked at, is left to what reads it.
    """
    places = [place for place in written if place.exists()]
    for source in (Path("/dev/stdin" if str(name) == "-" else name) for name in read if places):
        with suppress(OSError):
            resolved = source.resolve(strict=True)
            for place in places:
                if any(place.samefile(file) for file in (source, resolved, *resolved.parents)):
                    raise UsageError(
                        f"{place}: expected a place for results, found {source}, which is read; choose another one"
                    )


def refuse_no_folder(target: Path) -> None:
    """Raise UsageError for a file in a folder that does not exist, or that may not be written to, or in place of no file."""
    refuse_other_things(target)
    if target.parent.is_dir() and not os.access(target.parent, os.W_OK | os.X_OK):
        raise UsageError(f"{target}: the folder may not be written to; name a file in another one")
    if not target.parent.is_dir():
        raise UsageError(
            f"{target}: expected a file in a folder that exists, found no folder {target.parent}; make it first"
        )


def write_whole(*files: tuple[Path, str], overwrite: bool = True, expected: str = "") -> None:
    """Write files whole, each given by its path and text; none of them is touched if one does not fit the disk.

    Without `overwrite`, UsageError if one is there with another content; expected: the end of its
    message. One with the same content is no reason to refuse: a run that was killed may have put
    some of the files in place.
    """
    contents = {target: text.encode(errors="backslashreplace") for target, text in files}
    for target, content in contents.items():
        refuse_no_folder(target)
        if not overwrite and target.exists() and read_file(target) != content:
            raise UsageError(f"{target}: the file exists; expected {expected}")
    write_files({target: [content] for target, content in contents.items()})
