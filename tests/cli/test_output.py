"""Progress goes to a terminal and nowhere else; colours respect NO_COLOR."""

import os
import pty
import select
import sys
from contextlib import contextmanager

import pytest

from wavesweep.cli import output


@contextmanager
def terminal(monkeypatch):
    """Make stderr a terminal, and give a function that reads what was said on it.

    No fixture: pytest gives each phase of a test, setting up and running, a stderr of its own.
    """
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w", encoding="utf-8") as stream:
        monkeypatch.setattr(sys, "stderr", stream)

        def said():
            stream.flush()
            text = b""
            # What is written to a terminal arrives in pieces, and a little later.
            while select.select([ours], [], [], 0.1)[0]:
                text += os.read(ours, 100_000)
            return text.decode()

        yield said
    os.close(ours)


def test_a_bar_moves_on_a_terminal(monkeypatch):
    with terminal(monkeypatch) as said:
        with output.progress(quiet=False) as report:
            report(1, 4)
            report(4, 4)
        assert "4/4" in said()


def test_nothing_moves_where_nobody_watches(monkeypatch):
    with terminal(monkeypatch) as said:
        with output.progress(quiet=True) as report:
            assert report is None
        output.say("done")
        assert said() == "done\r\n"


def test_nothing_moves_in_a_file(capsys):
    with output.progress(quiet=False) as report:
        assert report is None
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(("no_color", "coloured"), [("", True), ("1", False)])
def test_a_warning_is_coloured_unless_no_color_is_set(monkeypatch, no_color, coloured):
    monkeypatch.setenv("NO_COLOR", no_color)
    with terminal(monkeypatch) as said:
        output.say("beware", warning=True)
        assert ("\x1b[" in said()) is coloured
