"""All files of a table put in place as one step, which whoever comes next can finish or undo.

The files are written in a new folder `.<kind>.new-<random>` beside the results. When they are complete and on the disk, with a
journal that lists them, the folder is renamed to `.<kind>.put-<random>`: this decides. Then each file is moved to its place,
the data package last, and the journal and the folder are removed. So a kill at any system call leaves one of two states:

- a `new` folder: nothing was decided, the old results are untouched, and the next run removes it;
- a `put` folder: all that it still holds is moved by the next run, before that looks at the results.

A table in parts is a folder of Parquet files, which is moved as one; the folder or the file in its place is put away first.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from wavesweep.disk import folders_named, is_folder, random_part, read_file, remove_folder, remove_old, sync
from wavesweep.errors import UsageError
from wavesweep.results.folder import FIGURES, PARTS, SUFFIXES, are_parts, existing_facts

JOURNAL = "journal.json"
REPLACED = "replaced"  # the name, in the folder of new files, of a folder of parts whose place is needed
ORDER = (*SUFFIXES[:-1], ".md", SUFFIXES[-1])  # the package last: its hashes then vouch for files that are in place
BEST, DESIGN = "best", re.compile(r"[^/]+\.toml")  # the folder of specs beside a table of designs
NEW, PUT = "new", "put"


def new_folder(kind: str, directory: Path) -> Path:
    """Make a folder for the files of a table; on the same file system as their places, so that a rename moves them."""
    folder = directory / f".{kind}.{NEW}-{random_part()}"
    folder.mkdir(0o700)
    return folder


def abandon(kind: str, folder: Path) -> None:
    """Remove a folder whose files were not put in place, as far as that is possible now."""
    with suppress(OSError):
        for parts in (folder / f"{kind}.parquet", folder / REPLACED):
            if is_folder(parts):
                remove_folder(parts, PARTS)
        remove_folder(folder / BEST, DESIGN)
        remove_folder(folder, _ours(kind))


def put_in_place(kind: str, folder: Path, directory: Path, sha256: str, beside: Iterable[str] = ()) -> list[Path]:
    """Move the files of a table, and those beside it, to their places and give the paths of the former.

    Figures of another spec (not `sha256`) are removed, a CSV if the new table has none, and what was beside the old table.
    """
    files = [f"{kind}{suffix}" for suffix in ORDER if (folder / f"{kind}{suffix}").exists()]
    found, places = existing_facts(kind, directory) or {}, [*beside, *files]
    figures = FIGURES if found.get("spec_sha256") != sha256 else ()
    old = [*(f"{kind}{suffix}" for suffix in (".csv", *figures)), *found.get("best", ())]
    stale = [name for name in old if name not in places]
    (folder / JOURNAL).write_text(json.dumps({"place": places, "remove": stale}), encoding="utf-8")
    for name in (*places, JOURNAL):
        for part in sorted((folder / name).iterdir()) if is_folder(folder / name) else ():
            sync(part)
        sync(folder / name)
    for each in (*(folder / BEST for _ in beside), folder):
        sync(each)
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
        remove_old(directory / f"{kind}.parquet", PARTS)


def refuse_folders(kinds: Iterable[str], directory: Path) -> None:
    """Raise UsageError if there is a folder in the place of a file of these tables, unless it is one of Parquet parts."""
    for kind in kinds:
        for place in (directory / f"{kind}{suffix}" for suffix in ORDER):
            if is_folder(place) and not (place.suffix == ".parquet" and are_parts(place)):
                raise UsageError(f"{place}: expected a file of results or none, found a folder; move it away")


def _finish(kind, decided, directory):
    """Do the rest of the steps in the journal; a folder without a journal is removed if it is empty."""
    try:
        journal = json.loads(read_file(decided / JOURNAL))
        ours = re.compile(f"{_ours(kind).pattern}|{BEST}/{DESIGN.pattern}")
        place, stale = ([name for name in journal[verb] if ours.fullmatch(name)] for verb in ("place", "remove"))
    except (FileNotFoundError, ValueError, KeyError, TypeError, RecursionError):
        place, stale = [], []
    sync(directory)
    for name in place:
        if os.path.lexists(decided / name):
            (directory / name).parent.mkdir(exist_ok=True)
            _make_way(decided, directory / name)
            (decided / name).replace(directory / name)
    for name in stale:
        (directory / name).unlink(missing_ok=True)
    if place:
        sync(directory)
        (decided / JOURNAL).unlink()
    with suppress(OSError):  # it holds files of somebody else, or may not be removed: tried again by the next run
        if is_folder(decided / REPLACED):
            remove_folder(decided / REPLACED, PARTS)
        if is_folder(decided / BEST):
            (decided / BEST).rmdir()
        decided.rmdir()


def _make_way(decided, place):
    """Free a place that a rename cannot take over: a folder of parts is put away, and a file goes if a folder replaces it."""
    if is_folder(place):
        place.rename(decided / REPLACED)
    elif is_folder(decided / place.name):
        place.unlink(missing_ok=True)


def _ours(kind):
    return re.compile("|".join(re.escape(f"{kind}{suffix}") for suffix in ORDER) + f"|{re.escape(JOURNAL)}")
