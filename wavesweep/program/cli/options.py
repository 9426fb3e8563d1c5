"""The options that several commands have: each is declared once and has one meaning."""

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import wraps
from math import isfinite
from pathlib import Path, PurePath
from typing import Any

import click
from click.core import ParameterSource

from wavesweep.program.cli.completions import settings
from wavesweep.program.cli.entry import verbosity

STDOUT = "-"
# `FARTHEST_FACTOR` of program.spec.studies in words, for helps, which load no numbers
ABOUT_ITS_VALUE = "a tenth of its value to ten times that"
PATH = click.Path(
    readable=False
)  # which a shell completes; what is at the path is asked where it is opened
FORMATS = ("png", "svg", "pdf", "eps")
FILES = (".csv", ".parquet", *(f".{form}" for form in FORMATS))  # what a single file can be


class Number(click.FloatRange):
    """A finite number of an option, within a range."""

    name = "number"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        with suppress(ValueError):  # of a text that is no number, which its own error says
            if not isfinite(float(value)):
                self.fail(f"expected a finite number, found {value}", param, ctx)
        number: float = super().convert(value, param, ctx)
        return number


def is_given(name: str) -> bool:
    """Whether an option is on the command line."""
    return click.get_current_context().get_parameter_source(name) is ParameterSource.COMMANDLINE


def _is_file(out: str) -> bool:
    return PurePath(out).suffix.lower() in FILES and not Path(out).is_dir()


def _checked_out(context: click.Context, option: click.Parameter, out: str | None) -> str | None:
    del context, option
    if out is not None and not out.strip():
        raise click.UsageError(
            "--out: expected a folder, found an empty text; leave the option out for the default"
        )
    named_as_file = out is not None and PurePath(out).suffix.lower() in FILES
    if out and named_as_file and Path(out).is_dir() and not out.endswith("/"):
        raise click.UsageError(
            f"--out {out}: expected a file or none of this name, found a folder; {out}/ writes into it"
        )
    if (
        out
        and re.fullmatch(r"\.[A-Za-z]\w{0,9}", PurePath(out).suffix)
        and not _is_file(out)
        and not Path(out).exists()
    ):
        endings = ", ".join(FILES)
        raise click.UsageError(
            f"--out {out}: expected a folder, or a file whose name ends in one of {endings}; make the folder first"
        )
    return out


def folder(text: str, or_file: bool = False) -> Callable[..., Any]:
    """The option --out of a command that writes no table to stdout; text: its help. or_file: it may name a figure too."""

    def checked(context: click.Context, option: click.Parameter, out: str | None) -> str | None:
        if out == STDOUT:
            raise click.UsageError(
                "--out -: expected a folder, since this command writes no table to stdout"
            )
        if out and _is_file(out) and not (or_file and PurePath(out).suffix[1:].lower() in FORMATS):
            raise click.UsageError(
                f"--out {out}: expected a folder, since this command writes several files"
            )
        return _checked_out(context, option, out)

    return click.option("-o", "--out", metavar="DIR", type=PATH, callback=checked, help=text)


def overwriting(text: str) -> Callable[..., Any]:
    """The option --overwrite of a command that writes files of its own. text: its help."""
    return click.option("--overwrite", is_flag=True, help=text)


override = click.option(
    "--set",
    "overrides",
    multiple=True,
    shell_complete=settings,
    metavar="KEY=VALUE",
    help="Set a key of the spec to another value for this run, e.g. controller.b=40, b=40, device.mass=45g or 'sweep.b=[20, 40]', or leave "
    "it out, e.g. sweep.b= for an axis that is not to be swept. May be repeated. Results then go to a folder of their own, "
    "e.g. results/mine,b=40, unless --out names one.",
)


def _declared(option: Callable[..., Any], default: Any = None, of: str = "all") -> Any:
    """A field of `Options` with the option that it is the value of. of: the commands that have it."""
    return field(default=default, metadata={"option": option, "of": of})


@dataclass(frozen=True)
class Options:
    """How a run is done and where its results go; each field declares its option.

    Commands that work in chunks have those of "workers" as well.
    """

    out: str | None = _declared(
        click.option(
            "-o",
            "--out",
            metavar="DIR",
            type=PATH,
            callback=_checked_out,
            help="Folder for the results [default: results/<spec's name>], or the only file that is wanted, e.g. limits.csv, "
            "limits.parquet, limits.png or limits.pdf. With - the CSV is written to stdout, and no file.",
        )
    )
    overrides: tuple[str, ...] = _declared(override, ())
    plot: bool = _declared(
        click.option(
            "--plot/--no-plot",
            default=True,
            show_default=True,
            help="Draw the figure, or leave it out. `wavesweep plot` draws it again in another format or width.",
        ),
        True,
    )
    overwrite: bool = _declared(
        overwriting(
            "Replace results of another spec, for other hands or of unknown origin. The same spec file needs no option."
        ),
        False,
    )
    wait: bool = _declared(
        click.option(
            "--wait", is_flag=True, help="Wait if another run is at work on the same results."
        ),
        False,
    )
    jobs: int = _declared(
        click.option(
            "-j",
            "--jobs",
            metavar="N",
            type=click.IntRange(min=1),
            default=2,
            show_default=True,
            help="Largest number of worker processes, at most one per processor. Runs of a second or two use none.",
        ),
        1,
        of="workers",
    )
    backend: str | None = _declared(
        click.option(
            "--backend",
            metavar="NAME",
            help="Kind of the workers: loky (processes of this machine, the default), threading or dask.",
        ),
        of="workers",
    )
    scheduler: str | None = _declared(
        click.option(
            "--scheduler",
            metavar="ADDRESS",
            help="Address of a dask scheduler, e.g. tcp://host:8786; only with --backend dask.",
        ),
        of="workers",
    )
    restart: bool = _declared(
        click.option(
            "--restart",
            is_flag=True,
            help="Begin anew, and throw away what an interrupted run has finished.",
        ),
        False,
        of="workers",
    )
    quiet: bool = False
    as_json: bool = False

    @property
    def silent(self) -> bool:
        """Whether nothing is said of what was done, neither in lines nor as JSON."""
        return self.quiet and not self.as_json

    @property
    def to_stdout(self) -> bool:
        """Whether the table goes to stdout and nothing to files."""
        return self.out == STDOUT

    @property
    def file(self) -> Path | None:
        """The only file that is wanted; None if all of them are, in a folder, or the table on stdout."""
        if self.out and _is_file(self.out):
            return Path(self.out)
        return None

    @property
    def to_folder(self) -> bool:
        """Whether all files of the tables are wanted, in a folder."""
        return not self.to_stdout and self.file is None

    @property
    def formats(self) -> tuple[str, ...]:
        """The formats of the figure; empty if none is drawn."""
        form = self.file.suffix.lower()[1:] if self.file else "png"
        if self.plot and not self.to_stdout:
            return (form,)
        return ()

    @property
    def work(self) -> dict[str, Any]:
        """The arguments of a run in chunks that are options."""
        return {
            "jobs": self.jobs,
            "backend": self.backend,
            "scheduler": self.scheduler,
            "force": self.restart,
        }


def run_options(*groups: str) -> Callable[..., Any]:
    """Add the options of a run to a command; its body receives them together as `options`. groups: besides those of all."""
    declared = [
        option
        for option in fields(Options)
        if option.metadata and option.metadata["of"] in ("all", *groups)
    ]

    def add(body: Callable[..., None]) -> Callable[..., None]:
        @wraps(body)
        def gathered(**flags: Any) -> None:
            chosen = {option.name: flags.pop(option.name) for option in declared}
            body(
                options=_consistent(
                    Options(**chosen, quiet=verbosity().quiet, as_json=verbosity().as_json)
                ),
                **flags,
            )

        command = gathered
        for option in reversed(declared):
            command = option.metadata["option"](command)
        return command

    return add


def _consistent(options: Options) -> Options:
    """The options of a run, without a figure if its only file is a table. Raises UsageError for
    those that contradict each other."""
    if options.file and options.file.suffix.lower()[1:] not in FORMATS:
        if options.plot and is_given("plot"):
            raise click.UsageError(
                f"--plot draws a figure, and --out {options.out} writes none; name a folder, or leave one of them out"
            )
        options = replace(options, plot=False)
    elif options.file and not options.plot:
        raise click.UsageError(f"--out {options.out} is a figure; leave --no-plot out")
    if options.plot and options.to_stdout and is_given("plot"):
        raise click.UsageError(
            "--plot draws a figure, and --out - writes none; name a folder, or leave one of them out"
        )
    if options.scheduler is not None and options.backend != "dask":
        raise click.UsageError(
            f"--scheduler needs --backend dask, found --backend {options.backend or 'missing'}"
        )
    if options.as_json and options.to_stdout:
        raise click.UsageError(
            "--json and --out - would both write to stdout; name a folder, or leave one of them out"
        )
    return options
