"""Faults at every file-system call of a run: kills, signals and errors; then the same command again, undisturbed.

    python -m tests.support.crashes                         every call, every fault, every case: about half an hour
    python -m tests.support.crashes --tries 50 --seed 3     so many of each case, at random

A run is a forked child of this process, with one job, in which the calls of `os`, `io`, `fcntl`, pyarrow's writer and SQLite
that concern files are counted. A fault happens before or after one of them. The second run must end with exit code 0, with the
bytes of a run that nothing disturbed, and without any other file in the folder.
"""

import argparse
import builtins
import errno
import fcntl
import io
import json
import os
import random
import shutil
import signal
import sqlite3
import sys
import tempfile
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

SPEC = """
[controller]
kind = "pmw"
[device]
velocity = "difference"
damping = 3.0
[operator]
stiffness = {stiffness}
[sweep]
along = "K_VE"
K_VE = {{ start = 0, stop = 20000 }}
b = [20.0, 40.0]
B_VE = {{ start = 0, stop = 15, num = 8 }}
[bode]
frequency_hz = [1.0, 10.0]
Kp = [0.0, 20.0]
B_VE = [0.5, 1.0]
[simulate]
input = "sine"
frequency_hz = 10.0
amplitude = 1.0
duration_s = 1.0
"""
ERRORS = ("EIO", "ENOSPC", "EDQUOT", "EROFS", "EACCES")
SIGNALS = ("SIGKILL", "SIGTERM", "SIGINT")
CALLS = (
    *((os, name) for name in ("open", "mkdir", "rename", "replace", "unlink", "remove", "rmdir", "fsync", "write")),
    *((os, name) for name in ("ftruncate", "scandir", "listdir", "read")),
    (fcntl, "flock"), (builtins, "open"), (io, "open"),
)  # fmt: skip
STATEMENTS = ("connect", "execute", "executescript")
READING = ("scandir", "listdir", "read", "flock")  # they do not fail where nothing may be written
# Case: the runs before that must succeed, and the run that is disturbed; each spec has its own stiffness of the hand.
PARTS = ("--partition", "7")
CASES = {
    "new folder": ([], ["zwidth", "a.toml", "--out", "out"]),
    "over the same results": ([["zwidth", "a.toml", "--out", "out"]], ["zwidth", "a.toml", "--out", "out"]),
    "over another spec's": ([["zwidth", "b.toml", "--out", "out"]], ["zwidth", "a.toml", "--out", "out", "--overwrite"]),
    "for hands": ([], ["zwidth", "c.toml", "--out", "out", "--for-hands", "port"]),
    "responses": ([], ["bode", "a.toml", "--out", "out"]),
    "responses of two specs": ([], ["bode", "a.toml", "b.toml", "--out", "out"]),
    "passivity": ([], ["passivity", "c.toml", "--out", "out"]),
    "in parts over a single file": ([["zwidth", "a.toml", "--out", "out"]], ["zwidth", "a.toml", "--out", "out", *PARTS]),
    "in parts over parts": (
        [["zwidth", "b.toml", "--out", "out", *PARTS]],
        ["zwidth", "a.toml", "--out", "out", *PARTS, "--overwrite"],
    ),
    "a single file over parts": ([["zwidth", "a.toml", "--out", "out", *PARTS]], ["zwidth", "a.toml", "--out", "out"]),
    "two tables": ([["simulate", "b.toml", "--out", "out"]], ["simulate", "a.toml", "--out", "out", "--overwrite"]),
}


class Shim:
    """Counts the calls, and lets one fault happen: `moment` is (number of the call, "before" or "after")."""

    def __init__(self, fault=None, moment=(-1, "before"), lasting=False):
        self.fault, self.moment, self.lasting, self.count = fault, moment, lasting, 0

    def __call__(self, call, *given, **named):
        number, self.count = self.count, self.count + 1
        self._act(number, "before", getattr(call, "__name__", ""))
        result = call(*given, **named)
        self._act(number, "after", "")
        return result

    def _act(self, number, when, name):
        here = (number, when) == self.moment
        if self.fault in ERRORS:
            later = self.lasting and number > self.moment[0] and when == "before" and name not in READING
            if here or later:
                raise _of_sqlite(self.fault) if name in STATEMENTS else _of_system(self.fault)
        elif here and self.fault:
            os.kill(os.getpid(), getattr(signal, self.fault))

    def wrap(self, call):
        """The call, counted."""
        shim = self

        def counted(*given, **named):
            result = shim(call, *given, **named)
            return File(result, shim) if hasattr(result, "write") and result.writable() else result

        counted.__name__ = getattr(call, "__name__", "")
        return counted

    def install(self):
        """Replace the calls in this process, which is a child and ends soon."""
        import pyarrow.parquet

        for module, name in CALLS:
            setattr(module, name, self.wrap(getattr(module, name)))
        shim, writer = self, pyarrow.parquet.ParquetWriter

        class Writer(writer):
            def __init__(self, *given, **named):
                shim(super().__init__, *given, **named)

            def write_table(self, *given, **named):
                shim(super().write_table, *given, **named)

            def close(self):
                if self.is_open:
                    shim(super().close)

        pyarrow.parquet.ParquetWriter = Writer
        connect = sqlite3.connect
        sqlite3.connect = lambda *given, **named: Database(shim(connect, *given, **named), shim)


def _of_system(fault):
    code = getattr(errno, fault)
    return OSError(code, os.strerror(code))


def _of_sqlite(fault):
    """What SQLite makes of it."""
    code = {"ENOSPC": sqlite3.SQLITE_FULL, "EROFS": sqlite3.SQLITE_READONLY, "EACCES": sqlite3.SQLITE_CANTOPEN}
    error = sqlite3.OperationalError(os.strerror(getattr(errno, fault)))
    error.sqlite_errorcode = code.get(fault, sqlite3.SQLITE_IOERR)
    return error


class Database:
    """A connection to a SQLite file whose statements and whose end are counted."""

    def __init__(self, connection, shim):
        self._connection, self._shim = connection, shim

    def execute(self, *given):
        """Count a statement, which is a transaction of its own."""
        return self._shim(self._connection.execute, *given)

    def executescript(self, text):
        """Count the statements one by one."""
        for statement in filter(str.strip, text.split(";")):
            self.execute(statement)

    def close(self):
        """Close, which moves the log into the file; if that fails, SQLite says nothing, and the log stays."""
        try:
            self._shim(self._connection.close)
        except OSError:
            self._connection.close()


class File:
    """A file open for writing whose writes and whose end are counted."""

    def __init__(self, file, shim):
        self._file, self._shim = file, shim

    def write(self, data):
        """Write through, so that a kill loses only what comes later."""
        self._shim(self._file.write, data)
        self._file.flush()

    def writelines(self, lines):
        """Write each."""
        for line in lines:
            self.write(line)

    def close(self):
        """Close once."""
        if not self._file.closed:
            self._shim(self._file.close)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __getattr__(self, name):
        return getattr(self._file, name)


def run(home, arguments, shim=None):
    """Run the command in a child; its exit code (negative for a signal), what it said, and the number of its calls."""
    ours, theirs = os.pipe()
    said = home / "said"
    child = os.fork()
    if child == 0:
        os.close(ours)
        _be_a_run(home, arguments, shim or Shim(), said, theirs)
    os.close(theirs)
    with os.fdopen(ours) as pipe:
        count = pipe.read()
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status), said.read_text(), int(count or -1)


def _be_a_run(home, arguments, shim, said, pipe):
    code = 70
    try:
        os.chdir(home)
        output = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(output, 1)
        os.dup2(output, 2)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        from wavesweep import plots
        from wavesweep.cli import main
        from wavesweep.sweep import job, passivity_job, response_job

        job.FEWEST = job.MOST = 4  # several chunks from a small sweep
        response_job.TICKS, passivity_job.CHUNK = 0, 2
        plots.drawn = lambda table, _: replace(table, figure=lambda path: path.write_bytes(b"a figure"))
        sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115
        write = os.write
        shim.install()
        jobs = [] if arguments[0] == "simulate" else ["--jobs", "1"]
        code = main([*arguments, *jobs, *([] if arguments[0] == "zwidth" else ["--no-plot"])])
        write(pipe, str(shim.count).encode())
    except BaseException as error:  # noqa: BLE001
        sys.stderr.write(f"{type(error).__name__}: {error}\n")
    finally:
        sys.stderr.flush()
        os._exit(code)


def contents(folder):
    """Names of all files and folders with the bytes of the tables and figures."""
    tables = (".csv", ".parquet", ".png")
    kept = {
        str(path.relative_to(folder)): path.read_bytes() if path.suffix in tables and path.is_file() else b""
        for path in folder.rglob("*")
    }
    return dict(sorted(kept.items()))


def prepared(home, before):
    """The folder with the specs and what was there before."""
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir()
    for name, stiffness in (("a", 0), ("b", 100), ("c", 0)):
        text = SPEC.format(stiffness=stiffness)
        (home / f"{name}.toml").write_text(text.replace("num = 8", "num = 2") if name == "c" else text)
    for arguments in before:
        code, said, _ = run(home, arguments)
        assert code == 0, said


def faults(count):
    """All (kind, fault, moment, lasting)."""
    for number in range(count):
        for when in ("before", "after"):
            for name in SIGNALS:
                yield name, name, (number, when), False
        for name in ERRORS:
            yield name, name, (number, "before"), False
            yield f"{name} from then on", name, (number, "before"), True


def tried(root, case, tries=None, seed=0):
    """Try faults of a case, all by default: (kind, what went wrong or "") of each."""
    before, arguments = CASES[case]
    home, whole, start = root / "home", root / "whole", root / "start"
    prepared(whole, before)
    shutil.copytree(whole, start)
    shim = Shim()
    code, said, count = run(whole, arguments, shim)
    assert code == 0, said
    expected = contents(whole / "out")
    every = list(faults(count))
    chosen = every if tries is None else random.Random(seed).sample(every, tries)  # noqa: S311 - a sample of tests
    for kind, fault, moment, lasting in chosen:
        shutil.rmtree(home, ignore_errors=True)
        shutil.copytree(start, home, symlinks=True)
        first, said, _ = run(home, arguments, Shim(fault, moment, lasting))
        again, more, _ = run(home, arguments)
        wrong = _wrong(first, said, again, more, (home / "out", expected))
        yield kind, wrong and f"{case}, {kind} {moment[1]} call {moment[0]} of {count}: {wrong}"


def _wrong(first, said, again, more, files):
    if "Traceback" in said or first not in (0, 1, 2, 130, 143, -9):
        return f"exit {first}: {said[-300:]}"
    if again:
        return f"the next run: exit {again}: {more[-300:]}"
    folder, expected = files
    found = contents(folder)
    if sorted(found) != sorted(expected):
        return f"files {sorted(set(found) ^ set(expected))}"
    different = [name for name in found if found[name] != expected[name]]
    return f"bytes of {different}" if different else ""


def main():
    """Try the faults, print the failures, and a table of tries and failures per kind."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--tries", type=int, help="of each case, at random; all by default")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--case", choices=list(CASES), action="append")
    options = parser.parse_args()
    tries, failures, started = Counter(), Counter(), time.monotonic()
    _import_all()
    with tempfile.TemporaryDirectory() as root:
        for case in options.case or CASES:
            for kind, wrong in tried(Path(root), case, options.tries, options.seed):
                tries[kind] += 1
                if wrong:
                    failures[kind] += 1
                    print(wrong, flush=True)
            for name in ("home", "whole", "start"):
                shutil.rmtree(Path(root, name), ignore_errors=True)
    print(json.dumps({kind: [tries[kind], failures[kind]] for kind in tries}, indent=1))
    print(f"{tries.total()} tries, {failures.total()} failures, {time.monotonic() - started:.0f} s")
    return 1 if failures else 0


def _import_all():
    """What a run imports, so that its children have it already."""
    import matplotlib.figure  # noqa: F401
    import numpy.fft  # noqa: F401
    import pyarrow.csv
    import pyarrow.parquet  # noqa: F401


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.exit(main())
