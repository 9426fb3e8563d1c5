"""Streams that are closed, full or gone: one line where it can be said, the right exit code, and no results lost."""

import os
import pty
import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.chunks import finished

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")]
SPEC = """
[controller]
kind = "pmw"
[sweep]
K_VE = { start = 0, stop = 20000 }
b = { start = 5, stop = 100, num = 20 }
B_VE = { start = 0, stop = 15, num = 20 }
"""
FILES = ["zwidth.csv", "zwidth.datapackage.json", "zwidth.parquet"]


@pytest.fixture
def shell(tmp_path):
    """Run a line of shell in a folder with a spec, W being the command; give exit code and what was said."""
    (tmp_path / "wall.toml").write_text(SPEC)
    command = f"{shlex.quote(sys.executable)} -m wavesweep"

    def run(line):
        line = line.replace("W", command, 1)
        done = subprocess.run(
            ["/bin/bash", "-c", f"set -o pipefail; {line}"], cwd=tmp_path, capture_output=True, text=True, check=False,
            env=os.environ | {"TMPDIR": str(tmp_path)}, timeout=300,
        )  # fmt: skip
        return done.returncode, done.stderr

    return run


def test_results_are_written_if_nobody_can_be_told(shell, tmp_path):
    assert shell("W zwidth wall.toml --no-plot --out out --jobs 2 --backend loky 2>&-") == (0, "")
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == FILES


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("W zwidth wall.toml --out - >&-", 2, "Error: --out -: expected a place to write the table to, found stdout closed\n"),
        ("W check missing.toml 2>/dev/full", 2, ""),
    ],
)
def test_output_that_cannot_be_written_is_an_error_in_a_line(shell, tmp_path, line, code, said):
    assert shell(line) == (code, said)
    assert [file.name for file in tmp_path.iterdir()] == ["wall.toml"]


def test_a_terminal_that_goes_away(tmp_path):
    (tmp_path / "wall.toml").write_text(SPEC.replace("num = 20 }\nB", "num = 2000 }\nB"))
    program = "import signal, sys\n"
    program += "signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"  # the tests may run under nohup
    program += "from wavesweep.program.cli import main\nsys.exit(main())\n"
    words = ["zwidth", "wall.toml", "--no-plot", "--out", "out", "--jobs", "1"]
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(tmp_path)
        os.execv(sys.executable, [sys.executable, "-c", program, *words])  # noqa: S606 - in a process of the terminal
    patience = time.monotonic() + 300
    while not finished(tmp_path / "out"):
        assert time.monotonic() < patience
        time.sleep(0.01)
    os.close(terminal)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    left = sorted(file.name for file in (tmp_path / "out").iterdir())
    assert (code, left) == (129, [path.name for path in (tmp_path / "out").glob(".zwidth-*.sqlite")])
