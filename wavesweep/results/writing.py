"""Tables into files: all of a table's files appear whole, or none does."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from wavesweep.results.columns import checked
from wavesweep.results.existing import existing_sha256, refuse_other_spec, refuse_unusable
from wavesweep.results.leftovers import at_work_in, remove_leftovers
from wavesweep.results.package import package_text
from wavesweep.results.parquet import GROUP_ROWS, ParquetFile
from wavesweep.results.schema import Field, fields_of
from wavesweep.results.text import header, lines

_PREFIX = ".wavesweep-"  # of the folders that tables are written in


class TableWriter:
    """Writes one table, chunk by chunk, as CSV and Parquet; the chunks' sizes leave no trace in the bytes.

    Use it in a `with` block: `append` columns as often as there are some, then `finish` once. Until `finish`
    everything lies in a temporary folder beside the results; leaving the block without it removes that folder.

    fields     the columns, from `fields(kind, axes)`
    facts      the run's facts, JSON-able, with `spec_sha256`. Those under "timings" stay out of the Parquet file,
               so that equal runs give equal bytes.
    directory  made if it is missing
    force      replace results of another spec

    Raises UsageError where the directory holds results of another spec, OSError where it cannot be written.
    """

    def __init__(
        self, kind: str, fields: tuple[Field, ...], facts: Mapping[str, Any], directory: str | Path, force: bool = False
    ) -> None:
        self._kind, self._fields, self._facts, self._directory = kind, fields, dict(facts), Path(directory)
        if not force:
            refuse_other_spec(kind, directory, self._facts["spec_sha256"])
        self._pending: list[dict[str, np.ndarray]] = []
        self._rows = self._pending_rows = 0
        refuse_unusable(self._directory)
        self._directory.mkdir(parents=True, exist_ok=True)
        remove_leftovers(self._directory, _PREFIX)
        with ExitStack() as opened:
            # A folder in the same directory is on the same file system: a rename out of it cannot be half done.
            self._folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=self._directory))
            opened.callback(shutil.rmtree, self._folder, ignore_errors=True)
            opened.enter_context(at_work_in(self._folder))
            self._csv = opened.enter_context((self._folder / f"{kind}.csv").open("wb"))
            self._csv.write(header(fields))
            lasting = {name: fact for name, fact in self._facts.items() if name != "timings"}
            parquet = ParquetFile(self._folder / f"{kind}.parquet", fields, lasting)
            self._parquet = opened.enter_context(closing(parquet))
            self._opened = opened.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._opened.close()

    def append(self, columns: Mapping[str, Any]) -> None:
        """Add rows. Raises WavesweepError where the columns do not fit the fields or a number is infinite."""
        chunk = checked(self._fields, columns, self._rows)
        length = len(next(iter(chunk.values())))
        self._rows += length
        self._pending.append(chunk)
        self._pending_rows += length
        if self._pending_rows >= GROUP_ROWS:
            self._flush(keep=self._pending_rows % GROUP_ROWS)

    def finish(
        self, timings: Mapping[str, float] | None = None, figure: Callable[[Path], None] | None = None
    ) -> list[Path]:
        """Put the files in place and give their paths: CSV, Parquet, the figure if there is one, the data package.

        `figure` draws a PNG at the path that it is given. A figure that another spec left behind is removed.
        """
        self._flush(keep=0)
        self._csv.close()
        self._parquet.close()
        if figure is not None:
            figure(self._folder / f"{self._kind}.png")
        self._write_package(timings)
        return self._put_in_place()

    def _flush(self, keep: int) -> None:
        """Write all but the last `keep` pending rows, in row groups of the fixed size."""
        if not self._pending_rows:
            return
        joined = {f.name: np.concatenate([chunk[f.name] for chunk in self._pending]) for f in self._fields}
        end = self._pending_rows - keep
        for start in range(0, end, GROUP_ROWS):
            group = {name: column[start : min(start + GROUP_ROWS, end)] for name, column in joined.items()}
            self._csv.write(lines(group))
            self._parquet.append(group)
        self._pending = [{name: column[end:] for name, column in joined.items()}] if keep else []
        self._pending_rows = keep

    def _write_package(self, timings: Mapping[str, float] | None) -> None:
        csv, parquet = (self._folder / f"{self._kind}{suffix}" for suffix in (".csv", ".parquet"))
        facts = self._facts if timings is None else {**self._facts, "timings": dict(timings)}
        text = package_text(self._kind, self._fields, facts, csv, parquet)
        (self._folder / f"{self._kind}.datapackage.json").write_text(text, encoding="utf-8")

    def _put_in_place(self) -> list[Path]:
        figure = self._directory / f"{self._kind}.png"
        stale = existing_sha256(self._kind, self._directory) != self._facts["spec_sha256"]
        placed = []
        # The package last: its hashes then vouch for files that are there already.
        for suffix in (".csv", ".parquet", ".png", ".datapackage.json"):
            source = self._folder / f"{self._kind}{suffix}"
            if source.exists():
                source.replace(self._directory / source.name)
                placed.append(self._directory / source.name)
            elif stale:
                figure.unlink(missing_ok=True)
        return placed


def write(
    kind: str,
    columns: Mapping[str, Any],
    facts: Mapping[str, Any],
    directory: str | Path,
    force: bool = False,
    figure: Callable[[Path], None] | None = None,
) -> list[Path]:
    """Write a whole table and give the paths of its files; parameters and errors as for `TableWriter`."""
    fields = fields_of(kind, columns)
    arrays = checked(fields, columns)
    with TableWriter(kind, fields, facts, directory, force) as writer:
        writer.append(arrays)
        return writer.finish(figure=figure)
