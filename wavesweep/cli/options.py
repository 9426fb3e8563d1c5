"""The options that several commands have: each is defined once and has one meaning."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import wraps
from pathlib import Path, PurePath
from typing import Any

import click
from click.core import ParameterSource

STDOUT = "-"
FORMATS = ("png", "svg", "pdf", "eps")
FILES = (".csv", ".parquet", *(f".{form}" for form in FORMATS))  # what a single file can be


@dataclass(frozen=True)
class Options:
    """The values of the shared options."""

    out: str | None
    overrides: tuple[str, ...]
    plot: bool
    formats: tuple[str, ...]
    overwrite: bool
    as_json: bool
    wait: bool
    quiet: bool
    debug: bool
    partition: int | None = None
    jobs: int = 1
    backend: str | None = None
    scheduler: str | None = None
    restart: bool = False

    @property
    def to_stdout(self) -> bool:
        """Whether the table goes to stdout and nothing to files."""
        return self.out == STDOUT

    @property
    def file(self) -> Path | None:
        """The only file that is wanted; None if all of them are, in a folder, or the table on stdout."""
        return Path(self.out) if self.out and _is_file(self.out) else None

    @property
    def to_folder(self) -> bool:
        """Whether all files of the tables are wanted, in a folder."""
        return not self.to_stdout and self.file is None


def _is_file(out: str) -> bool:
    return PurePath(out).suffix.lower() in FILES and not Path(out).is_dir()


def folder(text: str, or_file: bool = False) -> Callable[..., Any]:
    """The option --out of a command that writes no table to stdout; text: its help. or_file: it may name a single file too."""

    def checked(context: click.Context, option: click.Parameter, out: str | None) -> str | None:
        if out == STDOUT:
            raise click.UsageError("--out -: expected a folder, since this command writes no table to stdout")
        if out and _is_file(out) and not or_file:
            raise click.UsageError(f"--out {out}: expected a folder, since this command writes several files")
        return _refuse_nothing(context, option, out)

    return click.option("-o", "--out", metavar="DIR", callback=checked, help=text)


def _refuse_nothing(context: click.Context, option: click.Parameter, out: str | None) -> str | None:
    del context, option
    if out is not None and not out.strip():
        raise click.UsageError("--out: expected a folder, found an empty text; leave the option out for the default")
    if out and re.fullmatch(r"\.[A-Za-z]\w{0,9}", PurePath(out).suffix) and not _is_file(out) and not Path(out).exists():
        known = ", ".join(FILES)
        raise click.UsageError(
            f"--out {out}: expected a folder, or a file whose name ends in one of {known}; make the folder first"
        )
    return out


override = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set a key of the spec to another value for this run, e.g. controller.b=40, b=40 or 'sweep.b=[20, 40]', or leave it "
    "out, e.g. sweep.b= for an axis that is not to be swept. May be repeated. Results then go to a folder of their own, "
    "e.g. results/mine,b=40, unless --out names one.",
)
quiet = click.option("-q", "--quiet", is_flag=True, help="Print errors only: no summary and no progress.")
# Read by the entry, before any command runs; declared here so that each help lists it.
debug = click.option("--debug", is_flag=True, help="Show a traceback if the command fails.")

as_json = click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print the summary as one JSON object on stdout, and no text. docs/json.md explains its keys.",
)


def _as_asked(context: click.Context, option: click.Parameter, text: str | None) -> str | None:
    """Have figures of the run drawn in this width or style, until the command ends."""
    if text is not None and not context.resilient_parsing:
        from wavesweep.plots.asked import style_of, width_of
        from wavesweep.plots.style import as_asked

        asked = {"width": width_of(text)} if option.name == "width" else {"settings": style_of(text)}
        context.with_resource(as_asked(**asked))
    return text


def _together(*options: Callable[..., Any]) -> Callable[..., Any]:
    """Several options as one decorator; a help lists them in this order."""

    def add(body: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            body = option(body)
        return body

    return add


formats = _together(
    click.option(
        "--format",
        "formats",
        multiple=True,
        type=click.Choice(FORMATS),
        default=["png"],
        show_default=True,
        help="Format of the figure. May be repeated.",
    ),
    click.option(
        "--width",
        metavar="SIZE",
        expose_value=False,
        callback=_as_asked,
        help="Width of the figure, e.g. 3.5in or 89mm for a journal's column; a number alone is in inches. The picture of a "
        "loop's blocks has a width of its own.",
    ),
    click.option(
        "--style",
        metavar="STYLE",
        expose_value=False,
        callback=_as_asked,
        help="A style of matplotlib over that of the program: a name such as ggplot, or a file with settings, e.g. "
        "'font.family: serif'. Colours that tell curves apart stay.",
    ),
)


def overwriting(text: str) -> Callable[..., Any]:
    """The option --overwrite of a command that writes files of its own, with its older name. text: its help."""
    return _together(
        click.option("--overwrite", is_flag=True, help=text),
        click.option("--force", "overwrite", is_flag=True, hidden=True),
    )


_common = _together(
    click.option(
        "-o",
        "--out",
        metavar="DIR",
        callback=_refuse_nothing,
        help="Folder for the results [default: results/<spec's name>], or the only file that is wanted, e.g. limits.csv, "
        "limits.parquet, limits.png or limits.pdf. With - the CSV is written to stdout, and no file.",
    ),
    override,
    click.option("--plot/--no-plot", default=True, show_default=True, help="Draw the figure, or leave it out."),
    formats,
    click.option(
        "--overwrite",
        is_flag=True,
        help="Replace results of another spec, for other hands or of unknown origin. The same spec file needs no option.",
    ),
    click.option("--force", is_flag=True, hidden=True),  # what --overwrite and --restart were together
    click.option("--wait", is_flag=True, help="Wait if another run is at work on the same results."),
    as_json,
    quiet,
    debug,
)


def common(body: Callable[..., None]) -> Callable[..., None]:
    """Add the common options to a command; its body receives them together as `options`."""

    @wraps(body)
    def gathered(force: bool, **given: Any) -> None:
        given |= dict.fromkeys({"overwrite", "restart"} & given.keys(), True) if force else {}
        options = Options(**{field.name: given.pop(field.name) for field in fields(Options) if field.name in given})
        options = _of_file(options)
        drawn = options.plot and not options.to_stdout
        for name in () if drawn else ("formats", "width", "style"):
            if click.get_current_context().get_parameter_source(name) is ParameterSource.COMMANDLINE:
                why = f"--out {options.out}" if options.plot or options.file else "--no-plot"
                raise click.UsageError(
                    f"--{name.removesuffix('s')} is of the figure, and {why} writes none; leave one of them out"
                )
        asked = click.get_current_context().get_parameter_source("plot")
        if options.plot and options.to_stdout and asked is ParameterSource.COMMANDLINE:
            raise click.UsageError("--plot draws a figure, and --out - writes none; name a folder, or leave one of them out")
        options = options if options.plot else replace(options, formats=())
        if options.scheduler is not None and options.backend != "dask":
            raise click.UsageError(f"--scheduler needs --backend dask, found --backend {options.backend or 'missing'}")
        if options.as_json and options.to_stdout:
            raise click.UsageError("--json and --out - would both write to stdout; name a folder, or leave one of them out")
        if options.partition is not None and not options.to_folder:
            raise click.UsageError(
                f"--partition writes a folder of Parquet files, and --out {options.out} none; leave one of them out"
            )
        body(options=options, **given)

    return _common(gathered)


def _of_file(options: Options) -> Options:
    """The options of a run that writes a single file, whose suffix says whether the figure is wanted, and in which format."""
    if options.file is None:
        return options
    form, source = options.file.suffix.lower()[1:], click.get_current_context().get_parameter_source
    if form not in FORMATS:
        return replace(options, plot=False)
    if not options.plot or (source("formats") is ParameterSource.COMMANDLINE and options.formats != (form,)):
        raise click.UsageError(f"--out {options.out} is a figure in the format {form}; leave --no-plot and other formats out")
    return replace(options, formats=(form,))


# For the commands that work in chunks; beside `common`, which collects them.
workers = _together(
    click.option(
        "-j",
        "--jobs",
        metavar="N",
        type=click.IntRange(min=1),
        default=2,
        show_default=True,
        help="Largest number of worker processes, at most one per processor. Runs of a second or two use none.",
    ),
    click.option(
        "--backend",
        metavar="NAME",
        help="Kind of the workers: loky (processes of this machine, the default), threading or dask.",
    ),
    click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="Address of a dask scheduler, e.g. tcp://host:8786; only with --backend dask.",
    ),
    click.option("--restart", is_flag=True, help="Begin anew, and throw away what an interrupted run has finished."),
)


# For the commands whose tables can be long; above `common`, which collects it.
partition = click.option(
    "--partition",
    metavar="ROWS",
    type=click.IntRange(min=1),
    help="Write the table as a folder of Parquet files with so many rows each, which programs read as one table, and no CSV. "
    "For tables of tens of millions of rows, e.g. 10000000.",
)


# For the commands of stable intervals.
prove = click.option(
    "--prove",
    is_flag=True,
    help="Compute columns in doubt again in ball arithmetic, with as many digits as it takes, if the spec draws its loop. This "
    "takes from hundredths of a second to some ten seconds per column.",
)


def refuse_equal_names(sources: Sequence[str]) -> None:
    """Raise UsageError if two files of specs have the same stem, which labels rows and curves."""
    stems = [PurePath(source).stem for source in sources]
    for stem in stems:
        if stems.count(stem) > 1:
            raise click.UsageError(f"two specs are called {stem}; expected different file names, which label the curves")


# For the commands of stable intervals.
for_hands = click.option(
    "--for-hands",
    "for_hands",
    multiple=True,
    metavar="WORD",
    help="Add the intervals that are guaranteed for hands, in a table of its own. passive: stable with every passive hand, of "
    "any mass and stiffness, also if it moves within a tick. box: stable with every hand between a fingertip and an arm, or "
    "with ranges of your own, e.g. box:mass=0.1..0.4,damping=2..5 (kg, N*s/m; stiffness in N/m). port: the hand's port is "
    "passive if forces are held over a tick. May be repeated. A slice takes from tenths of a second to some ten seconds.",
)
