"""Where the program starts, and the one place where errors become exit codes."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

import click

from wavesweep.cli.group import group
from wavesweep.errors import SpecError, WavesweepError

INTERRUPTED = 130
TERMINATED = 143


class Terminated(BaseException):
    """SIGTERM arrived. No Exception, so that nothing on the way takes it for a failure that it could handle."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and give the exit code.

    0 done; 1 failed; 2 usage or spec error; 130 interrupted (SIGINT); 143 terminated (SIGTERM).
    A traceback appears with --debug only.
    """
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with _sigterm_unwinds():
            code = group.main(arguments, prog_name="wavesweep", standalone_mode=False)
    except BaseException as error:  # noqa: BLE001 - the one place where each kind of failing gets its line and exit code
        if "--debug" in arguments and not isinstance(error, SystemExit | click.ClickException):
            import traceback

            traceback.print_exception(error)
        return _exit_code(error)
    return code if isinstance(code, int) else 0


def _exit_code(error: BaseException) -> int:
    """Say in a line what went wrong, and give the exit code that goes with it."""
    match error:
        case SystemExit():
            raise error
        case click.ClickException():
            error.show()
            return error.exit_code
        case KeyboardInterrupt() | click.Abort():
            _say(_with_notes("Interrupted.", error))
            return INTERRUPTED
        case Terminated():
            _say(_with_notes("Terminated.", error))
            return TERMINATED
        case SpecError():
            # Its lines begin with file:line:column, which editors and terminals follow.
            _say(str(error))
        case WavesweepError():
            _say(_with_notes(f"Error: {error}", error))
        case MemoryError():
            _say(_with_notes("Error: out of memory; fewer values per axis or fewer --jobs take less", error))
        case OSError():
            _say(_with_notes(f"Error: {_os_error(error)}", error))
        case _:
            _say(f"Error: {type(error).__name__}: {error} (a fault of wavesweep; --debug shows where)")
    return error.exit_code if isinstance(error, WavesweepError) else 1


def _with_notes(text: str, error: BaseException) -> str:
    """Add what those that the error passed on its way have to say, such as where half of the work is kept."""
    # click turns a KeyboardInterrupt into an Abort of its own; the notes stay with the former.
    passed = error.__cause__ if isinstance(error, click.Abort) else error
    return " ".join([text.rstrip(), *getattr(passed, "__notes__", ())])


def _os_error(error: OSError) -> str:
    where = f"{error.filename}: " if error.filename is not None else ""
    return f"{where}{error.strerror or error}"


def _say(text: str) -> None:
    click.echo(text, err=True)


@contextmanager
def _sigterm_unwinds() -> Iterator[None]:
    """Let SIGTERM unwind the stack, so that temporary files go and workers stop."""

    def unwind(_: int, __: FrameType | None) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, unwind)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
