"""Signals to a run, to its workers and to all of them: an exit code, at most one line, and nobody left behind."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from support.chunks import finished
from support.program import started

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="finds the processes of a run in /proc"),
]
SPEC = """
[environment]
integration = "explicit"
[controller]
kind = "pmw"
[sweep]
K_VE = { start = 0, stop = 20000 }
b = { start = 5, stop = 100, num = 500 }
B_VE = { start = 0, stop = 15, num = 241 }
"""
SECONDS = 60  # in which everything has to end, also on a machine that does much else
STOPPED = {signal.SIGINT: "Interrupted.", signal.SIGTERM: "Terminated.", signal.SIGHUP: "Hung up."}


@dataclass
class Run:
    """A run in a process group of its own, and the mark by which its processes are known."""

    process: subprocess.Popen
    mark: str

    def alive(self):
        """Ids of all processes that the run has started and that still live, its own among them."""
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                if self.mark.encode() in (folder / "environ").read_bytes() and "Z" not in _state(folder):
                    found.append(int(folder.name))
            except OSError:
                continue
        return found

    def workers(self):
        """Ids of the worker processes."""
        return [pid for pid in self.alive() if pid != self.process.pid]

    def finish(self):
        """Exit code and what was said; everything has to be gone soon, so that nobody holds the pipe."""
        said = self.process.communicate(timeout=300)[1]
        patience = time.monotonic() + SECONDS
        while left := self.alive():
            assert time.monotonic() < patience, f"still there: {left}"
            time.sleep(0.05)
        return self.process.returncode, said


def _state(folder):
    return (folder / "stat").read_text().rpartition(")")[2].split()[0]


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    """Start a run with these options in a folder."""
    home = tmp_path_factory.mktemp("spec")
    (home / "wall.toml").write_text(SPEC)
    number = iter(range(10**6))

    def begin(out, *options):
        mark = f"{home}-{next(number)}-"
        run = started(home, "zwidth", "wall.toml", "--out", out, *options, WAVESWEEP_TEST_RUN=mark)
        return Run(run, f"WAVESWEEP_TEST_RUN={mark}")

    return begin


def wait_for(condition):
    patience = time.monotonic() + 300
    while not condition():
        assert time.monotonic() < patience, "did not happen in 300 s"
        time.sleep(0.02)


FORKS = ("--jobs", "2", "--backend", "fork")


def test_nobody_outlives_a_run_that_is_killed(start, tmp_path):
    run = start(tmp_path / "out", *FORKS)
    wait_for(run.workers)
    run.process.kill()
    assert run.finish() == (-signal.SIGKILL, "")


def test_a_worker_that_is_killed_is_an_error_at_once(start, tmp_path):
    run = start(tmp_path / "out", *FORKS)
    wait_for(lambda: finished(tmp_path / "out"))
    os.kill(run.workers()[0], signal.SIGKILL)
    code, said = run.finish()
    assert code == 1
    assert said.startswith("Error: a worker process died (killed, or out of memory)")
    assert "the same command goes on from there" in said
    assert said.count("\n") == 1


KILLED_WHILE_THEY_SEND = """
import os, signal
from multiprocessing.connection import Connection
from wavesweep.engine.errors import WavesweepError
receive = Connection._recv
def cut_short(self, size, *more):
    if size > 10**6:
        for each in ids:
            os.kill(each, signal.SIGKILL)
    return receive(self, size, *more)
Connection._recv = cut_short
"""


def test_copies_that_are_killed_while_they_send_an_answer_are_an_error_at_once():
    program = (
        KILLED_WHILE_THEY_SEND
        + """
from wavesweep.program.sweep.forks import in_forks
answers = in_forks(2, range(40), lambda number: (os.getpid(), bytes(10**7 if number > 20 else 1)))
ids = {next(answers)[0] for _ in range(4)}
try:
    list(answers)
except WavesweepError:
    print("died")
"""
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=300)
    assert (run.stdout, run.stderr) == ("died\n", "")


def test_workers_that_are_killed_while_they_send_a_result_are_an_error():
    program = (
        KILLED_WHILE_THEY_SEND
        + """
from wavesweep.program.sweep import pools
from wavesweep.program.sweep.pools import in_parallel
pools.LOOKS = 1
ids = {found for found, _ in in_parallel(2, [(os.getpid,)] * 50)}
try:
    list(in_parallel(2, [(bytes, 10**7)] * 2))
except WavesweepError:
    print("died")
"""
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=300)
    assert (run.stdout, run.stderr) == ("died\n", "")


@pytest.mark.sample(1)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP], ids=lambda n: n.name)
def test_a_second_signal_ends_the_run_at_once_and_without_a_traceback(start, tmp_path, number):
    run = start(tmp_path / "out", *FORKS)
    wait_for(lambda: finished(tmp_path / "out"))
    for _ in range(3):
        os.killpg(run.process.pid, number)
        time.sleep(0.01)
    code, said = run.finish()
    assert code == 128 + number
    assert "Traceback" not in said
    assert all(line.startswith(STOPPED[number]) for line in said.split("\n") if line)


@pytest.mark.parametrize("after", ["pass", "raise ImportError('initialization failed')"])
def test_a_signal_whose_exception_a_library_drops_or_changes_counts(tmp_path, after):
    program = "import os, signal\nfrom wavesweep.program.cli import stopping\n"
    program += (
        "try:\n    with stopping.signals_unwind(False):\n        try:\n            os.kill(os.getpid(), signal.SIGTERM)\n"
    )
    program += (
        f"        except BaseException:\n            {after}\nexcept stopping.Stopped as error:\n    print(error.exit_code)"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert (run.stdout, run.stderr) == ("143\n", "")
