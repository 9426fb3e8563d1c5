"""A kill while files are written: the same command once more gives the same files, and no others."""

import os
import signal
import sys

import pytest

from wavesweep.program.atomic_files import SCRATCH, put, random_part, scratch
from wavesweep.program.cli import main

SOURCE = """
rates.tick_hz = 1000
numbers.k = { value = 1, unit = "", description = "gain" }
block.plant = { type = "ss", discrete = true, inputs = ["u"], outputs = ["y"], A = [[0.8]], B = [[0.3]], C = [[1]] }
block.hold = { type = "hold" }
wire = { "hold.u" = "w - k*plant.y", "plant.u" = "hold.y" }
ports = { inputs.w = { signal = "w", unit = "" }, outputs.y = { signal = "plant.y", unit = "" } }
sweep = { along = "k", k = { start = 0, stop = 20 } }
"""


def killed(number, words):
    """Run a command in a child that is killed before that many steps in the file system; whether it was."""
    child = os.fork()
    if child:
        return os.WIFSIGNALED(os.waitpid(child, 0)[1])
    left = [number]

    def watch(event, given):
        told = event in ("os.mkdir", "os.rename", "os.rmdir", "os.remove", "shutil.rmtree")
        if told or (event == "open" and isinstance(given[2], int) and given[2] & (os.O_WRONLY | os.O_RDWR)):
            left[0] -= 1
            if left[0] < 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: PTH123, SIM115 - until the process ends
    sys.addaudithook(watch)
    try:
        main(words)
    finally:
        os._exit(0)


def content(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        pytest.param(["export", "arm.toml", "--to", "c", "--out", "out"], marks=pytest.mark.asks("simulation")),
        ["stability-region", "drawn.toml", "--out", "out/t.csv"],
    ],
    ids=lambda words: words[0],
)
def test_the_same_command_once_more_gives_the_same_files_and_no_others(words, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drawn.toml").write_text(SOURCE)
    (tmp_path / "arm.toml").write_text('[controller]\nkind = "pmw"\n[simulate]\nduration_s = 0.05\nsettle_s = 0\n')
    out = tmp_path / "out"
    out.mkdir()
    assert main(words) == 0
    whole, number = content(out), 0
    while True:
        for path in out.iterdir():
            path.unlink()
        if not killed(number, words):
            break
        assert main(words) == 0, capfd.readouterr().err
        assert content(out) == whole
        assert sorted(path.name for path in out.iterdir()) == sorted(map(str, whole))
        number += 1
    assert number >= 4


def test_a_folder_that_is_in_use_or_of_another_name_stays(tmp_path):
    left, other = tmp_path / f"{SCRATCH}{random_part()}", tmp_path / f"{SCRATCH}backup"
    for folder in (left, other):
        folder.mkdir()
    with scratch(tmp_path) as first, scratch(tmp_path) as second:
        assert not left.exists()
        assert first.is_dir()
        assert second.is_dir()
    assert list(tmp_path.iterdir()) == [other]


def test_a_file_of_the_same_bytes_keeps_its_time_and_a_link_gives_way_to_a_file(tmp_path):
    place, new, other = tmp_path / "place", tmp_path / "new", tmp_path / "other"
    place.write_text("a")
    os.utime(place, ns=(10**18, 10**18))
    for text, stays in (("a", True), ("b", False)):
        new.write_text(text)
        put(new, place)
        assert (place.read_text(), place.stat().st_mtime_ns == 10**18, new.exists()) == (text, stays, False)
    place.rename(other)
    place.symlink_to(other)
    new.write_text("b")
    put(new, place)
    assert (place.is_symlink(), place.read_text(), other.read_text()) == (False, "b", "b")
