"""Answers from processes of their own, which are ended with an answer that takes too long."""

import signal
from collections.abc import Callable, Mapping
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Any

PROCESSES = 2  # for an answer that takes long, and for those that follow a slider meanwhile

Answers = Mapping[str, Callable[[Any], Any]]


def _serve(connection: Connection, make: Callable[[], Answers]) -> None:
    """Answer one (name, question) after the other. Ctrl-C is for the process that asks."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = make()
    connection.send(None)  # ready: what answers need is imported
    while True:
        try:
            name, question = connection.recv()
        except EOFError:
            return
        try:
            connection.send((answers[name](question), None))
        except Exception as error:  # noqa: BLE001 - whatever it is, it is the caller's
            connection.send((None, error))


class _Process:
    """A process that answers, started without waiting for it."""

    def __init__(self, make: Callable[[], Answers]) -> None:
        context = get_context("spawn")
        self._connection, other_end = context.Pipe()
        self._process = context.Process(target=_serve, args=(other_end, make), daemon=True)
        self._process.start()
        other_end.close()
        self._ready = False

    def ask(self, name: str, question: object, seconds: float) -> Any:
        """Give an answer or raise its error. Errors: TimeoutError after so many seconds."""
        if not self._ready:
            self._connection.recv()
            self._ready = True
        self._connection.send((name, question))
        if not self._connection.poll(seconds):
            raise TimeoutError
        answer, error = self._connection.recv()
        if error is not None:
            raise error
        return answer

    def end(self) -> None:
        """End the process, whatever it is at."""
        self._process.kill()
        self._process.join()
        self._connection.close()


class LimitedAnswers:
    """Answers that take at most so many seconds each, by name; `make` gives them in each process
    and can be pickled."""

    def __init__(self, make: Callable[[], Answers], seconds: float) -> None:
        self._make, self._seconds = make, seconds
        self._idle: SimpleQueue[_Process] = SimpleQueue()
        for _ in range(PROCESSES):
            self._idle.put(_Process(make))

    def of(self, name: str) -> Callable[[Any], Any]:
        """The answer to the questions of a name; one that is cut is `{"error": ..., "cut": True}`."""
        return partial(self._ask, name)

    def _ask(self, name: str, question: object) -> Any:
        process = self._idle.get()
        try:
            return process.ask(name, question, self._seconds)
        except TimeoutError:
            process.end()
            process = _Process(self._make)
            return {"error": f"takes longer than {self._seconds:g} s", "cut": True}
        finally:
            self._idle.put(process)

    def end(self) -> None:
        """End the processes, once no answer is waited for."""
        for _ in range(PROCESSES):
            self._idle.get().end()
