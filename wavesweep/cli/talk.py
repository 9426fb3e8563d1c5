"""What is said on stderr: progress on a terminal, notes, and where the results are."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import click

Progress = Callable[[int, int], None]


def say(text: str, warning: bool = False) -> None:
    """Say a line. A warning is yellow on a terminal, unless NO_COLOR is set (click does not ask for it)."""
    plain = not warning or os.environ.get("NO_COLOR")
    click.echo(text if plain else click.style(text, fg="yellow"), err=True)


@contextmanager
def progress(quiet: bool) -> Iterator[Progress | None]:
    """Give a function of (done, total) that moves a bar, or None where nobody watches."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    bars: list[Any] = []
    with ExitStack() as opened:

        def move(done: int, total: int) -> None:
            # The bar appears with the first report: a run too short for one shows none. It would go to stdout.
            if not bars:
                bars.append(opened.enter_context(click.progressbar(length=total, file=sys.stderr, show_pos=True)))
            bars[0].update(done - bars[0].pos)

        yield move


def where(paths: Iterable[Path], seconds: float) -> str:
    """Name the files written, the folder once."""
    first, *others = paths
    suffixes = ["".join(path.suffixes) for path in others]
    return f"Wrote {', '.join([str(first), *suffixes])} in {seconds:.2f} s"
