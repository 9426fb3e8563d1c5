"""Messages: lines, warnings and progress on stderr, and the summary of a command as JSON on stdout."""

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from shutil import get_terminal_size
from threading import Event, Lock, Thread
from typing import Any

import click

from wavesweep.engine.errors import shortened

Progress = Callable[..., None]
WIDEST_BAR, USUAL_COLUMNS = 36, 80  # letters
NARROWEST, WIDEST = 80, 100  # letters in a line
FIRST_WORD = 5.0  # s after which a run says that it goes on
MINUTE = 60.0  # s of work that are left, from which on that is said at once
SHORTEST_ESTIMATE = 1.0  # s from which on an estimate is one, and a terminal has a bar
LOOK_AT_PROGRESS = 0.5  # s
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
    text, plain = printable(text), not warning or os.environ.get("NO_COLOR")
    with suppress(OSError):
        click.echo(text if plain else click.style(text, fg="yellow"), err=True)


@contextmanager
def progress(quiet: bool, doing: str = "", less: str = "") -> Iterator[Progress | None]:
    """Yield a function of (done, total, certified) that takes reports of the work, which `Watch` says; None if quiet.

    doing: the activity, if it is not computing. less: what would take less time.
    """
    with ExitStack() as opened:
        opened.enter_context(_heard(quiet))
        if quiet:
            yield None
            return
        watch, over = (
            Watch(doing, less, _bar(opened, doing) if sys.stderr.isatty() else None),
            Event(),
        )
        watch.look()
        opened.enter_context(
            _listening("wavesweep.proof", lambda record: watch.note(record.getMessage()))
        )
        opened.enter_context(_listening("wavesweep.figure", _Drawn(watch.draw).hear))

        def keep_looking() -> None:
            while not over.wait(LOOK_AT_PROGRESS):
                watch.look()

        Thread(target=keep_looking, daemon=True).start()
        try:
            yield watch.hear
        finally:
            over.set()
            watch.end()
            with suppress(OSError):
                opened.close()


@contextmanager
def _heard(quiet: bool) -> Iterator[None]:
    """Print the warnings of a run, such as workers that finish nothing."""
    import logging

    class Said(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            say("\n" * sys.stderr.isatty() + record.getMessage(), warning=True)

    handler, logger = logging.NullHandler() if quiet else Said(), logging.getLogger("wavesweep")
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


@contextmanager
def _listening(name: str, hear: Callable[[Any], None]) -> Iterator[None]:
    """Take what the parts of this process that are called so say of their work."""
    import logging

    class Heard(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            hear(record)

    handler, logger = Heard(), logging.getLogger(name)
    level, passed_on = logger.level, logger.propagate
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
        logger.propagate = passed_on


class _Drawn:
    """What the parts of a figure say of it: which panel is drawn, and which share of its further columns is computed."""

    def __init__(self, draw: Callable[[int, int, float], None]) -> None:
        self._draw, self._panel, self._panels = draw, 0, 1

    def hear(self, record: Any) -> None:
        """Take a message of `interval_figures` or of `plane_columns`."""
        share = 0.0
        if record.name.endswith("panels"):
            self._panel, self._panels = record.args
        else:
            (share,) = record.args
        self._draw(self._panel, self._panels, share)


class Watch:
    """What is said of work while it is done, also if no report comes.

    A line after FIRST_WORD seconds and then each time the work has taken twice as long; and one at
    once if there is more than a minute left, when that is known. On a terminal a bar in their
    place, as soon as there is a report.

    doing, less: see `progress`. bar: moves the bar of a terminal. clock: gives the time in seconds.
    """

    def __init__(
        self,
        doing: str,
        less: str,
        bar: Progress | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._doing, self._less, self._bar = doing, less, bar
        self._clock, self._started, self._next = clock, clock(), FIRST_WORD
        self._reports: list[tuple[float, int]] = []  # (seconds, done) of this phase of the work
        self._total = 0
        self._certified: int | None = None
        self._estimated = False
        self._ended = False
        self._begun = (
            False  # whether a report of this phase came from workers that were at work before
        )
        self._lock, self._note, self._figure = Lock(), "", ""

    def hear(self, done: int, total: int, certified: int | None = None) -> None:
        """Take a report."""
        with self._lock:
            seconds = self._clock() - self._started
            if self._reports and (
                total != self._total or done < self._reports[-1][1] or self._is_other(seconds, done)
            ):
                self._reports = []  # another phase of the work
                self._estimated = False
                self._begun = False
            self._reports.append((seconds, done))
            # Neither what a checkpoint had nor the time in which workers start says how fast the
            # work is.
            while len(self._reports) > 2 and (self._reports[1][0] < seconds / 6 or not self._begun):
                del self._reports[0]
                self._begun = True
            self._total = total
            self._certified = certified
            self._note = ""
        self.look()

    def _is_other(self, seconds: float, done: int) -> bool:
        """Whether a report is of another kind of work, as for every hand after the free device."""
        (began, before), (reported, so_far) = self._reports[0], self._reports[-1]
        as_long_before = (reported - began) * (done - so_far)
        # Times as long for as much: another kind of work.
        return (seconds - reported) * (so_far - before) > 300 * as_long_before > 0

    def note(self, text: str) -> None:
        """Take what the slice that is computed now has reached, for the next line."""
        with self._lock:
            self._note = f"; {text}"

    def draw(self, panel: int, panels: int, share: float) -> None:
        """Take which share of the curves of which panel of a figure, counted from 0, is computed."""
        which = f" {panel + 1} of {panels}" if panels > 1 else ""
        without = ", which --no-plot leaves out" if self._doing == WRITING else ""
        self._figure = f"curves for the figure{which}{without}"
        self.hear(round(100 * (panel + share) / panels), 100)

    def look(self) -> None:
        """Say what is to be said by now."""
        with self._lock:
            seconds = self._clock() - self._started
            if self._ended:
                return
            left = self._left(seconds)
            if not self._estimated and left > MINUTE and seconds >= FIRST_WORD:
                self._estimated, self._next = True, 2 * seconds
                say(
                    "\n" * (self._bar is not None and seconds > SHORTEST_ESTIMATE)
                    + self._line(seconds, left)
                )
            elif (self._bar is None or not self._reports) and seconds >= self._next:
                self._next = 2 * seconds
                say(self._line(seconds, left))
            if self._bar and self._reports and seconds > SHORTEST_ESTIMATE:
                self._bar(self._reports[-1][1], self._total, self._certified, left)

    def end(self) -> None:
        """Say nothing more."""
        with self._lock:
            self._ended = True

    def _left(self, seconds: float) -> float:
        """Seconds that are left, about; 0 if that is not known."""
        if not self._reports:
            return 0.0
        (began, before), (reported, done) = self._reports[0], self._reports[-1]
        if done == before or reported - began < (
            # Seconds of the first report from which on it is more than the start of workers.
            SHORTEST_ESTIMATE if self._begun else max(SHORTEST_ESTIMATE, 5.0)
        ):
            return 0.0
        step = (done - before) / (len(self._reports) - 1)  # what comes next is about as much
        seconds_each = max(
            (reported - began) / (done - before), (seconds - began) / (done - before + step)
        )
        rest = seconds_each * (self._total - done)
        return max(rest - (seconds - reported), min(rest, seconds_each * step) / 2)

    def _line(self, seconds: float, left: float) -> str:
        after = f"after {_duration(seconds)}{self._note}"
        if not self._reports:
            return f"still {self._doing or 'at work'} {after}"
        done, total, doing = (
            self._reports[-1][1],
            self._total,
            f"{self._doing}: " if self._doing else "",
        )
        if done >= total:
            return f"{doing}all {total:,} done {after}; what follows from them is still to come"
        less = f"; {self._less}" if self._less and left > MINUTE else ""
        what = self._figure or f"{done:,} of {total:,} done"
        return f"{doing}{what} ({100 * done // total} %) {after}" + (
            f", about {_duration(left)} left{less}" if left > LOOK_AT_PROGRESS else ""
        )


def _bar(opened: ExitStack, doing: str) -> Progress:
    bars: list[Any] = []

    def move(done: int, total: int, certified: int | None = None, left: float = 0.0) -> None:
        # The terminal may be gone, which is no reason to stop the work.
        with suppress(OSError):
            # It would go to stdout.
            if not bars:
                # A longer line would scroll.
                room = _columns() - len(f"{doing}  []  {total}/{total}  about 99 min left ")
                rates = len(f"  999,999/s  {total:,} certified")
                width = min(max(room - rates if room > rates else room, 1), WIDEST_BAR)
                opening = click.progressbar(
                    length=total,
                    width=width,
                    file=sys.stderr,
                    show_pos=True,
                    show_eta=False,
                    label=doing,
                    item_show_func=lambda text: text,
                )
                bars.append(opened.enter_context(opening))
                bars.append((done, time.monotonic(), room > rates))
            bar, (first, started, shown) = bars
            seconds = time.monotonic() - started
            rate = (done - first) / seconds if seconds > 1 else 0.0  # without a checkpoint's
            if rate > 1 / 120:
                said = [f"{rate:,.0f}/s" if rate > 9.5 else f"{60 * rate:,.0f}/min"]
            else:
                said = []
            said += [] if certified is None else [f"{certified:,} certified"]
            time_left = [f"about {_duration(left)} left"] if left > LOOK_AT_PROGRESS else []
            bar.update(done - bar.pos, "  ".join([*time_left, *said * shown]))

    return move


def _columns() -> int:
    """The width of the terminal that stderr is."""
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns or USUAL_COLUMNS
    except (OSError, ValueError):
        return USUAL_COLUMNS


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
