"""Signals that stop a run: they unwind the stack, so that temporary files are removed and workers end."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from wavesweep.program.platform_compat import HANGUP, STOPPING

# Their messages; the exit code is 128 plus the number of the signal, as in a shell.
STOPPED = {"SIGINT": "Interrupted.", "SIGTERM": "Terminated.", "SIGHUP": "Hung up."}


class Stopped(BaseException):
    """A signal asked the run to stop. Not a subclass of Exception, so that no handler of errors catches it."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.line, self.exit_code = STOPPED[signal.Signals(number).name], 128 + number


@contextmanager
def signals_unwind(to_the_end: bool) -> Iterator[None]:
    """Let signals that stop a run unwind the stack, so that temporary files are removed and workers end.

    The second Ctrl-C or SIGTERM ends the process at once. A signal that is ignored stays so (nohup,
    jobs in the background). to_the_end: leave none of Python's own afterwards, whose errors have
    tracebacks while Python shuts down.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    stopped: list[int] = []

    def unwind(number: int, _: FrameType | None) -> None:
        if not stopped:
            stopped.append(number)
            raise Stopped(number)
        if number != HANGUP:  # a closing terminal and its shell both send it
            os._exit(128 + number)

    before, hook = {number: signal.getsignal(number) for number in STOPPING}, sys.unraisablehook
    sys.unraisablehook = _sent_again(stopped, hook)
    for number in STOPPING:
        if before[number] in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, unwind)
    try:
        with _counted(stopped):
            yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(
                number,
                signal.SIG_DFL if to_the_end and handler is signal.default_int_handler else handler,
            )


@contextmanager
def _counted(stopped: list[int]) -> Iterator[None]:
    """Raise Stopped for a signal whose exception a library has dropped or replaced; stopped: the signals that came."""
    try:
        yield
    except Exception as error:  # any that a library may have put in place of the signal's
        if stopped:
            raise Stopped(stopped[0]) from error
        raise
    if stopped:
        raise Stopped(stopped[0])


def _sent_again(stopped: list[int], hook: Callable[[Any], object]) -> Callable[[Any], None]:
    """Return a hook that sends a signal once more if it arrived while Python finalised an object, which drops its exception."""

    def again(failed: Any) -> None:
        if not isinstance(failed.exc_value, Stopped):
            hook(failed)
            return
        stopped.clear()
        timer = threading.Timer(
            0.01,  # s
            os.kill,
            (os.getpid(), failed.exc_value.exit_code - 128),
        )
        timer.daemon = True
        timer.start()

    return again
