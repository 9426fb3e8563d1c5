"""The first hour: every command of the page runs, and prints the lines that the page shows."""

import pathlib
import re
import shlex
import shutil

import pytest

EXAMPLES = pathlib.Path(__file__).parents[1] / "sweeps" / "examples"
PAGE = (EXAMPLES / "FIRST-HOUR.md").read_text(encoding="utf-8")


def steps():
    """Each command of the page, and the lines that follow it."""
    lines = [line[4:] for line in PAGE.splitlines() if line.startswith("    ")]
    starts = [index for index, line in enumerate(lines) if line.startswith("$ ")]
    return [(lines[a][2:], lines[a + 1 : b]) for a, b in zip(starts, [*starts[1:], len(lines)], strict=True)]


@pytest.mark.slow
def test_the_page_runs_from_its_beginning_to_its_end(tmp_path, monkeypatch, capsys):
    from wavesweep.cli import main

    monkeypatch.chdir(tmp_path)
    shutil.copy(EXAMPLES / "first-hour.toml", tmp_path)
    commands = steps()
    assert len(commands) == 8
    for command, expected in commands:
        _, *words = shlex.split(command)
        code = main(words)
        seen = capsys.readouterr()
        printed = [line.rstrip() for line in (seen.out + seen.err).splitlines()]
        assert code == 0, command
        assert [line for line in expected if line.rstrip() not in printed] == [], command


def test_the_spec_of_the_page_keeps_its_numbers():
    text = (EXAMPLES / "first-hour.toml").read_text(encoding="utf-8")
    assert re.search(r"mass = 0\.045\n", text)
    assert re.search(r"ratio = 33\n", text)
