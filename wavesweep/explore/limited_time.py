"""Calls that are cut when they take too long."""

import ctypes
from collections.abc import Callable
from threading import Thread
from typing import Any


class _Cut(BaseException):
    """Raised in a thread that nobody waits for any more."""


def within(seconds: float, call: Callable[[], Any]) -> Any:
    """What a call returns or raises. Errors: TimeoutError after so many seconds.

    The call runs in a thread of its own, which ends with its next step of Python when it is cut.
    """
    found: dict[str, Any] = {}

    def run() -> None:
        try:
            found["answer"] = call()
        except _Cut:
            return
        except BaseException as error:  # noqa: BLE001 - whatever it is, it is the caller's
            found["error"] = error

    thread = Thread(target=run, daemon=True)
    thread.start()
    thread.join(seconds)
    if thread.is_alive():
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(thread.ident), ctypes.py_object(_Cut)
        )
        raise TimeoutError
    if "error" in found:
        raise found["error"]
    return found["answer"]
