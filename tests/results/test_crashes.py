"""A fault at any file-system call of a run costs nothing but the same command once more.

WAVESWEEP_CRASHES=50 in the environment tries so many faults of every case, WAVESWEEP_CRASHES=all each fault at each call.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TRIES = os.environ.get("WAVESWEEP_CRASHES")
FEW = ("--tries", "1", "--case", "new folder", "--case", "over another spec's", "--case", "responses")
# System calls of a run; few others make them.
CALLS = ("rename", "unlink", "pwrite64", "fdatasync", "rmdir", "mkdir", "fsync", "flock", "ftruncate")
CRASHES = Path(__file__).parents[1] / "support/crashes.py"


@pytest.mark.slow
def test_after_any_fault_the_same_command_gives_the_same_bytes_and_leaves_nothing_over():
    sample = FEW if TRIES is None else () if TRIES == "all" else ("--tries", TRIES)
    environment = os.environ | {"PYTHONPATH": str(CRASHES.parents[2])}
    done = subprocess.run(
        [sys.executable, CRASHES, "--seed", "5", *sample], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert " 0 failures" in done.stdout


SPEC = """
[environment]
integration = "explicit"
[controller]
kind = "pmw"
[sweep]
K_VE = { start = 0, stop = 20000 }
b = { start = 5, stop = 100, num = 150 }
B_VE = { start = 0, stop = 15, num = 81 }
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The results of a run that nothing disturbed."""
    home = tmp_path_factory.mktemp("home")
    (home / "a.toml").write_text(SPEC)
    assert _run(home, "whole")[0] == 0
    return home / "whole"


BEFORE = ["strace", "-qq", "-o", "/dev/null"]


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")
@pytest.mark.parametrize(
    ("few", "fault"),
    [(("rename", 2, 4), "signal=SIGKILL"), (("pwrite64", 5, 40), "signal=SIGKILL"), (("unlink", 3, 10), "error=EIO")],
)
def test_a_system_call_that_kills_or_fails(few, fault, tmp_path, whole):
    """All calls of all kinds if WAVESWEEP_CRASHES is "all"; otherwise in moves, in chunks, and in the checkpoint's removal."""
    (tmp_path / "a.toml").write_text(SPEC)
    expected = {name: (whole / name).read_bytes() for name in ("zwidth.csv", "zwidth.parquet")}
    every = (
        [(each, number) for each in CALLS for number in range(1, 40)]
        if TRIES == "all"
        else [(few[0], number) for number in few[1:]]
    )
    ended = set()
    for name, number in every:
        if name in ended:
            continue
        out = tmp_path / f"{name}{number}"
        inject = [*BEFORE, "-e", f"trace={name}", "-e", f"inject={name}:{fault}:when={number}"]
        untouched = _run(tmp_path, out, *inject)[0] == 0 and fault.startswith("signal")
        code, said = _run(tmp_path, out)
        assert code == 0, (name, number, said)
        assert {each: (out / each).read_bytes() for each in expected} == expected, (name, number)
        assert len(list(out.iterdir())) == 3, (name, number, list(out.iterdir()))
        if untouched:  # fewer calls than that
            ended.add(name)


def _run(home, out, *before):
    """Exit code and messages of a run in one process."""
    program = [sys.executable, "-m", "wavesweep", "zwidth", "a.toml", "--jobs", "1", "--no-plot", "--out", str(out)]
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([*before, *program], cwd=home, env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr
