"""The options that commands share: each is defined once and means one thing everywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from typing import Any

import click

STDOUT = "-"


@dataclass(frozen=True)
class Options:
    """What the shared options were set to."""

    out: str | None
    overrides: tuple[str, ...]
    jobs: int
    backend: str | None
    scheduler: str | None
    plot: bool
    force: bool
    quiet: bool
    debug: bool

    @property
    def to_stdout(self) -> bool:
        """Whether the table goes to stdout and nothing to files."""
        return self.out == STDOUT


override = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Override a key of the spec, e.g. controller.b=40, or b=40. May be repeated.",
)
quiet = click.option("--quiet", is_flag=True, help="Say nothing but errors.")
# Read by the entry, before any command runs; declared here so that it stands in each help.
debug = click.option("--debug", is_flag=True, help="Show a traceback when something fails.")

_COMMON = (
    click.option(
        "--out",
        metavar="DIR",
        help="Folder for the results [default: results/<spec's name>]; - writes the CSV to stdout.",
    ),
    override,
    click.option(
        "--jobs",
        metavar="N",
        type=click.IntRange(min=1),
        default=2,
        show_default=True,
        help="Worker processes, for work that is worth them.",
    ),
    click.option("--backend", metavar="NAME", help="Any joblib backend: loky, threading, dask, ray, ..."),
    click.option("--scheduler", metavar="ADDRESS", help="Address of the dask scheduler, with --backend dask."),
    click.option("--plot/--no-plot", default=True, show_default=True, help="Draw the figure."),
    click.option("--force", is_flag=True, help="Replace results of another spec."),
    quiet,
    debug,
)


def common(body: Callable[..., None]) -> Callable[..., None]:
    """Give a command the common options; its body receives them together as `options`."""

    @wraps(body)
    def gathered(**given: Any) -> None:
        options = Options(**{field.name: given.pop(field.name) for field in fields(Options)})
        if options.scheduler is not None and options.backend != "dask":
            raise click.UsageError(f"--scheduler needs --backend dask, found --backend {options.backend}")
        body(options=options, **given)

    for option in reversed(_COMMON):
        gathered = option(gathered)
    return gathered
