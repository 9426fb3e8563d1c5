"""Tables into files or to a stream, block by block; all of a table's files appear whole, or none does."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, closing
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

from wavesweep.results.files import GROUP_ROWS, ParquetFile, csv_header, csv_rows
from wavesweep.results.folder import (
    SUFFIXES,
    at_work_in,
    existing_sha256,
    refuse_other_spec,
    refuse_unusable,
    remove_leftovers,
)
from wavesweep.results.package import package_text
from wavesweep.results.schema import Field, checked, fields_of
from wavesweep.sweep.table import Columns, Table, joined

_PREFIX = ".wavesweep-"  # of the folders that tables are written in


def publish(table: Table, directory: str | Path, force: bool = False, plot: bool = True) -> list[Path]:
    """Write a table as CSV and Parquet, its figure and text if it has some, and the data package; give their paths.

    Everything is written in a temporary folder beside the results, and put in place at the end; a figure that another
    spec left behind is removed. How the rows are cut into blocks leaves no trace in the bytes.

    table      its facts need `spec_sha256`; those under "timings" stay out of the Parquet file, so that equal runs give
               equal bytes
    directory  made if it is missing
    force      replace results of another spec
    plot       draw the figure

    Raises UsageError if the directory holds results of another spec, WavesweepError if the columns do not fit the
    fields or a number is infinite, OSError if a file cannot be written.
    """
    directory, facts = Path(directory), dict(table.facts)
    fields, blocks = _opened(table)
    if not force:
        refuse_other_spec(table.kind, directory, facts["spec_sha256"])
    refuse_unusable(directory)
    directory.mkdir(parents=True, exist_ok=True)
    remove_leftovers(directory, _PREFIX)
    with ExitStack() as opened:
        # A folder in the same directory is on the same file system: a rename out of it cannot be half done.
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=directory))
        opened.callback(shutil.rmtree, folder, ignore_errors=True)
        opened.enter_context(at_work_in(folder))
        stem = folder / table.kind
        _write_rows(stem, fields, facts, blocks)
        if plot and table.figure is not None:
            table.figure(stem.with_suffix(".png"))
        if table.text is not None:
            stem.with_suffix(".md").write_text(table.text, encoding="utf-8")
        package = package_text(table.kind, fields, facts, stem.with_suffix(".csv"), stem.with_suffix(".parquet"))
        stem.with_suffix(".datapackage.json").write_text(package, encoding="utf-8")
        return _put_in_place(stem, directory, facts["spec_sha256"])


def stream(table: Table, out: BinaryIO) -> None:
    """Write a table as CSV to the binary stream `out`.

    Raises WavesweepError before the first byte if its first rows are unfit.
    """
    fields, blocks = _opened(table)
    out.write(csv_header(fields))
    out.writelines(csv_rows(group) for group in _groups(fields, blocks))
    out.flush()


def _opened(table: Table) -> tuple[tuple[Field, ...], Iterable[Columns]]:
    """Give the table's fields, and its blocks, the first of which is checked."""
    blocks = iter(table.blocks())
    first = next(blocks)
    fields = table.fields or fields_of(table.kind, first, table.facts)
    return fields, chain([checked(fields, first)], blocks)


def _write_rows(stem: Path, fields: tuple[Field, ...], facts: Mapping[str, Any], blocks: Iterable[Columns]) -> None:
    lasting = {name: fact for name, fact in facts.items() if name != "timings"}
    parquet = ParquetFile(stem.with_suffix(".parquet"), fields, lasting)
    with closing(parquet), stem.with_suffix(".csv").open("wb") as csv:
        csv.write(csv_header(fields))
        for group in _groups(fields, blocks):
            csv.write(csv_rows(group))
            parquet.append(group)


def _groups(fields: tuple[Field, ...], blocks: Iterable[Columns]) -> Iterator[Columns]:
    """Yield checked columns in groups of a fixed number of rows, and the remaining rows."""
    pending, waiting, rows = [], 0, 0
    for block in blocks:
        pending.append(checked(fields, block, rows))
        length = len(pending[-1][fields[0].name])
        rows, waiting = rows + length, waiting + length
        if waiting < GROUP_ROWS:
            continue
        whole, end = joined(pending), waiting - waiting % GROUP_ROWS
        for start in range(0, end, GROUP_ROWS):
            yield {name: column[start : start + GROUP_ROWS] for name, column in whole.items()}
        pending, waiting = [{name: column[end:] for name, column in whole.items()}], waiting - end
    if waiting:
        yield joined(pending)


def _put_in_place(stem: Path, directory: Path, sha256: str) -> list[Path]:
    if existing_sha256(stem.name, directory) != sha256 and not stem.with_suffix(".png").exists():
        (directory / f"{stem.name}.png").unlink(missing_ok=True)
    placed = []
    # The package last: its hashes then vouch for files that are there already.
    for suffix in (*SUFFIXES[:-1], ".md", SUFFIXES[-1]):
        source = stem.with_suffix(suffix)
        if source.exists():
            placed.append(source.replace(directory / source.name))
    return placed
