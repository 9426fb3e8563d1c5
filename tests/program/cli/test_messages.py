"""Progress goes to a terminal and nowhere else; colours respect NO_COLOR."""

import os
import pty
import re
import select
import sys
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from wavesweep.program.cli import messages
from wavesweep.program.sweep.job import Chunks


@pytest.fixture(autouse=True)
def a_bar_at_once(monkeypatch):
    monkeypatch.setattr(messages, "SHORTEST_ESTIMATE", 0.0)


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
        with messages.progress(quiet=False) as report:
            report(1, 4)
            report(4, 4)
        assert "4/4" in said()


def test_work_of_less_than_a_second_has_no_bar(monkeypatch):
    monkeypatch.setattr(messages, "SHORTEST_ESTIMATE", 1e6)
    with terminal(monkeypatch) as said:
        with messages.progress(quiet=False) as report:
            report(1, 4)
            report(4, 4)
        assert said() == ""


@pytest.mark.parametrize("columns", [30, 60, 80, 200])
def test_a_bar_fits_into_its_terminal(columns, monkeypatch):
    monkeypatch.setattr(messages, "_columns", lambda: columns)
    with terminal(monkeypatch) as said:
        with messages.progress(quiet=False) as report:
            for done in (1, 303_104, 2_000_000):
                report(done, 2_000_000, done)
        lines = re.sub(r"\x1b\[[?0-9;]*[a-zA-Z]", "", said()).replace("\n", "").split("\r")
    assert any("2000000/2000000" in line for line in lines)
    assert max(map(len, lines)) < max(columns, 45)  # the numbers alone take so many
    assert any("certified" in line for line in lines) == (columns >= 80)


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands still until it is set, and no thread that looks at it."""
    now = [0.0]
    monkeypatch.setattr(messages, "Thread", lambda **_: SimpleNamespace(start=lambda: None))
    return now


def watched(clock, *given):
    """What is said of work, at the times of the clock."""
    return messages.Watch(*given, clock=lambda: clock[0])


def test_a_long_run_says_a_line_now_and_then_in_a_file(capsys, clock):
    """A report each second for 1000 s, of which a checkpoint had the first 500 of 2000."""
    watch = watched(clock, "", "fewer values take less")
    for second in range(1001):
        clock[0] = float(second)
        watch.hear(min(500 + 2 * second, 2000), 2000, certified=0)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        f"{500 + 2 * at:,} of 2,000 done ({(500 + 2 * at) // 20} %) after {after}, about {left} left; fewer values take less"
        for at, after, left in ((5, "5 s", "12 min"), (10, "10 s", "12 min"), (20, "20 s", "12 min"), (40, "40 s", "12 min"),
                                (80, "80 s", "11 min"), (160, "3 min", "10 min"), (320, "5 min", "7 min"),
                                (640, "11 min", "2 min"))
    ]  # fmt: skip


def run_of(clock, watch, costs, chunk, kept=0, start=0.0, workers=2):
    """A run as `Watch` hears of it, chunks far apart first; gives the seconds that it took, and those of its longest chunk."""
    numbers = [*Chunks(len(costs), 1, chunk, 1).spread(range(-(-len(costs) // chunk)))]
    seconds = [costs[number * chunk : (number + 1) * chunk].sum() for number in numbers]
    sizes = [len(costs[number * chunk : (number + 1) * chunk]) for number in numbers]
    free, ends, done = [start] * workers, [], sum(sizes[:kept])
    for each, size in zip(seconds[kept:], sizes[kept:], strict=True):
        at = free.index(min(free))
        free[at] += each
        ends.append((free[at], size))
    watch.hear(done, len(costs))
    for end, size in sorted(ends):
        while clock[0] + 0.5 < end:  # as the thread looks
            clock[0] += 0.5
            watch.look()
        clock[0], done = end, done + size
        watch.hear(done, len(costs))
    return clock[0], max(seconds)


SCALE = {"s": 1, "min": 60, "h": 3600}


@pytest.mark.parametrize(
    ("slices", "chunk", "kept"),
    [(60, 1, 0), (60, 1, 20), (20_000, 200, 0), (20_000, 200, 60), (200_000, 4096, 0), (400_000, 4096, 70)],
)
@pytest.mark.parametrize("cost", ["equal", "rising", "a quarter takes long"])
@pytest.mark.parametrize("start", [0.0, 3.0])
def test_the_time_that_is_left_is_right_within_a_factor_of_two(slices, chunk, kept, cost, start, capsys, clock):
    shape = {
        "equal": np.ones_like,
        "rising": lambda share: (0.05 + share) ** 2,
        "a quarter takes long": lambda share: np.where((share > 0.5) & (share < 0.75), 10.0, 1.0),
    }[cost]
    costs = shape(np.arange(slices) / slices)
    watch = watched(clock, "", "")
    total, longest = run_of(clock, watch, 400 * costs / costs.sum(), chunk, kept, start)
    said = re.findall(r"after (\d+) (s|min|h), about ([\d.]+) (s|min|h) left", capsys.readouterr().err)
    assert len(said) >= 3
    for after, unit, left, of in said[1:]:
        true, told = total - float(after) * SCALE[unit], float(left) * SCALE[of]
        near, told_near = 0.5 * SCALE[unit], 0.5 * SCALE[of]  # as both are rounded
        if true > longest:  # of the last chunk nobody knows how far it is
            assert (true - near) / 2 - told_near < told < 2 * (true + near) + told_near, (said, total)


def test_the_curves_of_a_figure_have_a_time_of_their_own(capsys, clock):
    """Three panels of which each takes 30 s, in rounds that take a third of that."""
    watch = watched(clock, "writing", "")
    drawn = messages._Drawn(watch.draw)
    for second in range(0, 90, 10):
        clock[0] = float(second)
        panel, share = divmod(second / 30, 1)
        if not share:
            drawn.hear(SimpleNamespace(name="wavesweep.figure.panels", args=(int(panel), 3)))
        drawn.hear(SimpleNamespace(name="wavesweep.figure.curves", args=(share,)))
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith("writing: curves for the figure 1 of 3, which --no-plot leaves out (11 %) after 10 s")
    times = [re.search(r"after (\d+) s, about (\d+) s left", line) for line in said]
    told = [tuple(map(int, found.groups())) for found in times if found]
    assert len(told) >= 2
    assert all((90 - after) / 2 <= left <= 2 * (90 - after) for after, left in told), told


@pytest.mark.parametrize(("no_color", "coloured"), [("", True), ("1", False)])
def test_a_warning_is_coloured_unless_no_color_is_set(monkeypatch, no_color, coloured):
    monkeypatch.setenv("NO_COLOR", no_color)
    with terminal(monkeypatch) as said:
        messages.say("beware", warning=True)
        assert ("\x1b[" in said()) is coloured
