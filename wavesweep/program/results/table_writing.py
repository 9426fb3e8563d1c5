"""Tables into files or to a stream, block by block; all of a table's files appear whole, or none does.

The files are written in a new folder `.<kind>.new-<random>` beside the results. When they are
complete and on the disk, each is renamed to its place. The package has the hashes of all of them,
so its rename, the last one, is the commit mark: after a kill before it, the old package and the
files do not agree, which `verify` and the reader of a CSV notice, and the same command gives the
new results. If the place has the same bytes already, or a package that differs in facts of the run
alone, such as its date, the old file stays, with its time.

A table in parts is a folder of Parquet files, which is moved as one, as the folder of specs of
`design` is; the folder or the file in its place is moved away first.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, closing, nullcontext
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from shutil import copyfileobj, rmtree
from tempfile import SpooledTemporaryFile, TemporaryDirectory
from typing import Any, BinaryIO

from wavesweep.engine.arguments import boolean
from wavesweep.engine.errors import UsageError
from wavesweep.program.atomic_files import is_folder, put, random_part, scratch, sync
from wavesweep.program.columns import Columns, joined
from wavesweep.program.results.folder import (
    FIGURES,
    existing_facts,
    names_of,
    refuse_other_spec,
)
from wavesweep.program.results.lock import at_work
from wavesweep.program.results.package import (
    BEST,
    OWN_FACTS,
    package_text,
    packaged_files,
    same_but_for_the_run,
)
from wavesweep.program.results.table_files import (
    GROUP_ROWS,
    ParquetFile,
    csv_header,
    csv_rows,
)
from wavesweep.program.tables.columns import checked, fields_of
from wavesweep.program.tables.fields import Field
from wavesweep.program.tables.table import Table

# the name, in the folder of new files, of a file or folder whose place is needed
REPLACED = "replaced"


def publish(
    table: Table,
    directory: str | Path,
    overwrite: bool = False,
    formats: Iterable[str] = ("png",),
    locked: bool = False,
) -> list[Path]:
    """Write a table as CSV and Parquet, its figure and text if it has some, and the data package; give their paths.

    Everything is written in a temporary folder beside the results and put in place at the end, the
    package last; a figure that another spec left behind is removed. How the rows are cut into
    blocks leaves no trace in the bytes.

    table      its facts need `spec_sha256`; those of OWN_FACTS stay out of the Parquet file, so that equal runs give equal
               bytes in any folder
    directory  made if it is missing
    overwrite  replace results of another spec; those of the same file (`spec_place`) are replaced in any case
    formats    of the figure: png, svg, pdf, eps
    locked     the caller is `at_work` on this table; if not, the call waits until no other run is

    Raises UsageError if the directory holds results of another spec, WavesweepError if the columns
    do not fit the fields or a number is infinite, OSError if a file cannot be written.
    """
    overwrite, locked = boolean("overwrite", overwrite), boolean("locked", locked)
    directory, facts = Path(directory), dict(table.facts)
    rows = _Rows.of(table)
    with nullcontext() if locked else at_work([table.kind], directory, wait=True):
        if not overwrite:
            place = facts.get("spec_place", "")
            refuse_other_spec(table.kind, directory, facts["spec_sha256"], place)
        folder = directory / f".{table.kind}.new-{random_part()}"
        folder.mkdir(0o700)
        try:
            stem = folder / table.kind
            _write_all(stem, table, rows, formats)
            if table.extra_files is not None:
                table.extra_files(folder)
            figures = _figures(stem, directory, facts["spec_sha256"])
            package = package_text(table.kind, rows.fields, facts, stem, figures)
            stem.with_suffix(".datapackage.json").write_text(package, encoding="utf-8")
            return put_in_place(table.kind, folder, directory)
        except OSError as error:
            raise _of_folder(error, directory) from error
        finally:
            # What was not put in place, as far as that is possible now.
            rmtree(folder, ignore_errors=True)


def put_in_place(kind: str, folder: Path, directory: Path) -> list[Path]:
    """Move the files of a table to their places and give their paths; a figure or CSV that the package does not list goes."""
    *files, package = (name for name in names_of(kind) if (folder / name).exists())
    for name in (*files, package):
        for file in sorted((folder / name).iterdir()) if is_folder(folder / name) else ():
            sync(file)
        sync(folder / name)
    # The Parquet file first, which has the facts of the run as well.
    for name in sorted(files, key=lambda name: not name.endswith(".parquet")):
        _replace(folder / name, directory / name, folder / f"{REPLACED}-{name}")
    listed = packaged_files(folder / package)
    for suffix in (".csv", *FIGURES, ".proof"):
        if f"{kind}{suffix}" not in listed:
            (directory / f"{kind}{suffix}").unlink(missing_ok=True)
    sync(directory)
    if not same_but_for_the_run(folder / package, directory / package):
        (folder / package).replace(directory / package)
        sync(directory)
    return [directory / name for name in (*files, package) if name != BEST]


def _replace(new: Path, place: Path, old: Path) -> None:
    """Move a file or folder to its place; a folder in the way goes to `old`."""
    if is_folder(place) or (is_folder(new) and place.exists()):  # a rename cannot take its place
        place.rename(old)
    if is_folder(new):
        new.rename(place)
    else:
        put(new, place)


def _of_folder(error: OSError, directory: Path) -> OSError:
    """The error with the folder in place of a temporary file's name, or of none; Arrow has the number in its text alone."""
    matched = re.search(r"\[errno (\d+)\] ([^\n]+)", str(error))
    number, text = (
        (int(matched[1]), matched[2]) if matched else (error.errno, error.strerror or str(error))
    )
    return OSError(number, text, str(directory))


def _write_all(
    stem: Path,
    table: Table,
    rows: _Rows,
    formats: Iterable[str],
    only: str = "",
) -> None:
    """Write the files of a table but its package; `stem` is their path without a suffix. only: the suffix of the one wanted."""
    from concurrent.futures import Future, ThreadPoolExecutor

    lasting = {name: fact for name, fact in table.facts.items() if name not in OWN_FACTS}
    place = stem.with_suffix(".parquet")
    with ExitStack() as opened:
        writers: list[Callable[[Columns], Any]] = []
        if only in ("", ".parquet"):
            parquet = ParquetFile(place, rows.fields, lasting)
            writers.append(opened.enter_context(closing(parquet)).append)
        if only in ("", ".csv"):
            csv = opened.enter_context(stem.with_suffix(".csv").open("wb"))
            csv.write(csv_header(rows.fields))
            writers.append(lambda group: csv.write(csv_rows(group)))
        # Arrow lets them run at once, also while the next group of rows is read.
        threads = opened.enter_context(ThreadPoolExecutor(len(writers) or 1))
        writing: list[Future[None]] = []
        for group in rows.groups():
            for written in writing:
                written.result()
            writing = [threads.submit(write, group) for write in writers]
        for written in writing:
            written.result()
    _draw_all(stem, table, formats)
    if table.text is not None and not only:
        stem.with_suffix(".md").write_text(table.text, encoding="utf-8")


def _draw_all(stem: Path, table: Table, formats: Iterable[str]) -> None:
    """Draw the figure of a table, if it has one, in each format."""
    draw: Any = table.figure
    for form in formats if draw else ():
        try:
            draw(stem.with_suffix(f".{form}"))
        except Exception as error:  # any: a style or a spec of the user's may make matplotlib fail in many ways; it goes on up
            if not isinstance(error, OSError):
                error.add_note(
                    "This happened in the figure; --no-plot writes the table without it."
                )
            raise


def save(table: Table, path: Path) -> Path:
    """Write a table as the only file `path`, the CSV, the Parquet file or the figure, by its suffix; give the path.

    The file is there whole or not at all, and is left alone if it has these bytes already. Raises
    UsageError if something else than a file is in its place, WavesweepError and OSError as
    `publish`.
    """
    rows = _Rows.of(table)
    if os.path.lexists(path) and not (path.is_file() and not path.is_symlink()):
        raise UsageError(
            f"{path}: expected a file or none, found a link, a folder or a device; move it away"
        )
    suffix = path.suffix.lower()
    try:
        with scratch(path.parent) as folder:
            _write_all(
                folder / table.kind,
                table,
                rows,
                [suffix[1:]] if suffix in FIGURES else (),
                suffix,
            )
            target = folder / f"{table.kind}{suffix}"
            sync(target)
            put(target, path)
        sync(path.parent)
    except OSError as error:
        raise _of_folder(error, path) from error
    return path


def stream(table: Table, out: BinaryIO) -> None:
    """Write a table as CSV to the binary stream `out`, once all of it is there, so that no half-written table is left.

    Raises WavesweepError before the first byte if rows are unfit.
    """
    rows = _Rows.of(table)
    # Bytes of a table for stdout; more go to a file without a name.
    with SpooledTemporaryFile(1 << 26) as spooled:
        spooled.write(csv_header(rows.fields))
        spooled.writelines(map(csv_rows, rows.groups()))
        spooled.seek(0)
        copyfileobj(spooled, out)
    out.flush()


def pictured(table: Table) -> tuple[bytes, str]:
    """Give the CSV of a table that has a figure, and the figure as SVG, which is drawn from the rows of the CSV."""
    from io import BytesIO

    draw: Any = table.figure
    stream(table, text := BytesIO())
    with TemporaryDirectory() as folder:
        draw(figure := Path(folder, "figure.svg"))
        return text.getvalue(), figure.read_text(encoding="utf-8")


@dataclass(frozen=True, slots=True)
class _Rows:
    """The rows of a table that is to be written: its fields, and its blocks, of which the first is
    checked."""

    fields: tuple[Field, ...]
    blocks: Iterable[Columns]

    @staticmethod
    def of(table: Table) -> _Rows:
        """Ask a table for its first block, and check it."""
        blocks = iter(table.blocks())
        first = next(blocks)
        fields = table.fields or fields_of(table.kind, first, table.facts)
        return _Rows(fields, chain([checked(fields, first)], blocks))

    def groups(self) -> Iterator[Columns]:
        """Yield checked columns in groups of a fixed number of rows, then the remaining rows."""
        pending: list[Columns] = []
        waiting = 0
        rows = 0
        for block in self.blocks:
            pending.append(checked(self.fields, block, rows))
            length = len(pending[-1][self.fields[0].name])
            rows += length
            waiting += length
            if waiting < GROUP_ROWS:
                continue
            group = joined(pending)
            whole = waiting - waiting % GROUP_ROWS
            for start in range(0, whole, GROUP_ROWS):
                yield {name: column[start : start + GROUP_ROWS] for name, column in group.items()}
            pending = [{name: column[whole:] for name, column in group.items()}]
            waiting -= whole
        if waiting:
            yield joined(pending)


def _figures(stem: Path, directory: Path, sha256: str) -> list[Path]:
    """The figures of the table: the new ones, and those of the same spec that stay."""
    new = [stem.with_suffix(suffix) for suffix in FIGURES]
    old = [(directory / stem.name).with_suffix(suffix) for suffix in FIGURES]
    figures = [fresh if fresh.exists() else former for fresh, former in zip(new, old, strict=True)]
    figures = [figure for figure in figures if figure.exists()]
    same = figures and (existing_facts(stem.name, directory) or {}).get("spec_sha256") == sha256
    return [figure for figure in figures if same or figure in new]
