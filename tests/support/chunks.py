"""Finished chunks in the checkpoints of a folder, also while a run writes them."""

import os
import signal
import sqlite3
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from wavesweep.program.sweep.pools import timed


@dataclass
class DieOnce:
    """Computes a chunk, after it killed its process if no other one was killed before. mark: a file that then is there."""

    mark: Path

    def __call__(self, *given):
        if not self.mark.exists():
            self.mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return timed(*given)


def meet(folder, count):
    """Wait until `count` processes have come to a folder; the id of this one."""
    (folder / str(os.getpid())).touch()
    patience = time.monotonic() + 120
    while sum(1 for _ in folder.iterdir()) < count:
        assert time.monotonic() < patience, f"{count} processes did not start"
        time.sleep(0.01)
    return os.getpid()


def finished(folder, name=""):
    """Numbers of the chunks in all checkpoints `.<name>*.sqlite` of a folder."""
    return [number for path in sorted(Path(folder).glob(f".{name}*.sqlite")) for number in finished_in(path)]


def finished_in(path):
    """The same of one checkpoint."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
        try:
            return [number for (number,) in database.execute("SELECT number FROM chunks ORDER BY number")]
        except sqlite3.OperationalError:  # it is being made, or removed
            return []


def changed(path, statement, *values):
    """Change the rows of a checkpoint."""
    with closing(sqlite3.connect(path)) as database, database:
        assert database.execute(statement, values).rowcount > 0
