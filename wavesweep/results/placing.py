"""All files of a table put in place as one step, which whoever comes next can finish or undo.

The files are written in a new folder `.<kind>.new-<random>` beside the results. When they are complete and on the disk, with a
journal that lists them, the folder is renamed to `.<kind>.put-<random>`: this decides. Then each file is moved to its place,
the data package last, and the journal and the folder are removed. So a kill at any system call leaves one of two states:

- a `new` folder: nothing was decided, the old results are untouched, and the next run removes it;
- a `put` folder: all that it still holds is moved by the next run, before that looks at the results.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from wavesweep.errors import UsageError
from wavesweep.results.folder import FIGURES, SUFFIXES, existing_facts
from wavesweep.sweep.disk import folders_named, is_folder, random_part, read_file, remove_folder, sync

JOURNAL = "journal.json"
ORDER = (*SUFFIXES[:-1], ".md", SUFFIXES[-1])  # the package last: its hashes then vouch for files that are in place
NEW, PUT = "new", "put"


def new_folder(kind: str, directory: Path) -> Path:
    """Make a folder for the files of a table; on the same file system as their places, so that a rename moves them."""
    folder = directory / f".{kind}.{NEW}-{random_part()}"
    folder.mkdir(0o700)
    return folder


def abandon(kind: str, folder: Path) -> None:
    """Remove a folder whose files were not put in place, as far as that is possible now."""
    with suppress(OSError):
        remove_folder(folder, _ours(kind))


def put_in_place(kind: str, folder: Path, directory: Path, sha256: str) -> list[Path]:
    """Move the files of a table to their places and give their paths; figures of another spec (not `sha256`) are removed."""
    files = [f"{kind}{suffix}" for suffix in ORDER if (folder / f"{kind}{suffix}").exists()]
    other = (existing_facts(kind, directory) or {}).get("spec_sha256") != sha256
    stale = [name for suffix in FIGURES if other and (name := f"{kind}{suffix}") not in files]
    (folder / JOURNAL).write_text(json.dumps({"place": files, "remove": stale}), encoding="utf-8")
    for name in (*files, JOURNAL):
        sync(folder / name)
    sync(folder)
    decided = folder.with_name(folder.name.replace(f".{NEW}-", f".{PUT}-"))
    folder.rename(decided)
    try:
        _finish(kind, decided, directory)
    except BaseException:  # a signal, perhaps: it is decided, so the rest follows first
        _finish(kind, decided, directory)
        raise
    return [directory / name for name in files]


def settle(kinds: Iterable[str], directory: Path) -> None:
    """Finish or undo interrupted runs that wrote these tables. Raises OSError if decided results cannot be placed."""
    for kind in kinds:
        for folder in folders_named(directory, f".{kind}.{PUT}-"):
            _finish(kind, folder, directory)
        for folder in folders_named(directory, f".{kind}.{NEW}-"):
            abandon(kind, folder)


def refuse_folders(kinds: Iterable[str], directory: Path) -> None:
    """Raise UsageError if there is a folder in the place of a file of these tables, which could never be put there."""
    for kind in kinds:
        for place in (directory / f"{kind}{suffix}" for suffix in ORDER):
            if is_folder(place):
                raise UsageError(f"{place}: expected a file of results or none, found a folder; move it away")


def _finish(kind, decided, directory):
    """Do the rest of the steps in the journal; a folder without a journal is removed if it is empty."""
    try:
        journal = json.loads(read_file(decided / JOURNAL))
        place, stale = ([name for name in journal[verb] if _ours(kind).fullmatch(name)] for verb in ("place", "remove"))
    except (FileNotFoundError, ValueError, KeyError, TypeError, RecursionError):
        place, stale = [], []
    sync(directory)
    for name in place:
        if os.path.lexists(decided / name):
            (decided / name).replace(directory / name)
    for name in stale:
        (directory / name).unlink(missing_ok=True)
    if place:
        sync(directory)
        (decided / JOURNAL).unlink()
    with suppress(FileNotFoundError):
        _remove_empty(decided)


def _remove_empty(folder):
    with suppress(OSError):  # it holds files of somebody else, or may not be removed: tried again by the next run
        folder.rmdir()


def _ours(kind):
    return re.compile("|".join(re.escape(f"{kind}{suffix}") for suffix in ORDER) + f"|{re.escape(JOURNAL)}")
