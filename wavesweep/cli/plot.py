"""`wavesweep plot`."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from wavesweep.cli.options import FORMATS, debug, folder, formats, quiet
from wavesweep.errors import UsageError, WavesweepError

if TYPE_CHECKING:
    from wavesweep.columns import Columns


@click.command("plot")
@click.argument("table")
@formats
@folder(
    "Folder for the figure, or a file that ends in .png, .svg, .pdf or .eps [default: the folder of the table].", or_file=True
)
@quiet
@debug
def command(table: str, formats: tuple[str, ...], out: str | None, **switches: bool) -> None:
    """Draw the figure of a table again, as PNG, SVG, PDF or EPS.

    TABLE is a Parquet file of another command, or a CSV with its data package beside it. The spec is in either, so the
    figure is the one that the command itself draws. A figure that is there already is replaced.
    """
    from wavesweep import plots, results
    from wavesweep.cli.messages import say
    from wavesweep.cli.output import refuse_other_things
    from wavesweep.plots.files import save_all
    from wavesweep.plots.style import about_figure

    plots.refuse_settings()
    path = Path(table)
    directory, stem = path.parent if out is None else Path(out), path.stem
    if out is not None and directory.suffix[1:] in FORMATS and not directory.is_dir():
        if click.get_current_context().get_parameter_source("formats") is not ParameterSource.DEFAULT:
            raise click.UsageError(f"--format: expected a folder for --out, found the file {out}, whose name says its format")
        directory, stem, formats = directory.parent, directory.stem, (directory.suffix[1:],)
    results.refuse_unusable(directory)
    refuse_other_things(*(directory / f"{stem}.{form}" for form in formats))
    # A run that replaces the table meanwhile would be given this figure. Without a table there is nothing to hold.
    busy = (lambda _: None) if switches["quiet"] else partial(say, warning=True)
    with results.at_work([path.stem], directory, wait=True, say=busy) if path.exists() else nullcontext():
        kind, columns, facts = results.read_table(path)
        if by := facts.get("drawn_by"):
            expected = f"expected a table that has a figure of its own, found one of wavesweep {by}, which draws it"
            raise UsageError(f"{path}: {expected}")
        figure = plots.figure_of(kind)(columns, facts, *_responses(kind, path, facts))
        written = save_all(figure, directory, stem, formats, about_figure(kind, facts))
        package = directory / f"{path.stem}.datapackage.json"
        if package.exists() and directory.resolve() == path.parent.resolve():
            results.add_figures(package, kind, written)
    if not switches["quiet"]:
        say(f"Wrote {', '.join(map(str, written))}")


def _responses(kind: str, path: Path, facts: Mapping[str, Any]) -> list[Columns | dict]:
    """The responses that a comparison is drawn with, and their facts, if their table is beside its own and of the same run."""
    beside = path.with_name(f"{path.stem}-bode{path.suffix}")
    if kind != "compare" or not beside.exists():
        return []
    from wavesweep.results import read_table

    with suppress(WavesweepError, OSError):
        other, columns, own = read_table(beside)
        if other == "compare-bode" and own["spec_sha256"] == facts["spec_sha256"]:
            return [columns, own]
    return []
