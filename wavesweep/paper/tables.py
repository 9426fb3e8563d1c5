"""A table with its figure, ready to be written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from wavesweep import results
from wavesweep.results import Field
from wavesweep.sweep import Run


@dataclass(frozen=True, eq=False)
class Table:
    """name: of the files. fields: the columns. run: columns and facts. draw: writes the figure (PNG) to a path, if any.

    text: the same for a reader, as Markdown, if any.
    """

    name: str
    fields: tuple[Field, ...]
    run: Run
    draw: Callable[[Path], None] | None = None
    text: str | None = None


def table_of(kind: str, name: str, run: Run, draw: Callable[[Path], None] | None = None) -> Table:
    """Give a table of a kind that `results` knows under a name of its own."""
    return Table(name, results.fields_of(kind, run.columns), run, draw)


def write_table(table: Table, directory: Path, *, force: bool, plot: bool) -> list[Path]:
    """Write CSV, Parquet, data package, and if there are some figure and Markdown; parameters as for `TableWriter`."""
    with results.TableWriter(table.name, table.fields, table.run.facts, directory, force) as writer:
        writer.append(table.run.columns)
        written = writer.finish(figure=table.draw if plot else None)
    if table.text is not None:
        path = directory / f"{table.name}.md"
        path.write_text(table.text, encoding="utf-8")
        written.append(path)
    return written
