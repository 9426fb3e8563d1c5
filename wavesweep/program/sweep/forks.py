"""Workers that are forked from this process: they have all modules, and what was computed of the
loop before, from the first chunk on.

They read the numbers of their tasks from one pipe, in messages so short that the system never
divides them, so whoever is ready takes the next. Each has a pipe for its answers, whose end says
that it has died, also in the middle of an answer: the workers of `concurrent.futures` share one
pipe, and a run whose worker is killed as it sends an answer waits for the rest for ever.
"""

import logging
import os
import pickle
import signal
import struct
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from itertools import islice
from multiprocessing.connection import Connection, Pipe, wait
from typing import NoReturn

from wavesweep.engine.errors import WavesweepError
from wavesweep.program.platform_compat import one_thread
from wavesweep.program.sweep.pools import AHEAD, DIED, settle_in, started_here

NUMBER = struct.Struct("=q")  # a message to the workers
STREAMS = 3  # descriptors of stdin, stdout and stderr


def in_forks(count: int, numbers: Iterable[int], work: Callable[[int], object]) -> Iterator:
    """Yield `work(number)` of each number as it is finished, in no particular order.

    count: of the workers, which end with the iterator. Errors: those of the work; WavesweepError if
    a worker dies.
    """
    numbers = iter(numbers)
    parent = os.getpid()
    workers: dict[Connection, int] = {}  # our ends of the pipes, and who is at the others
    with ExitStack() as opened:
        asked, asking = os.pipe()
        opened.callback(os.close, asking)
        opened.callback(os.close, asked)
        with started_here():
            for _ in range(count):
                answers, answering = Pipe(duplex=False)
                workers[answers] = worker = _copied()
                if not worker:
                    _serve(parent, asked, answering, work)
                opened.callback(_end, worker, answers)
                answering.close()
        left = 0
        for number in islice(numbers, AHEAD * count):
            os.write(asking, NUMBER.pack(number))
            left += 1
        while left:
            for answers in wait(list(workers)):
                try:
                    failed, answer = answers.recv()
                except (EOFError, OSError) as error:
                    raise WavesweepError(DIED) from error
                if failed:
                    raise answer
                left -= 1
                for number in islice(numbers, 1):
                    os.write(asking, NUMBER.pack(number))
                    left += 1
                yield answer


def _copied() -> int:
    """Copy this process; the number of the copy, 0 in the copy."""
    with warnings.catch_warnings():
        # Threads of BLAS, which a copy starts anew, are counted as well.
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def _end(worker: int, answers: Connection) -> None:
    """End a worker, whatever it does."""
    os.kill(worker, signal.SIGKILL)
    os.waitpid(worker, 0)
    answers.close()


def _serve(
    parent: int, asked: int, answering: Connection, work: Callable[[int], object]
) -> NoReturn:
    """Be a worker, to the end of this process.

    Descriptors of the run are closed: among them are its lock and other workers' pipes, which would
    outlive it with this process.
    """
    try:
        kept = sorted((asked, answering.fileno()))
        for first, last in zip(
            (STREAMS - 1, *kept), (*kept, os.sysconf("SC_OPEN_MAX")), strict=True
        ):
            os.closerange(first + 1, last)
        settle_in(parent)
        logging.disable()  # who listens is the run
        with one_thread():
            while message := os.read(asked, NUMBER.size):
                try:
                    answer = False, work(*NUMBER.unpack(message))
                except Exception as error:  # noqa: BLE001 - any is raised where the answer is read
                    answer = True, error
                answering.send_bytes(pickle.dumps(answer, pickle.HIGHEST_PROTOCOL))
    finally:
        os._exit(1)
