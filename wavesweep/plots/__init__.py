"""Figures of tables. Each kind of table has a function of (columns, facts) that gives a matplotlib `Figure`.

A function is imported at its first use, so a run without a figure imports none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from wavesweep.errors import UsageError

if TYPE_CHECKING:
    from wavesweep.sweep import Table

_HOMES = MappingProxyType(
    {
        "Picture": "intervals", "bench": "errors_and_times", "bode": "responses", "compare": "comparison",
        "compare_bode": "comparison", "design": "designs", "diagram": "wiring", "passivity": "margins",
        "passivity_filters": "margins",
        "simulate": "simulation", "simulate_response": "responses", "stability_region": "intervals", "why": "elasticities",
        "stability_region_hands": "intervals", "zwidth": "intervals", "zwidth_hands": "intervals",
    }
)  # fmt: skip


def __getattr__(name):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def figure_of(kind: str) -> Callable[[Mapping[str, Any], Mapping[str, Any]], Any] | None:
    """The function that draws the tables of a kind from columns and facts; None if they have no figure."""
    name = kind.replace("-", "_")
    return import_module(f"{__name__}.{_HOMES[name]}").__dict__[name] if name in _HOMES else None


def refuse_settings() -> None:
    """Raise UsageError for settings in the current folder that matplotlib, which reads them at its import, cannot read."""
    try:
        Path("matplotlibrc").read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise UsageError(
            f"matplotlibrc: expected text in UTF-8, found bytes that are none ({error.reason}); matplotlib reads it from the "
            "current folder, so remove it, or leave the figure out (--no-plot)"
        ) from error
    except OSError:
        return


def drawn(table: Table, say: Callable[[str], None] = lambda _: None) -> Table:
    """The table with its figure, for which no more rows are kept than it needs.

    say: is called with a sentence if the figure of responses leaves some of them out.
    """
    if table.figure is not None:
        return table
    if table.kind in ("bode", "passivity"):
        from wavesweep.plots.chosen import Curves, Loops

        rows = (Curves if table.kind == "bode" else Loops)(table.blocks)
        return with_figure(table.watched(rows.add), partial(_drawn_of, rows, table.facts, say))
    if table.axes is None:
        return with_figure(table, partial(figure_of(table.kind), table.columns, table.facts))
    from wavesweep.plots.intervals import Picture

    picture = Picture(table.axes, table.blocks)
    return with_figure(table.watched(picture.add), partial(picture.draw, table.facts))


def _drawn_of(rows, facts, say):
    from wavesweep.plots.chosen import Loops

    if isinstance(rows, Loops):
        from wavesweep.plots.margins import passivity_of

        return passivity_of(rows, facts)
    from wavesweep.plots.responses import bode_of

    columns, left_out = rows.chosen()
    if left_out:
        say(f"figure of {facts['spec_name']}: {left_out[0].lower()}{left_out[1:-1]}")
    return bode_of(columns, left_out, facts)


def with_figure(table: Table, draw: Callable[[], Any]) -> Table:
    """The table with a figure that `draw` gives. It is drawn once, for any number of formats."""
    made = cache(draw)

    def write(path: Path) -> None:
        from wavesweep.plots.style import about_figure, save

        save(made(), path, about_figure(table.kind, table.facts))

    return replace(table, figure=write)
