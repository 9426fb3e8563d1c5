"""Progress goes to a terminal and nowhere else; colours respect NO_COLOR."""

import logging
import os
import pty
import re
import select
import sys
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from wavesweep.program.cli import main, messages
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


def test_a_bar_says_what_is_done_if_it_is_no_computing(monkeypatch):
    with terminal(monkeypatch) as said:
        with messages.progress(False, "writing") as report:
            report(1, 4)
        assert "writing  [" in said()


def test_nothing_moves_where_nobody_watches(monkeypatch):
    with terminal(monkeypatch) as said:
        with messages.progress(quiet=True) as report:
            assert report is None
        messages.say("done")
        assert said() == "done\r\n"


def test_a_short_run_says_nothing_in_a_file(capsys):
    with messages.progress(quiet=False) as report:
        report(1, 4)
        report(4, 4)
    assert capsys.readouterr() == ("", "")


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands still until it is set, and no thread that looks at it."""
    now = [0.0]
    monkeypatch.setattr(messages, "Thread", lambda **_: SimpleNamespace(start=lambda: None))
    return now


def watched(clock, *given):
    """What is said of work, at the times of the clock."""
    return messages.Watch(*given, clock=lambda: clock[0])


def test_what_a_proof_has_reached_is_said_until_its_slice_is_done(capsys, clock):
    watch = watched(clock, "", "")
    watch.hear(1, 3)
    watch.note("g proved from 16.5 to 39.76 so far")
    clock[0] = 6.0
    watch.look()
    watch.hear(2, 3)
    clock[0] = 13.0
    watch.look()
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith("1 of 3 done (33 %) after 6 s; g proved from 16.5 to 39.76 so far")
    assert said[1].startswith("2 of 3 done (66 %) after 13 s, about")


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


def test_a_run_goes_on_saying_lines_between_reports_that_are_far_apart(capsys, clock):
    watch = watched(clock, "at work on margins", "")
    for second in range(1, 400):
        clock[0] = float(second)
        watch.look()
        if second == 30:
            watch.hear(1, 3)  # of a checkpoint
        if second == 100:
            watch.hear(2, 3)
        if second == 150:
            watch.hear(3, 3)
    assert capsys.readouterr().err.splitlines() == [
        "still at work on margins after 5 s",
        "still at work on margins after 10 s",
        "still at work on margins after 20 s",
        "at work on margins: 1 of 3 done (33 %) after 40 s",
        "at work on margins: 1 of 3 done (33 %) after 80 s",
        "at work on margins: 2 of 3 done (66 %) after 2 min, about 70 s left",  # at once, since it is more than a minute
        "at work on margins: all 3 done after 3 min; what follows from them is still to come",
    ]


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


def test_what_was_kept_and_the_start_of_workers_are_no_speed_of_a_bar(clock):
    """500 of 1000 were kept, workers start in 3 s, and two of them take 1 s for ten."""
    moved = []
    watch = messages.Watch("", "", lambda *told: moved.append((clock[0], told[-1])), clock=lambda: clock[0])
    watch.hear(500, 1000)
    for second in range(1, 26):
        clock[0] = 3.0 + second
        watch.hear(490 + 20 * second, 1000)
        watch.hear(500 + 20 * second, 1000)
    said = [(28.0 - at, left) for at, left in moved if left and at < 27]
    assert len(said) > 20
    assert all(true / 2 < left < 2 * true for true, left in said), said


def test_the_first_of_many_slices_does_not_tell_the_time_of_all(clock, capsys):
    """It may load what the others need; half of the work was quick, as that of the free device before every hand."""
    watch = watched(clock, "", "")
    for at, done in ((0.0, 0), (1.0, 164), (7.0, 165), (7.5, 166), (12.0, 175)):
        clock[0] = at
        watch.hear(done, 328)
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "165 of 328 done (50 %) after 7 s"
    assert not [line for line in said if "min left" in line and "165" in line]


def test_another_phase_of_the_work_has_a_time_of_its_own(clock, capsys):
    """As of `verify`: rows that are computed again, and then proofs that take longer."""
    watch = watched(clock, "", "")
    for row in range(21):
        clock[0] = 0.05 * row
        watch.hear(row, 20)
    for proof in range(10):
        clock[0] = 1.0 + 10.0 * proof
        watch.hear(proof, 10)
    said = re.findall(r"(\d) of 10 done .*about (\d+) (s|min) left", capsys.readouterr().err)
    assert len(said) >= 2
    for done, left, unit in said:
        assert 10 * (10 - int(done)) / 2 <= int(left) * SCALE[unit] <= 20 * (10 - int(done)), said


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


def test_work_that_is_done_says_nothing_more(capsys, clock):
    watch = watched(clock, "", "")
    watch.end()
    clock[0] = 1000.0
    watch.look()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("quiet", "expected"), [(False, "nothing has finished\n"), (True, "")])
def test_what_a_run_warns_of_is_said_unless_it_is_quiet(capsys, quiet, expected):
    with messages.progress(quiet):
        logging.getLogger("wavesweep").warning("nothing has %s", "finished")
    assert capsys.readouterr() == ("", expected)


@pytest.mark.parametrize(("no_color", "coloured"), [("", True), ("1", False)])
def test_a_warning_is_coloured_unless_no_color_is_set(monkeypatch, no_color, coloured):
    monkeypatch.setenv("NO_COLOR", no_color)
    with terminal(monkeypatch) as said:
        messages.say("beware", warning=True)
        assert ("\x1b[" in said()) is coloured


@pytest.mark.usefixtures("sweep")
def test_on_a_terminal_the_bar_of_the_work_is_not_the_last_word_while_many_rows_are_written(spec, monkeypatch):
    monkeypatch.setattr("wavesweep.program.cli.output.NOTABLE", 0)
    with terminal(monkeypatch) as said:
        assert main(["zwidth", spec, "--no-plot"]) == 0
        text = said()
    assert re.search(r"^writing [\d,]+ rows\r?$", text, re.MULTILINE)
    assert text.index("writing") < text.index("Wrote")
