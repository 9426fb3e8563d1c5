"""All files of a table put in place as one step, which whoever comes next can finish or undo.

The files are written in a new folder `.<kind>.new-<random>` beside the results. When they are complete and on the disk, the
folder is renamed to `.<kind>.put-<random>`: this decides. Then each file is moved to its place, files that the new data package
does not list are removed, the package itself is moved, and the folder is removed. If the place has the same bytes already, or a
package that differs in facts of the run alone, as its date, the new file is removed instead: the old one keeps its time.
So a kill at any system call leaves one of two states:

- a `new` folder: nothing was decided, the old results are untouched, and the next run removes it;
- a `put` folder: as long as it holds the package, the next run does these steps again, before that looks at the results.

A table in parts is a folder of Parquet files, which is moved as one, as the folder of specs of `design` is; the folder or the
file in its place is put away first.
"""

import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from wavesweep.atomic_files import folders_named, is_folder, put, random_part, remove_folder, remove_old, sync
from wavesweep.errors import UsageError
from wavesweep.results.folder import BEST, DESIGNS, FIGURES, PARTS, SUFFIXES, are_designs, are_parts
from wavesweep.results.package import packaged_files, same_but_for_the_run

REPLACED = "replaced"  # the name, in the folder of new files, of a folder of parts whose place is needed
ORDER = (*SUFFIXES[:-1], ".md", SUFFIXES[-1])  # the package last: its hashes then vouch for files that are in place
NEW, PUT = "new", "put"
INSIDE = re.compile(f"{PARTS.pattern}|{DESIGNS.pattern}")  # names of files in folders that are moved as one


def new_folder(kind: str, directory: Path) -> Path:
    """Make a folder for the files of a table; on the same file system as their places, so that a rename moves them."""
    folder = directory / f".{kind}.{NEW}-{random_part()}"
    folder.mkdir(0o700)
    return folder


def abandon(kind: str, folder: Path) -> None:
    """Remove a folder whose files were not put in place, as far as that is possible now."""
    with suppress(OSError):
        for inner in (folder / f"{kind}.parquet", folder / BEST, folder / REPLACED):
            if is_folder(inner):
                remove_folder(inner, INSIDE)
        remove_folder(folder, re.compile("|".join(map(re.escape, _names(kind)))))


def put_in_place(kind: str, folder: Path, directory: Path) -> list[Path]:
    """Move the files of a table to their places and give their paths; figures and a CSV that its package does not list go."""
    files = [name for name in _names(kind) if (folder / name).exists()]
    for name in files:
        for part in sorted((folder / name).iterdir()) if is_folder(folder / name) else ():
            sync(part)
        sync(folder / name)
    sync(folder)
    decided = folder.with_name(folder.name.replace(f".{NEW}-", f".{PUT}-"))
    folder.rename(decided)
    try:
        _finish(kind, decided, directory)
    except BaseException:  # a signal, perhaps: it is decided, so the rest follows first
        _finish(kind, decided, directory)
        raise
    return [directory / name for name in files if name != BEST]


def settle(kinds: Iterable[str], directory: Path) -> None:
    """Finish or undo interrupted runs that wrote these tables. Raises OSError if decided results cannot be placed."""
    for kind in kinds:
        for folder in folders_named(directory, f".{kind}.{PUT}-"):
            _finish(kind, folder, directory)
        for folder in folders_named(directory, f".{kind}.{NEW}-"):
            abandon(kind, folder)
        remove_old(directory / f"{kind}.parquet", PARTS)


def refuse_folders(kinds: Iterable[str], directory: Path) -> None:
    """Raise UsageError if there is a folder in the place of a file of these tables that is none of Parquet parts or designs."""
    for kind in kinds:
        for place in (directory / name for name in _names(kind)):
            if place.name == BEST:
                if os.path.lexists(place) and not (is_folder(place) and are_designs(place)):
                    raise UsageError(f"{place}: expected designs of this program or none, found others; move it away")
            elif is_folder(place) and not (place.suffix == ".parquet" and are_parts(place)):
                raise UsageError(f"{place}: expected a file of results or none, found a folder; move it away")


def _finish(kind, decided, directory):
    """Do the rest of the steps; a folder whose package is in its place is removed if it is empty."""
    *others, package = _names(kind)
    sync(directory)
    if os.path.lexists(decided / package):
        for name in others:
            if os.path.lexists(decided / name):
                _make_way(decided, directory / name)
                if is_folder(decided / name):
                    (decided / name).replace(directory / name)
                else:
                    put(decided / name, directory / name)
        listed = packaged_files(decided / package)
        for name in (f"{kind}{suffix}" for suffix in (".csv", *FIGURES)):
            if listed and name not in listed:
                (directory / name).unlink(missing_ok=True)
        if same_but_for_the_run(decided / package, directory / package):
            (decided / package).unlink()
        else:
            (decided / package).replace(directory / package)
        sync(directory)
    with suppress(OSError):  # it holds files of somebody else, or may not be removed: tried again by the next run
        if is_folder(decided / REPLACED):
            remove_folder(decided / REPLACED, INSIDE)
        decided.rmdir()


def _make_way(decided, place):
    """Free a place that a rename cannot take over: a folder of parts is put away, and a file goes if a folder replaces it."""
    if is_folder(place):
        place.rename(decided / REPLACED)
    elif is_folder(decided / place.name):
        place.unlink(missing_ok=True)


def _names(kind):
    *others, package = (f"{kind}{suffix}" for suffix in ORDER)
    return [*others, *([BEST] if kind == "design" else ()), package]
