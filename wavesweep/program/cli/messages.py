"""Messages: lines, warnings and progress on stderr, and the summary of a command as JSON on stdout."""

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import get_terminal_size
from threading import Event, Lock, Thread
from typing import Any

import click

from wavesweep.engine.errors import shortened

Progress = Callable[..., None]
WIDEST_BAR, USUAL_COLUMNS = 36, 80  # letters
NARROWEST, WIDEST = 80, 100  # letters in a line
FIRST_WORD, LONGEST_SILENCE = (
    5.0,
    20.0,
)  # s after which a command says what it is at; twice as long each time, up to
MINUTE = 60.0  # s of work that are left, from which on what would take less is said
SHORTEST_ESTIMATE = 1.0  # s from which on an estimate is one, and a terminal has a bar
LOOK_AT_PROGRESS = 0.5  # s
START_OF_LINE = "\r\x1b[K"  # on a terminal: to its left end, and remove what stands there
WRITING = "writing"  # the activity of commands that have --no-plot


def show_json(summary: Mapping[str, Any]) -> None:
    """Print the summary of a command as one JSON object on stdout."""
    import json

    # Another one if a key goes away or changes its meaning.
    click.echo(json.dumps({"schema_version": 2, **summary}, allow_nan=False))


def printable(text: str) -> str:
    """The text, shortened, with control characters of names and foreign files shown and not sent to the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in shortened(text))


def width() -> int:
    """The number of letters in a line: those that the terminal has, from NARROWEST to WIDEST."""
    return min(max(get_terminal_size((WIDEST, 0)).columns, NARROWEST), WIDEST)


def say(text: str, warning: bool = False) -> None:
    """Write a line to stderr; if that is impossible, the message is dropped, since the results matter more.

    A warning is yellow on a terminal, unless NO_COLOR is set (click does not ask for it).
    """
    text = printable(text)
    plain = not warning or os.environ.get("NO_COLOR")
    for watch in _speaking:
        watch.clear()
    with suppress(OSError):
        click.echo(text if plain else click.style(text, fg="yellow"), err=True)


def progress(doing: str | None = "", less: str = "") -> Progress | None:
    """Begin another part of the command's work; gives what takes reports (done, total, certified) of it, None if nothing is said.

    doing: the activity, if it is not computing; None if nothing is done that a user waits for. less: what would take less time.
    """
    return _speaking[-1].begin(doing, less) if _speaking else None


@contextmanager
def speaking(quiet: bool) -> Iterator[None]:
    """Say what a command is at while it takes long, see `Watch`, and the warnings of its parts; nothing if quiet.

    A thread looks at the work, of this process alone: workers say nothing.
    """
    import logging

    watch = Watch(sys.stderr.isatty())
    over = Event()
    process = os.getpid()

    class Heard(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if quiet:
                return
            if record.levelno >= logging.WARNING:
                say(record.getMessage(), warning=True)
            elif os.getpid() == process:
                watch.work.note(record)

    def keep_looking() -> None:
        while not over.wait(LOOK_AT_PROGRESS):
            watch.look()

    heard = Heard()
    logger = logging.getLogger("wavesweep")
    thread = Thread(target=keep_looking, daemon=True)
    level = logger.level
    logger.addHandler(heard)
    if not quiet:
        logger.setLevel(logging.INFO)
        _speaking.append(watch)
        thread.start()
    try:
        yield
    finally:
        logger.removeHandler(heard)
        logger.setLevel(level)
        if not quiet:
            watch.begin(None)
            over.set()
            _speaking.remove(watch)
            thread.join(LOOK_AT_PROGRESS)  # not for ever: nobody may read stderr


class Work:
    """A part of a command's work, and what is known of it.

    doing, less: see `progress`. clock: gives the time in seconds.
    """

    def __init__(self, doing: str | None, less: str, clock: Callable[[], float]) -> None:
        self.doing, self._less, self._clock, self._started = doing, less, clock, clock()
        self.reports: list[tuple[float, int]] = []  # (seconds, done), of equal kind
        self._total = 1
        self._certified: int | None = None
        # whether a report came from workers that were at work before
        self._begun = False
        self._note, self._figure, self._panel = "", "", (0, 1)

    def hear(self, done: int, total: int, certified: int | None = None) -> None:
        """Take a report."""
        seconds, reports = self._clock() - self._started, self.reports
        if reports and (
            total != self._total or done < reports[-1][1] or self._is_other(seconds, done)
        ):
            reports = []
            self._begun = False
        reports = [*reports, (seconds, done)]
        # Neither what a checkpoint had nor the time in which workers start says how fast the
        # work is.
        while len(reports) > 2 and (reports[1][0] < seconds / 6 or not self._begun):
            del reports[0]
            self._begun = True
        self._total = total
        self._certified = certified
        self._note = ""
        self.reports = reports  # last: another thread reads it

    def _is_other(self, seconds: float, done: int) -> bool:
        """Whether a report is of another kind of work, as for every hand after the free device."""
        (began, before), (reported, so_far) = self.reports[0], self.reports[-1]
        as_long_before = (reported - began) * (done - so_far)
        # Times as long for as much: another kind of work.
        return (seconds - reported) * (so_far - before) > 300 * as_long_before > 0

    def note(self, record: Any) -> None:
        """Take a message of a part: how far a proof or a fit is, which panel of a figure is drawn (of `interval_figures`),
        or which share of its further columns is computed (of `plane_columns`)."""
        if not record.name.startswith("wavesweep.figure"):
            self._note = f"; {record.getMessage()}"
            return
        share = 0.0
        if record.name.endswith("panels"):
            self._panel = record.args
        else:
            (share,) = record.args
        panel, panels = self._panel
        which = f" {panel + 1} of {panels}" if panels > 1 else ""
        without = ", which --no-plot leaves out" if self.doing == WRITING else ""
        self._figure = f"curves for the figure{which}{without}"
        self.hear(round(100 * (panel + share) / panels), 100)

    def share(self) -> float:
        """Which share is done."""
        return self.reports[-1][1] / self._total

    def _left(self, reports: list[tuple[float, int]], seconds: float) -> float:
        """Seconds that are left, about; 0 if that is not known."""
        (began, before), (reported, done) = reports[0], reports[-1]
        if done == before or reported - began < (
            # Seconds of the first report from which on it is more than the start of workers.
            SHORTEST_ESTIMATE if self._begun else max(SHORTEST_ESTIMATE, 5.0)
        ):
            return 0.0
        step = (done - before) / (len(reports) - 1)  # what comes next is about as much
        seconds_each = max(
            (reported - began) / (done - before), (seconds - began) / (done - before + step)
        )
        rest = seconds_each * (self._total - done)
        return max(rest - (seconds - reported), min(rest, seconds_each * step) / 2)

    def line(self, seconds: float) -> str:
        """What is done; seconds: that the command has taken."""
        after, reports = f"after {_elapsed(seconds)}{self._note}", self.reports
        if not reports:
            return f"still {self.doing or 'at work'} {after}"
        done, total = reports[-1][1], self._total
        doing = f"{self.doing}: " if self.doing else ""
        if done >= total:
            return f"{doing}all {total:,} done {after}; what follows from them is still to come"
        seconds_left = self._left(reports, self._clock() - self._started)
        less = f"; {self._less}" if self._less and seconds_left > MINUTE else ""
        progress = self._figure or f"{done:,} of {total:,} done"
        certified = "" if self._certified is None else f", {self._certified:,} certified"
        return f"{doing}{progress} ({100 * done // total} %){certified} {after}" + (
            f", about {_duration(seconds_left)} left{less}"
            if seconds_left > LOOK_AT_PROGRESS
            else ""
        )


class Watch:
    """What is said of a command's work while it is done: a line after FIRST_WORD seconds, and then each time it has taken
    twice as long or LONGEST_SILENCE longer. On a terminal, once a share is known, a bar in their place.

    terminal: whether stderr is one. clock: gives the time in seconds.
    """

    def __init__(self, terminal: bool = False, clock: Callable[[], float] = time.monotonic) -> None:
        self._terminal, self._clock, self._started = terminal, clock, clock()
        self._next, self._lock, self._has_bar = FIRST_WORD, Lock(), False
        self.work = Work("", "", clock)

    def begin(self, doing: str | None = "", less: str = "") -> Progress:
        """Begin another part, see `progress`."""
        with self._lock:
            self.work = Work(doing, less, self._clock)
            self.clear()
        self.look()
        return self.work.hear

    def look(self) -> None:
        """Say what is to be said by now."""
        seconds = self._clock() - self._started
        with self._lock:
            if self.work.doing is None:
                return
            if self._terminal and self.work.reports:
                if seconds > SHORTEST_ESTIMATE:
                    self._draw(seconds)
            elif seconds >= self._next:
                while seconds >= self._next:
                    self._next += min(self._next, LONGEST_SILENCE)
                say(self.work.line(seconds))

    def _draw(self, seconds: float) -> None:
        line, columns = printable(self.work.line(seconds)), _columns()
        room = min(columns - len(line) - 4, WIDEST_BAR)
        filled = round(room * self.work.share())
        bar = f"[{'#' * filled:-<{room}}] {line}" if room > 5 else line[: columns - 1]
        self._has_bar = True
        with suppress(OSError):  # the terminal may be gone, which is no reason to stop the work
            click.echo(f"{START_OF_LINE}{bar}", err=True, nl=False)

    def clear(self) -> None:
        """Take the bar from the terminal."""
        if self._has_bar:
            self._has_bar = False
            with suppress(OSError):
                click.echo(START_OF_LINE, err=True, nl=False)


_speaking: list[Watch] = []  # the command that runs


def _columns() -> int:
    """The width of the terminal that stderr is."""
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns or USUAL_COLUMNS
    except (OSError, ValueError):
        return USUAL_COLUMNS


def _elapsed(seconds: float) -> str:
    """A time that has passed, of which no two lines say the same."""
    minutes, rest = divmod(round(seconds), 60)
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{minutes} min {rest} s" if rest else f"{minutes} min"


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def where(paths: Iterable[Path], seconds: float) -> str:
    """Message with the paths of the files written; the folder appears once."""
    first, *further = paths
    suffixes = ["".join(path.suffixes) for path in further]
    return f"Wrote {', '.join([str(first), *suffixes])} in {seconds:.2f} s"
