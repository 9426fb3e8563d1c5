"""The files of a table put in place, with the data package last.

The files are written in a new folder `.<kind>.new-<random>` beside the results. When they are complete and on the disk, each
is renamed to its place. The package has the hashes of all of them, so its rename, the last one, is the commit mark: after a
kill before it, the old package and the files do not agree, which `verify` and the reader of a CSV notice, and the same command
gives the new results. If the place has the same bytes already, or a package that differs in facts of the run alone, such as its
date, the old file stays, with its time.

A table in parts is a folder of Parquet files, which is moved as one, as the folder of specs of `design` is; the folder or the
file in its place is moved away first.
"""

from pathlib import Path
from shutil import rmtree

from wavesweep.program.atomic_files import is_folder, put, random_part, sync
from wavesweep.program.results.folder import BEST, FIGURES, names_of
from wavesweep.program.results.package import packaged_files, same_but_for_the_run

REPLACED = "replaced"  # the name, in the folder of new files, of a file or folder whose place is needed


def new_folder(kind: str, directory: Path) -> Path:
    """Make the folder in which the files of a table are written."""
    folder = directory / f".{kind}.new-{random_part()}"
    folder.mkdir(0o700)
    return folder


def abandon(folder: Path) -> None:
    """Remove the folder with what was not put in place, as far as that is possible now."""
    rmtree(folder, ignore_errors=True)


def put_in_place(kind: str, folder: Path, directory: Path) -> list[Path]:
    """Move the files of a table to their places and give their paths; a figure or CSV that the package does not list goes."""
    *files, package = (name for name in names_of(kind) if (folder / name).exists())
    for name in (*files, package):
        for file in sorted((folder / name).iterdir()) if is_folder(folder / name) else ():
            sync(file)
        sync(folder / name)
    for name in sorted(files, key=lambda name: not name.endswith(".parquet")):  # it has the facts of the run as well
        new, place = folder / name, directory / name
        if is_folder(place) or (is_folder(new) and place.exists()):  # a rename cannot take its place
            place.rename(folder / f"{REPLACED}-{name}")
        if is_folder(new):
            new.rename(place)
        else:
            put(new, place)
    listed = packaged_files(folder / package)
    for suffix in (".csv", *FIGURES):
        if f"{kind}{suffix}" not in listed:
            (directory / f"{kind}{suffix}").unlink(missing_ok=True)
    sync(directory)
    if not same_but_for_the_run(folder / package, directory / package):
        (folder / package).replace(directory / package)
        sync(directory)
    return [directory / name for name in (*files, package) if name != BEST]
