"""`wavesweep plot`."""

from __future__ import annotations

import re
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import click

from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.cli.entry import verbosity
from wavesweep.program.cli.options import FORMATS, PATH, folder, is_given

_INCHES = {"": 1.0, "in": 1.0, "mm": 1 / 25.4, "cm": 1 / 2.54}


def _as_asked(context: click.Context, _: click.Parameter, text: str | None) -> str | None:
    """Have the figure drawn in this width, until the command ends."""
    if text is not None and not context.resilient_parsing:
        from wavesweep.program.plots.style import as_asked

        match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(in|mm|cm|)\s*", text)
        width = float(match[1]) * _INCHES[match[2]] if match else 0.0
        if not 2.0 <= width <= 20.0:  # inches
            expected = "a width from 2 to 20 inches, such as 3.5in, 89mm or 8.9cm"
            raise UsageError(f"--width: expected {expected}, found {text}")
        context.with_resource(as_asked(width))
    return text


@click.command("plot")
@click.argument("table", type=PATH)
@click.option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice(FORMATS),
    default=["png"],
    show_default=True,
    help="Format of the figure. May be repeated.",
)
@click.option(
    "--width",
    metavar="SIZE",
    expose_value=False,
    callback=_as_asked,
    help="Width of the figure, e.g. 3.5in or 89mm for a journal's column; a number alone is in inches.",
)
@folder(
    "Folder for the figure, or a file that ends in .png, .svg, .pdf or .eps [default: the folder of the table].",
    or_file=True,
)
def command(table: str, formats: tuple[str, ...], out: str | None) -> None:
    """Draw the figure of a table again, as PNG, SVG, PDF or EPS.

    TABLE is a Parquet file of another command, or a CSV with its data package beside it. The spec
    is in either, so the figure is the one that the command itself draws. A figure that is there
    already is replaced.
    """
    from wavesweep.program import plots, results
    from wavesweep.program.cli.file_places import refuse_other_things
    from wavesweep.program.cli.messages import say
    from wavesweep.program.plots.figure_files import save_all
    from wavesweep.program.plots.style import about_figure

    plots.refuse_settings()
    path = Path(table)
    directory, stem, formats = _figure_place(path, formats, out)
    results.refuse_unusable(directory)
    refuse_other_things(*(directory / f"{stem}.{form}" for form in formats))
    # A run that replaces the table meanwhile would be given this figure. Without a table there is
    # nothing to hold.
    busy = (lambda _: None) if verbosity().quiet else partial(say, warning=True)
    with (
        results.at_work([path.stem], directory, wait=True, say=busy)
        if path.exists()
        else nullcontext()
    ):
        kind, columns, facts = results.read_table(path)
        if by := facts.get("drawn_by"):
            expected = f"expected a table that has a figure of its own, found one that {by} draws"
            raise UsageError(f"{path}: {expected}")
        try:
            figure = plots.figure_of(kind)(columns, facts)
            written = save_all(figure, directory, stem, formats, about_figure(kind, facts))
        except (*results.NOT_OURS, SpecError) as error:
            # A whole table may have facts and numbers that no run writes.
            beside = "" if path.suffix == ".parquet" else f" and {path.stem}.datapackage.json"
            mistakes = f" ({str(error).splitlines()[0]})" if isinstance(error, SpecError) else ""
            raise UsageError(
                f"{path}{beside}: expected numbers and facts that can be drawn, found others{mistakes}; "
                "run the command that made them again (--debug shows where drawing failed)"
            ) from error
        package = directory / f"{path.stem}.datapackage.json"
        if package.exists() and directory.resolve() == path.parent.resolve():
            results.add_figures(package, kind, written)
    if not verbosity().quiet:
        say(f"Wrote {', '.join(map(str, written))}")


def _figure_place(
    path: Path, formats: tuple[str, ...], out: str | None
) -> tuple[Path, str, tuple[str, ...]]:
    """Return folder, name and formats of the figure of the table `path`, of which --out may name the folder or the file."""
    directory = path.parent if out is None else Path(out)
    if out is None or directory.suffix[1:] not in FORMATS or directory.is_dir():
        return directory, path.stem, formats
    if is_given("formats"):
        raise click.UsageError(
            f"--format: expected a folder for --out, found the file {out}, whose name says its format"
        )
    return directory.parent, directory.stem, (directory.suffix[1:],)
