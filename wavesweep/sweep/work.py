"""What runs in a worker. Loads numpy and what computes; nothing of joblib."""

import os
import signal
import threading
import time
from functools import cache
from typing import Protocol

import numpy as np

WATCH = 0.5  # s between two looks at the parent


class Work(Protocol):
    """Any piece of work: values and arrays that know what to do with themselves."""

    def records(self) -> np.ndarray:
        """Do it; a structured array."""


def timed(number: int, work: Work, parent: int) -> tuple[int, np.ndarray, float]:
    """Solve a chunk: its number, its records, and the processor's seconds that it took. parent: process id of whoever asks."""
    if os.getppid() == parent:
        _settle_in(parent)
    started = time.thread_time()
    records = work.records()
    return number, records, time.thread_time() - started


@cache  # once in a process
def _settle_in(parent):
    """Leave Ctrl-C, which reaches every process of a terminal, to the parent; and end when the parent is gone."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch():
        while os.getppid() == parent:
            time.sleep(WATCH)
        # Killed without a word; a pool's worker would wait for work for minutes.
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
