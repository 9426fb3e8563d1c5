"""Signals to a run, to its workers and to all of them: an exit code, at most one line, nobody left behind, the same bytes.

WAVESWEEP_KILLS=20 in the environment asks for more kills than those of an ordinary test run, late ones and early ones.
"""

import contextlib
import json
import os
import random
import select
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from support.chunks import finished
from support.program import started

from wavesweep.program.atomic_files import SCRATCH

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
KILLS = int(os.environ.get("WAVESWEEP_KILLS", "2"))
WORK = 0.3  # s from the first chunk on, about as long as the others take
SECONDS = 60  # in which everything has to end, also on a machine that does much else
STOPPED = {signal.SIGINT: "Interrupted.", signal.SIGTERM: "Terminated."}


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
        """Ids of the worker processes, without the one that keeps loky's semaphores."""
        found = []
        for pid in self.alive():
            with contextlib.suppress(OSError):
                found += [pid] * (b"popen_loky" in Path(f"/proc/{pid}/cmdline").read_bytes())
        return found

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


WORKERS = ("--jobs", "2", "--backend", "loky")

FILES = ("zwidth.csv", "zwidth.parquet")


@pytest.fixture(scope="module")
def undisturbed(start, tmp_path_factory):
    """The files of a run that nobody stopped."""
    whole = tmp_path_factory.mktemp("whole")
    assert start(whole, "--jobs", "1").finish()[0] == 0
    return contents(whole)


def contents(folder):
    return [(folder / name).read_bytes() for name in FILES]


def test_a_run_killed_at_random_moments_gives_the_same_bytes(start, tmp_path, undisturbed):
    """Late ones and early ones, by turns."""
    share = (np.arange(KILLS) + np.random.default_rng(7).random(KILLS)) / KILLS
    for killed, moment in enumerate(share):
        out = tmp_path / f"out{killed}"
        run = start(out, "--jobs", "1")
        if killed % 2 == 0:  # among the chunks, and not before them
            wait_for(lambda out=out: finished(out))
        time.sleep(WORK * moment if killed % 2 == 0 else 0.2 + moment)
        os.killpg(run.process.pid, signal.SIGKILL)
        run.finish()
        done = (out / "zwidth.datapackage.json").exists()  # put in place last; then the checkpoint goes
        kept = len(finished(out)) if out.exists() and not done else 0
        if (out / "zwidth.csv").exists():
            # Put in place one by one: whichever is there is whole.
            assert (out / "zwidth.csv").read_bytes() == undisturbed[0]
        code, said = start(out, "--jobs", "1").finish()
        assert (code, said.count("Error")) == (0, 0)
        assert contents(out) == undisturbed
        timings = json.loads((out / "zwidth.datapackage.json").read_text())["wavesweep"]["timings"]
        assert timings["slices_from_checkpoint"] >= 4000 * kept
        assert sorted(file.name for file in out.iterdir()) == sorted([*FILES, "zwidth.datapackage.json"])


@pytest.mark.parametrize(("number", "options"), [(signal.SIGINT, WORKERS), (signal.SIGTERM, ("--jobs", "1"))])
def test_a_run_that_is_stopped_says_so_in_a_line_and_goes_on(start, tmp_path, undisturbed, number, options):
    out = tmp_path / "out"
    run = start(out, *options)
    wait_for(lambda: finished(out))
    os.killpg(run.process.pid, number) if number == signal.SIGINT else run.process.send_signal(number)
    found, said = run.finish()
    # click leaves the line that the terminal has written ^C on.
    assert (found, said.strip().count("\n")) == (128 + number, 0), said
    assert said.strip().startswith(STOPPED[number])
    (kept,) = out.glob(".zwidth-*.sqlite")
    assert f"slices are kept in {kept}; the same command goes on from there." in said
    assert start(out, "--jobs", "1").finish()[0] == 0
    assert contents(out) == undisturbed


def test_nobody_outlives_a_run_that_is_killed_and_nothing_is_left_in_the_temporary_folder(start, tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    run = start(tmp_path / "out", *WORKERS)
    wait_for(lambda: finished(tmp_path / "out"))
    assert len([*tmp_path.glob(f"{SCRATCH}*/*")]) == 1
    run.process.kill()
    assert run.finish() == (-signal.SIGKILL, "")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_worker_that_is_killed_is_an_error_at_once(start, tmp_path):
    run = start(tmp_path / "out", *WORKERS)
    wait_for(lambda: finished(tmp_path / "out"))
    os.kill(run.workers()[0], signal.SIGKILL)
    code, said = run.finish()
    assert code == 1
    assert said.startswith("Error: a worker process died (killed, or out of memory)")
    assert "the same command goes on from there" in said
    assert said.count("\n") == 1


def test_a_run_whose_workers_are_killed_at_random_moments_ends_and_gives_the_same_bytes(start, tmp_path, undisturbed):
    rng = random.Random(3)  # noqa: S311 - moments, no secret
    for number in range(KILLS):
        out = tmp_path / f"out{number}"
        run = start(out, *WORKERS)
        wait_for(run.workers)
        time.sleep(rng.uniform(0, 1.5))
        while victims := run.workers():
            with contextlib.suppress(ProcessLookupError):
                os.kill(rng.choice(victims), signal.SIGKILL)
            time.sleep(rng.uniform(0, 0.02))
        code, said = run.finish()
        assert code == (not (out / "zwidth.datapackage.json").exists()), said
        assert start(out, *WORKERS).finish()[0] == 0
        assert contents(out) == undisturbed


def program(tmp_path, code):
    """What a program says that runs beside a spec; it must not say more on stderr."""
    (tmp_path / "wall.toml").write_text(SPEC.replace("num = 500", "num = 20"))
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=300)
    assert done.stderr == ""
    return done.stdout


def test_no_answer_of_a_worker_is_so_long_that_a_pipe_divides_it(tmp_path):
    """The rest of an answer whose worker was killed would be waited for, for ever."""
    code = """
from multiprocessing.connection import Connection
from wavesweep.program.cli import main
sizes, receive = [], Connection._recv
def noted(self, size, *more):
    sizes.append(size)
    return receive(self, size, *more)
Connection._recv = noted
main(["zwidth", "wall.toml", "--quiet", "--no-plot", "--jobs", "2", "--backend", "loky"])
print(len(sizes), max(sizes))
"""
    number, longest = map(int, program(tmp_path, code).split())
    assert number >= 4
    assert 40 < longest < select.PIPE_BUF


def test_a_host_that_does_not_wait_for_its_children_has_its_run(tmp_path):
    code = """
import signal
import wavesweep
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
print(len(wavesweep.zwidth("wall.toml", jobs=2, backend="loky")))
"""
    assert int(program(tmp_path, code)) >= 20 * 241


def test_a_second_signal_ends_the_run_at_once_and_without_a_traceback(start, tmp_path):
    run = start(tmp_path / "out", *WORKERS)
    wait_for(lambda: finished(tmp_path / "out"))
    for _ in range(3):
        os.killpg(run.process.pid, signal.SIGINT)
        time.sleep(0.01)
    code, said = run.finish()
    assert code == 128 + signal.SIGINT
    assert "Traceback" not in said
    assert all(line.startswith(STOPPED[signal.SIGINT]) for line in said.split("\n") if line)


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
