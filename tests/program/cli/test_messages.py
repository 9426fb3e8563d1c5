"""Progress goes to a terminal and nowhere else; colours respect NO_COLOR."""

import logging
import os
import pty
import re
import select
import sys
import threading
from contextlib import contextmanager, suppress
from types import SimpleNamespace

import numpy as np
import pytest

from wavesweep.program.cli import messages
from wavesweep.program.sweep.job import Chunks


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


@pytest.fixture
def clock():
    """A clock that stands still until it is set."""
    return [0.0]


def watched(clock, terminal=False):
    """What is said of a command, at the times of the clock: no thread looks at it."""
    return messages.Watch(terminal, clock=lambda: clock[0])


@pytest.mark.parametrize("columns", [30, 60, 80, 200])
def test_a_bar_on_a_terminal_begins_after_a_second_and_fits_into_it_and_is_gone_in_the_end(columns, monkeypatch, clock):
    monkeypatch.setattr(messages, "_columns", lambda: columns)
    with terminal(monkeypatch) as said:
        watch = watched(clock, terminal=True)
        hear = watch.begin()
        for second, done in enumerate((1, 303_104, 2_000_000)):
            clock[0] = float(second)
            hear(done, 2_500_000, done)
            watch.look()
        watch.begin(None)
        bars = said().split(messages.START_OF_LINE)
    assert bars[0] == bars[-1] == ""
    assert len(bars) == 3  # after 2 s, and its end
    assert len(bars[1]) < columns
    assert ("[####" in bars[1]) == (columns >= 80)
    assert ("2,000,000 certified" in bars[1]) == (columns > 30)


def test_a_line_is_said_on_a_terminal_too_until_a_share_is_known(monkeypatch, clock):
    with terminal(monkeypatch) as said:
        watch = watched(clock, terminal=True)
        watch.begin("fitting")
        for half in range(21):
            clock[0] = half / 2
            watch.look()
        assert said().splitlines() == ["still fitting after 5 s", "still fitting after 10 s"]


def test_no_two_lines_of_a_long_command_say_the_same(capsys, clock):
    watch = watched(clock)
    watch.begin("at work on the verdict")
    for second in range(800):
        clock[0] = float(second)
        watch.look()
    lines = capsys.readouterr().err.splitlines()
    assert "still at work on the verdict after 2 min" in lines
    assert len({*lines}) == len(lines) > 30


def test_a_command_has_a_line_after_5_10_and_20_s_and_then_every_20_s(capsys, clock):
    """Two parts, each of which begins before the time of the line, and reports of which a checkpoint had the first 500."""
    watch = watched(clock)
    for second in range(101):
        clock[0] = float(second)
        if second in (3, 45):
            hear = watch.begin(*(("", "fewer take less") if second == 45 else ("fitting",)))
        if second >= 45:
            hear(500 + 2 * (second - 45), 2000, certified=0)
        watch.look()
    out, err = capsys.readouterr()
    assert out == ""
    done = {at: 500 + 2 * (at - 45) for at in (60, 80, 100)}
    assert err.splitlines() == [
        *(f"still fitting after {at} s" for at in (5, 10, 20, 40)),
        *(
            f"{done[at]} of 2,000 done ({done[at] // 20} %), 0 certified after {after}, about 12 min left; fewer take less"
            for at, after in ((60, "60 s"), (80, "80 s"), (100, "1 min 40 s"))
        ),
    ]


def test_one_that_is_not_looked_at_for_long_says_one_line(capsys, clock):
    watch = watched(clock)
    for second in (0.0, 4.9, 300.0, 300.5, 319.0, 320.0):
        clock[0] = second
        watch.look()
    assert capsys.readouterr().err.splitlines() == ["still at work after 5 min", "still at work after 5 min 20 s"]


def test_no_thread_is_left_behind_and_nothing_is_said_if_quiet(capsys, monkeypatch):
    monkeypatch.setattr(messages, "FIRST_WORD", 1e-6)
    before = threading.enumerate()
    for quiet in (False, True):
        with suppress(KeyboardInterrupt), messages.speaking(quiet):
            assert len(threading.enumerate()) == len(before) + (not quiet)
            assert (messages.progress("fitting") is None) == quiet
            logging.getLogger("wavesweep").warning("a worker died")
            raise KeyboardInterrupt
        assert threading.enumerate() == before
        said = [] if quiet else ["still fitting after 0 s", "a worker died"]
        assert capsys.readouterr().err.splitlines() == said


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
    hear = watch.begin()
    hear(done, len(costs))
    for end, size in sorted(ends):
        while clock[0] + 0.5 < end:  # as the thread looks
            clock[0] += 0.5
            watch.look()
        clock[0], done = end, done + size
        hear(done, len(costs))
        watch.look()
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
    watch = watched(clock)
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
    watch = watched(clock)
    watch.begin(messages.WRITING)
    for second in range(0, 90, 10):
        clock[0] = float(second)
        panel, share = divmod(second / 30, 1)
        if not share:
            watch.work.note(SimpleNamespace(name="wavesweep.figure.panels", args=(int(panel), 3)))
        watch.work.note(SimpleNamespace(name="wavesweep.figure.curves", args=(share,)))
        watch.look()
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
