"""What is said on stderr: progress on a terminal, notes, and where the results are."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import click

Progress = Callable[..., None]


def say(text: str, warning: bool = False) -> None:
    """Say a line. A warning is yellow on a terminal, unless NO_COLOR is set (click does not ask for it)."""
    plain = not warning or os.environ.get("NO_COLOR")
    click.echo(text if plain else click.style(text, fg="yellow"), err=True)


@contextmanager
def progress(quiet: bool) -> Iterator[Progress | None]:
    """Give a function of (done, total, certified) that moves a bar, or None where nobody watches."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    bars: list[Any] = []
    with ExitStack() as opened:

        def move(done: int, total: int, certified: int | None = None) -> None:
            # The bar appears with the first report: a run too short for one shows none. It would go to stdout.
            if not bars:
                shown = {"file": sys.stderr, "show_pos": True, "item_show_func": lambda text: text}
                bars.append(opened.enter_context(click.progressbar(length=total, **shown)))
                bars.append(_Rate(done))
            bar, rate = bars
            bar.update(done - bar.pos, rate.text(done, certified))

        yield move


class _Rate:
    """How many a second since the first report; what a checkpoint had before it does not count."""

    def __init__(self, done: int) -> None:
        self._first, self._started = done, time.monotonic()

    def text(self, done: int, certified: int | None) -> str:
        seconds = time.monotonic() - self._started
        rate = f"{(done - self._first) / seconds:,.0f}/s" if seconds > 0 and done > self._first else ""
        proved = "" if certified is None else f"{certified:,} certified"
        return "  ".join(part for part in (rate, proved) if part)


def where(paths: Iterable[Path], seconds: float) -> str:
    """Name the files written, the folder once."""
    first, *others = paths
    suffixes = ["".join(path.suffixes) for path in others]
    return f"Wrote {', '.join([str(first), *suffixes])} in {seconds:.2f} s"
