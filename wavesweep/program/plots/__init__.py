"""Figures of tables. Each kind of table has a function of (columns, facts) that gives a matplotlib
`Figure`.

A function is imported at its first use, so a run without a figure imports none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavesweep.capabilities import offered
from wavesweep.engine.errors import UsageError
from wavesweep.program.tables import HOMES, kind_named

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec
    from wavesweep.program.tables.table import Table


def __getattr__(name):
    kind = name.replace("_", "-")
    if kind in HOMES:
        return figure_of(kind)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def figure_of(kind: str) -> Callable[..., Any]:
    """The function that draws the tables of a kind from columns and facts."""
    home, _, name = kind_named(kind).figure.rpartition(".")
    return import_module(home).__dict__[name]


def diagram(spec: Spec) -> Any:
    """The picture of the loop of a spec, which a capability draws. Errors: UsageError if none
    does."""
    module = offered("diagram")
    if module is None:
        raise UsageError(
            "the picture of a loop: expected the capability picture, found that it is not there"
        )
    return module.diagram(spec)


def timing(spec: Spec) -> Any:
    """The picture of time of a spec, which a capability draws. Errors: UsageError if none does,
    or nothing runs in ticks."""
    module = offered("timing")
    if module is None:
        raise UsageError(
            "the picture of time: expected the capability picture, found that it is not there"
        )
    return module.timing(spec)


def refuse_settings() -> None:
    """Raise UsageError if the current folder has settings that matplotlib, which reads them when
    imported, cannot read."""
    place = Path("matplotlibrc")
    if place.exists() and not place.is_file() and not place.is_dir():
        raise UsageError(
            "matplotlibrc: expected a file, found a pipe or a device, which matplotlib would wait for; remove it from the "
            "current folder, or leave the figure out (--no-plot)"
        )
    try:
        place.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise UsageError(
            f"matplotlibrc: expected text in UTF-8, found other bytes ({error.reason}); matplotlib reads it from the "
            "current folder, so remove it, or leave the figure out (--no-plot)"
        ) from error
    except OSError:
        return


def drawn(table: Table, say: Callable[[str], None] = lambda _: None) -> Table:
    """The table with its figure, for which a long table is read in blocks.

    say: called with a sentence if the figure of responses leaves some of them out.
    """
    if table.figure is not None:
        return table
    options = {"say": say} if "bode" in table.kind else {}

    def draw() -> Any:
        # Rows of a table that are drawn at once.
        rows = table.blocks if table.rows > 300_000 else table.columns
        return figure_of(table.kind)(rows, table.facts, **options)

    return with_figure(table, draw)


def with_figure(table: Table, draw: Callable[[], Any]) -> Table:
    """The table with the figure that `draw` returns, drawn once for any number of formats."""
    made = cache(draw)

    def write(path: Path) -> None:
        from wavesweep.program.plots.figure_files import save
        from wavesweep.program.plots.style import about_figure

        save(made(), path, about_figure(table.kind, table.facts))

    return replace(table, figure=write)
