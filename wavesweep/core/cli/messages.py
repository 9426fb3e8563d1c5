"""Messages: lines, warnings and progress on stderr, and the summary of a command as JSON on stdout."""

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from shutil import get_terminal_size
from typing import Any

import click

from wavesweep.core.errors import shortened

Progress = Callable[..., None]
WIDEST_BAR, USUAL_COLUMNS = 36, 80  # letters
NARROWEST, WIDEST = 80, 100  # letters in a line
SCHEMA_VERSION = 1  # of what --json prints; another one if a key goes away or changes its meaning
FIRST_WORD = 10.0  # s after which a run without a terminal says that it goes on


def show_json(summary: Mapping[str, Any]) -> None:
    """Print the summary of a command as one JSON object on stdout."""
    import json

    click.echo(json.dumps({"schema_version": SCHEMA_VERSION, **summary}, allow_nan=False))


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
def progress(quiet: bool, doing: str = "") -> Iterator[Progress | None]:
    """Yield a function of (done, total, certified) that moves a progress bar; None if nothing is to be said.

    doing: the activity, if it is not computing.

    If stderr is not a terminal, it writes a line now and then instead: after FIRST_WORD seconds, then ever more rarely.
    Until the first report there is a line after FIRST_WORD seconds in any case.
    """
    opened = ExitStack()
    opened.enter_context(_heard(quiet))
    if quiet:
        with opened:
            yield None
        return
    move = _bar(opened, doing) if sys.stderr.isatty() else Murmur(doing).hear
    with patience(f"still {doing or 'at work on the first chunk'}") as reached:

        def report(*given: Any) -> None:
            reached()
            move(*given)

        try:
            yield report
        finally:
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
def patience(words: str) -> Iterator[Callable[[], None]]:
    """Say these words once, if the work takes longer than FIRST_WORD seconds; yield a function that says it is done."""
    from threading import Timer

    timer = Timer(FIRST_WORD, say, [words])
    timer.daemon = True
    timer.start()
    try:
        yield timer.cancel
    finally:
        timer.cancel()


def _bar(opened: ExitStack, doing: str) -> Progress:
    bars: list[Any] = []

    def move(done: int, total: int, certified: int | None = None) -> None:
        # The terminal may be gone, which is no reason to stop the work.
        with suppress(OSError):
            # The bar appears with the first report: a run too short for one shows none. It would go to stdout.
            if not bars:
                room = _columns() - len(f"{doing}  []  {total}/{total}  0d 00:00:00 ")  # a longer line would scroll
                rates = len(f"  999,999/s  {total:,} certified")
                shown = {"file": sys.stderr, "show_pos": True, "label": doing, "item_show_func": lambda text: text}
                width = min(max(room - rates if room > rates else room, 1), WIDEST_BAR)
                bars.append(opened.enter_context(click.progressbar(length=total, width=width, **shown)))
                bars.append((done, time.monotonic(), room > rates))
            bar, (first, started, shown) = bars
            seconds = time.monotonic() - started
            said = [f"{(done - first) / seconds:,.0f}/s"] if seconds > 1 and done > first else []  # without a checkpoint's
            said += [] if certified is None else [f"{certified:,} certified"]
            bar.update(done - bar.pos, "  ".join(said) * shown)

    return move


def _columns() -> int:
    """The width of the terminal that stderr is."""
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns or USUAL_COLUMNS
    except (OSError, ValueError):
        return USUAL_COLUMNS


class Murmur:
    """A line of progress on stderr after FIRST_WORD seconds, and again each time the run has taken twice as long.

    doing: the activity, if it is not computing. clock: gives the time in seconds.
    """

    def __init__(self, doing: str = "", clock: Callable[[], float] = time.monotonic) -> None:
        self._doing = f"{doing}: " if doing else ""
        self._clock, self._started, self._next = clock, clock(), FIRST_WORD
        self._first: tuple[int, float] | None = None

    def hear(self, done: int, total: int, certified: int | None = None) -> None:
        """Take a report, and write a line if it is time for one."""
        del certified
        seconds = self._clock() - self._started
        if self._first is None:
            self._first = (done, seconds)  # a checkpoint may have had most of it
        if seconds < self._next or done >= total:
            return
        self._next = 2 * seconds
        advance, taken = done - self._first[0], seconds - self._first[1]
        left = f", about {_duration(taken * (total - done) / advance)} left" if advance and taken > 0 else ""
        say(f"{self._doing}{done:,} of {total:,} done ({100 * done // total} %) after {_duration(seconds)}{left}")


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def where(paths: Iterable[Path], seconds: float) -> str:
    """Message with the paths of the files written; the folder appears once."""
    first, *others = paths
    suffixes = ["".join(path.suffixes) for path in others]
    return f"Wrote {', '.join([str(first), *suffixes])} in {seconds:.2f} s"
