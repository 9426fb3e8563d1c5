"""A run that is stopped, however rudely, leaves nothing half done, goes on, and gives the same bytes.

WAVESWEEP_KILLS=20 in the environment asks for more kills than the one of an ordinary test run, late ones and early ones.
"""

import json
import os
import signal
import time

import numpy as np
import pytest
from support.chunks import finished
from support.program import started

pytestmark = pytest.mark.slow

KILLS = int(os.environ.get("WAVESWEEP_KILLS", "1"))
WORK = 0.3  # s from the first chunk on, about as long as the others take
PATIENCE = 300  # s for a chunk, on a machine that does much else
SPEC = """
[environment]
integration = "explicit"
[controller]
kind = "pmw"
[sweep]
K_VE = { start = 0, stop = 20000 }
b = { start = 5, stop = 100, num = 500 }
B_VE = { start = 0, stop = 15, num = 81 }
"""
FILES = ("zwidth.csv", "zwidth.parquet")


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    """Start a run of one spec in a folder; Ctrl-C reaches it, and the signal goes to its whole group as on a terminal."""
    home = tmp_path_factory.mktemp("spec")
    (home / "wall.toml").write_text(SPEC)
    return lambda out, *options: started(home, "zwidth", "wall.toml", "--out", out, *options)


def finish(process):
    said = process.communicate(timeout=300)[1]
    return process.returncode, said


def contents(folder):
    return [(folder / name).read_bytes() for name in FILES]


def wait_for_parts(process, folder, number):
    patience = time.monotonic() + PATIENCE
    while len(finished(folder)) < number:
        assert process.poll() is None, finish(process)
        assert time.monotonic() < patience, f"no finished chunk in {PATIENCE} s"
        time.sleep(0.005)


@pytest.fixture(scope="module")
def undisturbed(start, tmp_path_factory):
    """The files of a run that nobody stopped."""
    whole = tmp_path_factory.mktemp("whole")
    assert finish(start(whole, "--jobs", "1"))[0] == 0
    return contents(whole)


@pytest.mark.sample(1)
@pytest.mark.parametrize("options", [("--jobs", "1"), ("--jobs", "2", "--backend", "loky")], ids=["alone", "workers"])
def test_a_run_killed_at_random_moments_gives_the_same_bytes(start, tmp_path, undisturbed, options):
    share = (np.arange(KILLS) + np.random.default_rng(7).random(KILLS)) / KILLS
    for killed, moment in enumerate(0.2 + share):
        out = tmp_path / f"out{killed}"
        process = start(out, *options)
        late = killed % 2 == 0
        if late:  # among the chunks, and not before them
            wait_for_parts(process, out, 1)
        time.sleep(WORK * (moment - 0.2) if late else moment)
        os.killpg(process.pid, signal.SIGKILL)
        finish(process)
        done = (out / "zwidth.datapackage.json").exists()  # put in place last; then the checkpoint goes
        kept = len(finished(out)) if out.exists() and not done else 0
        if (out / "zwidth.csv").exists():
            # Put in place one by one: whichever is there is whole.
            assert (out / "zwidth.csv").read_bytes() == undisturbed[0]
        code, said = finish(start(out, *options))
        assert (code, said.count("Error")) == (0, 0)
        assert contents(out) == undisturbed
        timings = json.loads((out / "zwidth.datapackage.json").read_text())["wavesweep"]["timings"]
        assert timings["slices_from_checkpoint"] >= 4000 * kept
        assert sorted(file.name for file in out.iterdir()) == sorted([*FILES, "zwidth.datapackage.json"])


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("number", "code", "word"), [(signal.SIGINT, 130, "Interrupted."), (signal.SIGTERM, 143, "Terminated.")]
)
@pytest.mark.parametrize("options", [("--jobs", "1"), ("--jobs", "2", "--backend", "loky")], ids=["alone", "workers"])
def test_a_run_that_is_stopped_says_so_in_a_line_and_goes_on(start, tmp_path, undisturbed, number, code, word, options):
    out = tmp_path / "out"
    process = start(out, *options)
    wait_for_parts(process, out, 1)
    os.killpg(process.pid, number) if number == signal.SIGINT else process.send_signal(number)
    found, said = finish(process)
    # click leaves the line that the terminal has written ^C on.
    assert (found, said.strip().count("\n")) == (code, 0), said
    assert said.strip().startswith(word)
    (kept,) = out.glob(".zwidth-*.sqlite")
    assert f"slices are kept in {kept}; the same command goes on from there." in said
    assert finish(start(out, "--jobs", "1"))[0] == 0
    assert contents(out) == undisturbed
