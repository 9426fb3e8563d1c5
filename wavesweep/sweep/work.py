"""What runs in a worker. Loads numpy and what computes; nothing of joblib."""

import os
import signal
import threading
import time

import numpy as np

from wavesweep.sweep.records import records_of
from wavesweep.sweep.slices import Work, solve


def timed(number: int, work: Work, parent: int) -> tuple[int, np.ndarray, float]:
    """Solve a chunk: its number, its records, and the seconds that it took. parent: process id of whoever asks."""
    if os.getpid() != parent and threading.current_thread() is threading.main_thread():
        # Ctrl-C reaches every process of the terminal; the parent alone decides what becomes of the run.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    started = time.perf_counter()
    records = records_of(solve(work))
    return number, records, time.perf_counter() - started
