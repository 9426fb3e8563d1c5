"""Entry point: the table of commands, and the one place in which errors become exit codes.

The program's commands are listed here, those of capabilities in `wavesweep.capabilities`.
"""

from __future__ import annotations

import errno
import gc
import math
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from itertools import chain
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import click

from wavesweep.capabilities import CAPABILITIES, OTHER_COMMANDS, QUESTIONS, WITHOUT_SUMMARY, home_of
from wavesweep.engine.errors import SpecError, WavesweepError
from wavesweep.program.cli.stopping import Stopped, signals_unwind
from wavesweep.program.platform_compat import ONE_THREAD, memory_limit

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


class Verbosity(NamedTuple):
    """How the program speaks, whatever the command: options that may stand anywhere in the line.

    words: the whole line after the program's name.
    """

    words: Sequence[str] = ()
    quiet: bool = False
    as_json: bool = False
    debug: bool = False

    @classmethod
    def of(cls, words: Sequence[str]) -> tuple[Verbosity, list[str]]:
        """Take these options out of a line; the words that are left are those of the group and of the command."""
        end = words.index("--") if "--" in words else len(words)
        meant = {"-q": "quiet", "--quiet": "quiet", "--json": "as_json", "--debug": "debug"}
        wanted = {meant[word]: True for word in words[:end] if word in meant}
        remaining = [word for word in words[:end] if word not in meant]
        return cls(tuple(words), **wanted), [*remaining, *words[end:]]


def verbosity() -> Verbosity:
    """How the running command speaks."""
    return click.get_current_context().find_root().obj or Verbosity()


LEAST_MEMORY = 400e6  # bytes of address space, with which OpenBLAS and Arrow load
# What the system says of a library for which there is no memory.
NO_ROOM = ("failed to map segment", "cannot allocate memory", "Cannot allocate memory")
# Errors of arithmetic without a result in doubles; LinAlgError is numpy's, which is not imported
# for this.
BEYOND_DOUBLES = ("LinAlgError", "FloatingPointError", "OverflowError")

# The short helps are listed here so that `wavesweep --help` need not import the commands; a test
# holds them against these.
CORE = MappingProxyType(
    {
        "zwidth": "Find the stable intervals of the stiffness K_VE for each B_VE and each other axis.",
        "stability-region": "Find the stable intervals along any axis for every combination of the others.",
        "bode": "Compute transmitted admittance and impedance over frequency, or the responses between inputs and outputs.",
        "plot": "Draw the figure of a table again, as PNG, SVG, PDF or EPS.",
        "verify": "Hold results against their data packages, and compute a sample of the rows again.",
        "init": "Write a commented spec to begin with.",
        "keys": "Explain the keys of a spec: values, units and defaults.",
    }
)
COMMANDS = MappingProxyType(
    {
        **CORE,
        **{name: said for capability in CAPABILITIES for name, said in capability.commands.items()},
    }
)


STUDIES = ("zwidth", "stability-region", "bode")
# Options that commands had, and what does the same now.
_SHAPES = "shapes a figure, and is an option of `wavesweep plot TABLE`, which draws the figure of a table again"
MOVED = MappingProxyType(
    {
        "--format": f"{_SHAPES}; --out NAME.svg (.pdf, .eps) writes a figure in another format at once",
        "--width": _SHAPES,
        "--force": "stood for two options: --overwrite replaces results of another spec, --restart begins a run anew",
        "--exit-code": "is --strict",
        "--filters": "is a sweep: --set 'sweep.filters.lp1.order=[1, 2, 3, 4]' has the norm of the channel for each order",
        "--partition": "is gone: --out FILE.parquet writes the Parquet file alone",
        "--root-locus": "is `wavesweep poles SPEC --over NUMBER`",
        "--gains": "is gone, since all numbers are constants in C: --set them, and export again",
    }
)
GONE = MappingProxyType(
    {
        "compare": "Compare specs with `wavesweep zwidth SPEC...` for walls, `wavesweep bode SPEC...` for responses.",
        "explain": "docs/concepts.md has its words, docs/tables.md the columns and words of doubt.",
        "inspect": "pandas.read_parquet shows a table, and the data package beside it says what its columns mean.",
    }
)


def command_of(name: str) -> click.Command:
    """Import the command of that name."""
    function = name.replace("-", "_")
    capability = home_of(name)
    if capability:
        home = capability.module("command")
    elif name in STUDIES:
        home = import_module("wavesweep.program.cli.study_commands")
    else:
        home = import_module(f"wavesweep.program.cli.{function}")
        function = "command"
    command: click.Command = getattr(home, function)
    return command


class LazyGroup(click.Group):
    """A click group over the static table of commands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names of the commands, in the order of the table."""
        del ctx
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command; None for an unknown name."""
        del ctx
        if cmd_name not in COMMANDS:
            return None
        return command_of(cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that the first argument names; a usage error with the nearest name if no command is called so."""
        name = str(args[0])
        if name not in COMMANDS and not name.startswith("-") and not ctx.resilient_parsing:
            from difflib import get_close_matches

            if name in GONE:
                ctx.fail(f"{name} is no longer a command. {GONE[name]}")
            close = get_close_matches(name, COMMANDS, n=1)
            ctx.fail(f"No such command {name!r}." + (f" Did you mean {close[0]}?" if close else ""))
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Commands from the table, without importing their modules; options of the group."""
        from click.shell_completion import CompletionItem

        named = (
            CompletionItem(name, help=said)
            for name, said in COMMANDS.items()
            if name.startswith(incomplete)
        )
        return [*named, *click.Command.shell_complete(self, ctx, incomplete)]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by question, from the table, without importing their modules as click would."""
        del ctx
        listed = set(chain.from_iterable(QUESTIONS.values()))
        unlisted = tuple(name for name in COMMANDS if name not in listed)
        for question, names in (*QUESTIONS.items(), (OTHER_COMMANDS, unlisted)):
            if rows := [(name, COMMANDS[name]) for name in names if name in COMMANDS]:
                with formatter.section(question):
                    formatter.write_dl(rows)


def _print_version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted and not ctx.resilient_parsing:
        from wavesweep import __version__

        click.echo(f"wavesweep {__version__}")
        ctx.exit()


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_print_version,
    help="Print the version.",
)
# `Verbosity` has taken these out of the line; they are declared so that the help lists them.
@click.option(
    "-q",
    "--quiet",
    is_flag=True,
    expose_value=False,
    help="Print errors only: no summary and no progress.",
)
@click.option(
    "--json",
    is_flag=True,
    expose_value=False,
    help="Print the summary as one JSON object on stdout, and no text. docs/commands.md explains its keys.",
)
@click.option(
    "--debug", is_flag=True, expose_value=False, help="Show a traceback if the command fails."
)
@click.pass_context
def group(context: click.Context) -> None:
    """Stability, rendering range and transparency of haptic and other linear loops of several rates.

    A SPEC is a TOML file. Results go to results/<the spec's name>/, messages to stderr. The options
    below belong to every command, and may stand anywhere in the line. Exit codes: 0 done, 1 failed,
    2 usage or spec error, 129 hung up, 130 interrupted, 143 terminated.
    """
    from wavesweep.program.cli.messages import speaking

    if memory_limit() < LEAST_MEMORY:
        raise WavesweepError(
            f"this process may take {memory_limit() / 1e6:.0f} MB of memory (ulimit -v), with which libraries crash or hang; "
            f"expected at least {LEAST_MEMORY / 1e6:.0f} MB, and 900 MB for figures"
        )
    if verbosity().as_json and context.invoked_subcommand in WITHOUT_SUMMARY:
        raise click.UsageError(
            f"--json: {context.invoked_subcommand} prints no summary; leave it out"
        )
    context.with_resource(speaking(verbosity().quiet))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code.

    arguments: the words after the program's name, those of this process by default. Exit codes: 0
    done; 1 failed; 2 usage or spec error; 129 hung up (SIGHUP); 130 interrupted (SIGINT); 143
    terminated (SIGTERM). A second Ctrl-C ends the process at once. A traceback is printed only if
    --debug is given.
    """
    as_program = arguments is None
    if as_program:
        _replace_closed_streams()
        # A BLAS reads these when numpy loads it. Workers have one thread, and last digits of
        # responses depend on the number.
        for name in ONE_THREAD:
            os.environ.setdefault(name, "1")
        # Python's own 700 makes it look through the classes of libraries again and again, for a
        # tenth of the time of a report.
        gc.set_threshold(30_000)
        # A notebook names its own, and matplotlib does not even start if it cannot find it. No
        # window is ever opened here.
        os.environ.pop("MPLBACKEND", None)
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    (spoken, words), stopped = Verbosity.of(arguments), False
    try:
        with signals_unwind(as_program), _warnings_unsaid(spoken.debug):
            code = group.main(words, prog_name="wavesweep", standalone_mode=False, obj=spoken)
    except BaseException as error:  # noqa: BLE001 - the one place that gives each kind of failure its line and exit code
        if spoken.debug and not isinstance(error, SystemExit | click.ClickException):
            import traceback

            traceback.print_exception(error)
        code = _exit_code(error, spoken.as_json)
        stopped = isinstance(error, Stopped) or _lacks_memory(error)
    code = _flushed(code if isinstance(code, int) else 0)
    if as_program and stopped:
        # Python's own end would wait for threads, a further signal would change the exit code, and
        # libraries that lacked memory may crash.
        os._exit(code)
    return code


def _exit_code(error: BaseException, as_json: bool) -> int:
    """Print a line about the error, and with --json an object as well, and return its exit code."""
    # click's way to end, for a reader of stdout who has gone as well
    if isinstance(error, SystemExit):
        if isinstance(error.code, int):
            return error.code
        return int(error.code is not None)
    from wavesweep.program.cli.messages import printable, show_json

    if isinstance(error, click.ClickException):
        if isinstance(error, click.NoSuchOption) and error.option_name in MOVED:
            error = click.UsageError(f"{error.option_name} {MOVED[error.option_name]}", error.ctx)
        elif isinstance(error, click.NoSuchOption) and error.option_name == "--proof" and error.ctx:
            error = click.UsageError(_no_proof_file(error.ctx), error.ctx)
        error.message = printable(error.message)  # type: ignore[misc] # click shows it
        code, line = error.exit_code, error.format_message()
        with suppress(OSError):
            error.show()
    else:
        code, line = _line(error)
        _say(line := printable(line))
    if as_json:
        with suppress(OSError):
            show_json({"error": line.removeprefix("Error: "), "exit_code": code})
    return code


def _no_proof_file(context: click.Context) -> str:
    """What is said of --proof beside a command that writes no proof file."""
    writing = [
        name
        for name in COMMANDS
        if any("--proof" in option.opts for option in command_of(name).params)
    ]
    return f"--proof: no proof file for {context.info_name}; those that write one are {', '.join(writing)}"


def _line(error: BaseException) -> tuple[int, str]:
    """The exit code of an error, and what is said of it."""
    match error:
        case KeyboardInterrupt() | click.Abort():
            return 130, _with_notes("Interrupted.", error)
        case Stopped():
            return error.exit_code, _with_notes(error.line, error)
        case SpecError():
            # Its lines begin with file:line:column, which editors and terminals follow.
            return error.exit_code, str(error)
        case WavesweepError():
            return error.exit_code, _with_notes(f"Error: {error}", error)
        case _ if _lacks_memory(error):
            said = f"Error: out of memory{_limit()}"
        case OSError() if error.errno == errno.ENAMETOOLONG:  # a name that was given
            return 2, f"Error: {_os_error(error)}; choose another name"
        case OSError():
            said = f"Error: {_os_error(error)}"
        case _ if type(error).__name__ in BEYOND_DOUBLES:
            said = f"Error: numbers beyond double precision ({error}); are the values given as meant? (--debug shows where)"
        case _:
            said = f"Error: {type(error).__name__}: {error} (a fault of wavesweep; --debug shows where)"
    return 1, _with_notes(said, error)


def _lacks_memory(error: BaseException) -> bool:
    """Whether there was no memory, for data or for a library."""
    if isinstance(error, ImportError):
        return any(text in str(error) for text in NO_ROOM)
    return isinstance(error, MemoryError)


def _limit() -> str:
    """The limit of the address space of this process, if it has one, for a message."""
    limit = memory_limit()
    if math.isinf(limit):
        return ""
    return f"; this process may take {limit / 1e6:.0f} MB (ulimit -v), a higher limit helps"


def _say(text: str) -> None:
    """Write to stderr, if it can be written."""
    from wavesweep.program.cli.messages import printable

    with suppress(OSError):
        click.echo(printable(text), err=True)


def _with_notes(text: str, error: BaseException) -> str:
    """Add the notes of the error, such as the place of a checkpoint, as sentences."""
    # click turns a KeyboardInterrupt into an Abort of its own; the notes stay with the former.
    passed = error.__cause__ if isinstance(error, click.Abort) else error
    notes = getattr(passed, "__notes__", ())
    return " ".join([text.rstrip() + "." * bool(notes and not text.rstrip().endswith(".")), *notes])


def _os_error(error: OSError) -> str:
    where = error.filename
    if where is None:
        try:
            sys.stdout.flush()
        except OSError:
            where = "stdout"
    if where is not None:
        return f"{where}: {error.strerror or error}"
    return f"{error.strerror or error}"


@contextmanager
def _warnings_unsaid(debug: bool) -> Iterator[None]:
    """Keep warnings of libraries from a user's terminal: numbers have bounds and doubts of their own."""
    before = warnings.showwarning
    if not debug:
        warnings.showwarning = lambda *_, **__: None
    try:
        yield
    finally:
        warnings.showwarning = before


def _replace_closed_streams() -> None:
    """Put the null device in place of closed standard streams: no other file may get their numbers, and None has no `write`.

    That of stdout can only be read, so that a table that goes there is an error and not silently
    lost.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, os.O_WRONLY if name == "stderr" else os.O_RDONLY)
            os.dup2(opened, number)
            os.set_inheritable(number, True)
            if opened != number:
                os.close(opened)
        if getattr(sys, name) is None:
            mode = "w" if number else "r"
            stream = open(number, mode, encoding="utf-8", closefd=False)  # noqa: SIM115 - open to the end
            setattr(sys, name, stream)


def _flushed(code: int) -> int:
    """Flush stdout and stderr, and return the exit code: 1 if a part of stdout is lost.

    Text that cannot be written is dropped here, because Python would try again at its end and make
    the exit code 120.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            if stream is sys.stdout:
                if not code and not isinstance(error, BrokenPipeError):
                    _say(f"Error: stdout: {error.strerror}")
                code = code or 1
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, stream.fileno())
            os.close(null)
    return code
