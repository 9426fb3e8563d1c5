"""--out with the name of a file writes this file and no other, whole or not at all; - as a spec is read from stdin."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow


def left(folder="."):
    return sorted(path.name for path in Path(folder).iterdir())


@pytest.mark.parametrize("name", ["t.csv", "t.png", "there/t.pdf"])
def test_a_single_file_is_written_and_nothing_else(wavesweep, spec, name):
    code, out, err = wavesweep("zwidth", spec, "--out", name)
    assert (code, out, f"Wrote {name} in" in err) == (0, "", True)
    assert left(Path(name).parent) == sorted([Path(name).name, *([spec] if "/" not in name else [])])
    first = {"csv": b"B_VE", "parquet": b"PAR1", "png": b"\x89PNG", "SVG": b"<?xml", "pdf": b"%PDF"}[name.rpartition(".")[2]]
    assert Path(name).read_bytes().startswith(first)


def test_what_did_not_change_keeps_its_time(wavesweep, spec):
    """A build tool that asks for times, or hashes, has nothing to do after an equal run."""
    commands = [
        ("zwidth", spec),
        ("zwidth", spec, "--out", "t.csv"),
        ("bode", spec, "--set", "bode.frequency_hz=[1]", "--no-plot"),
    ]
    for command in commands:
        assert wavesweep(*command)[0] == 0
    files = [path for path in Path().rglob("*") if path.is_file()]
    for path in files:
        os.utime(path, ns=(10**18, 10**18))
    before = {path: path.read_bytes() for path in files}
    for command in commands:
        assert wavesweep(*command)[0] == 0
    assert {path: path.read_bytes() for path in files} == before
    assert {path.stat().st_mtime_ns for path in files} == {10**18}
    wavesweep("zwidth", spec, "--set", "device.mass=0.2", "--out", "results/wall", "--overwrite", "--no-plot")
    assert Path("results/wall/zwidth.csv").stat().st_mtime_ns != 10**18


def test_a_folder_with_the_name_of_a_file_is_written_into_only_if_that_is_said(wavesweep, spec, sweep):
    Path("t.csv").mkdir()
    code, _, err = wavesweep("zwidth", spec, "--no-plot", "--out", "t.csv")
    assert (code, "found a folder; t.csv/ writes into it" in err) == (2, True)
    assert list(Path("t.csv").iterdir()) == sweep.seen == []
    assert wavesweep("zwidth", spec, "--no-plot", "--out", "t.csv/")[0] == 0
    assert Path("t.csv/zwidth.csv").exists()


@pytest.mark.parametrize("out", ["-", "t.csv"])
def test_a_figure_that_is_asked_for_is_not_left_out_for_a_table_alone(wavesweep, spec, sweep, out):
    code, _, err = wavesweep("zwidth", spec, "--plot", "--out", out)
    assert (code, f"--plot draws a figure, and --out {out} writes none" in err, sweep.seen) == (2, True, [])
    assert wavesweep("zwidth", spec, "--out", out)[0] == 0


@pytest.mark.parametrize("out", ["-", "t.csv"])
def test_a_table_that_fails_in_its_middle_leaves_nothing(wavesweep, spec, monkeypatch, out):
    from wavesweep.program.results import table_writing as writing

    def fail(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writing, "csv_rows", fail)
    code, said, err = wavesweep("zwidth", spec, "--out", out)
    assert (code, said, "No space left on device" in err, left()) == (1, "", True, [spec])


@pytest.mark.skipif(not Path("/dev/fd").exists(), reason="no files of open files here")
@pytest.mark.parametrize(
    "words",
    ["- < wall.toml", "<(sleep 0.2; cat wall.toml)", "/dev/stdin < wall.toml"],
)
def test_a_spec_is_read_from_stdin_or_what_a_shell_passes(wavesweep, spec, words):
    run = ["bash", "-c", f"{sys.executable} -m wavesweep zwidth {words} --out - --quiet"]
    found = subprocess.run(run, capture_output=True, text=True, check=True).stdout
    assert found == wavesweep("zwidth", spec, "--out", "-", "--quiet")[1]
    assert len(found.splitlines()) == 3


def test_a_mistake_in_a_spec_from_stdin_has_its_line(tmp_path):
    words = [sys.executable, "-m", "wavesweep", "zwidth", "-"]
    run = subprocess.run(words, cwd=tmp_path, input="[device]\nmass = -1\n", capture_output=True, text=True, check=False)
    assert (run.returncode, "\n-:2:8: device.mass: expected a number > 0, found -1" in run.stderr) == (2, True)
