"""Entry point: the table of commands, and the one place in which errors become exit codes.

A new command is a line in `COMMANDS` and a module of its name with a `command` in it.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from types import FrameType, MappingProxyType, ModuleType
from typing import TYPE_CHECKING

import click

from wavesweep.errors import SpecError, WavesweepError

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

INTERRUPTED = 130
TERMINATED = 143
COMPLETING = "_WAVESWEEP_COMPLETE"  # set by the completion of a shell

# The short helps are listed here so that `wavesweep --help` need not import the commands; a test holds them against these.
COMMANDS = MappingProxyType(
    {
        "zwidth": "Find the stable intervals of the stiffness K_VE for each B_VE and each other axis.",
        "stability-region": "Find the stable intervals along any axis for every combination of the others.",
        "bode": "Compute transmitted admittance and impedance over frequency, one curve per spec.",
        "compare": "Compare the Z-width and the responses of several specs, in one figure and one table.",
        "simulate": "Simulate both loops tick by tick, optionally with contact, friction and hardware limits.",
        "passivity": "Compute the norm of the wave channel and the passivity margin at the hand's port.",
        "paper": "Reproduce the paper's figures and test its statements.",
        "bench": "Measure run time against error, for this tool and for other methods.",
        "plot": "Draw the figure of a table again, as PNG, SVG or PDF.",
        "check": "Judge a spec's own design, and list the work that each command would do.",
        "init": "Write a commented spec to begin with.",
        "keys": "Explain the keys of a spec: values, units and defaults.",
    }
)


def module_of(name: str) -> str:
    """Return the name of the module of a command."""
    return f"wavesweep.cli.{name.replace('-', '_')}"


class LazyGroup(click.Group):
    """A click group over the static table of commands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names of the commands, in the order of the table."""
        del ctx
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command; None if there is none of this name."""
        del ctx
        if cmd_name not in COMMANDS:
            return None
        command = import_module(module_of(cmd_name)).command
        return _completion().prepare(command) if COMPLETING in os.environ else command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that the first argument names; if there is none of that name, a usage error with the nearest one."""
        name = str(args[0])
        if name not in COMMANDS and not name.startswith("-") and not ctx.resilient_parsing:
            from difflib import get_close_matches

            close = get_close_matches(name, COMMANDS, n=1)
            ctx.fail(f"No such command {name!r}." + (f" Did you mean {close[0]}?" if close else ""))
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Commands from the table, without importing their modules; options of the group."""
        options = click.Command.shell_complete(self, ctx, incomplete)
        return [*_completion().commands(COMMANDS.items(), incomplete), *options]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands from the table, without importing their modules as click would."""
        del ctx
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


def _completion() -> ModuleType:
    from wavesweep.cli import completion

    return completion


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
def group() -> None:
    """Stability, rendering range and transparency of multirate wave-variable haptic loops.

    A SPEC is a TOML file. Results go to results/<the spec's name>/, messages to stderr.
    Exit codes: 0 done, 1 failed, 2 usage or spec error, 130 interrupted, 143 terminated.
    """


class Terminated(BaseException):
    """SIGTERM arrived. Not a subclass of Exception, so that no handler of errors catches it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code.

    arguments: the words after the program's name, those of this process by default.
    Exit codes: 0 done; 1 failed; 2 usage or spec error; 130 interrupted (SIGINT); 143 terminated (SIGTERM).
    A traceback is printed only if --debug is given.
    """
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if COMPLETING in os.environ:
            _completion().register()
        with _sigterm_unwinds():
            code = group.main(arguments, prog_name="wavesweep", standalone_mode=False)
    except BaseException as error:  # noqa: BLE001 - the one place that gives each kind of failure its line and exit code
        if "--debug" in arguments and not isinstance(error, SystemExit | click.ClickException):
            import traceback

            traceback.print_exception(error)
        return _exit_code(error)
    return code if isinstance(code, int) else 0


def _exit_code(error: BaseException) -> int:
    """Print a line about the error and return its exit code."""
    match error:
        case SystemExit():
            raise error
        case click.ClickException():
            error.show()
            return error.exit_code
        case KeyboardInterrupt() | click.Abort():
            click.echo(_with_notes("Interrupted.", error), err=True)
            return INTERRUPTED
        case Terminated():
            click.echo(_with_notes("Terminated.", error), err=True)
            return TERMINATED
        case SpecError():
            # Its lines begin with file:line:column, which editors and terminals follow.
            click.echo(str(error), err=True)
        case WavesweepError():
            click.echo(_with_notes(f"Error: {error}", error), err=True)
        case MemoryError():
            click.echo(_with_notes("Error: out of memory; fewer values per axis or fewer --jobs take less", error), err=True)
        case OSError():
            click.echo(_with_notes(f"Error: {_os_error(error)}", error), err=True)
        case _:
            click.echo(f"Error: {type(error).__name__}: {error} (a fault of wavesweep; --debug shows where)", err=True)
    return error.exit_code if isinstance(error, WavesweepError) else 1


def _with_notes(text: str, error: BaseException) -> str:
    """Add the notes of the error, such as the place of a checkpoint."""
    # click turns a KeyboardInterrupt into an Abort of its own; the notes stay with the former.
    passed = error.__cause__ if isinstance(error, click.Abort) else error
    return " ".join([text.rstrip(), *getattr(passed, "__notes__", ())])


def _os_error(error: OSError) -> str:
    where = f"{error.filename}: " if error.filename is not None else ""
    return f"{where}{error.strerror or error}"


@contextmanager
def _sigterm_unwinds() -> Iterator[None]:
    """Let SIGTERM unwind the stack, so that temporary files are removed and workers stop."""

    def unwind(_: int, __: FrameType | None) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, unwind)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
