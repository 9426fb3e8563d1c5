"""What is said on stderr: progress on a terminal, notes, and where the results are."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

Progress = Callable[[int, int], None]


def say(text: str, warning: bool = False) -> None:
    """Say a line. A warning is yellow on a terminal, unless NO_COLOR is set (click does not ask for it)."""
    color = False if os.environ.get("NO_COLOR") else None
    click.secho(text, err=True, color=color, fg="yellow" if warning else None)


@contextmanager
def progress(quiet: bool) -> Iterator[Progress | None]:
    """Give a function of (done, total) that moves a bar, or None where nobody watches."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    # click's bar writes to stdout unless told; its total is known with the first report only.
    with click.progressbar(length=1, file=sys.stderr, show_pos=True) as bar:

        def move(done: int, total: int) -> None:
            bar.length = total
            bar.update(done - bar.pos)

        yield move


def where(paths: Iterable[Path], seconds: float) -> str:
    """Name the files written, the folder once."""
    first, *others = paths
    suffixes = ["".join(path.suffixes) for path in others]
    return f"Wrote {', '.join([str(first), *suffixes])} in {seconds:.2f} s"
