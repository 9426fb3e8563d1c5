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

if TYPE_CHECKING:
    from wavesweep.sweep import Table

_HOMES = MappingProxyType(
    {
        "Picture": "intervals", "bench": "bench", "bode": "responses", "compare": "comparison", "compare_bode": "comparison",
        "passivity": "margins", "passivity_filters": "margins", "simulate": "simulation", "simulate_response": "responses",
        "stability_region": "intervals", "why": "elasticities", "zwidth": "intervals",
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


def drawn(table: Table) -> Table:
    """The table with its figure. If its rows come in blocks, no more of them are kept than the figure needs."""
    if table.figure is not None:
        return table
    if table.axes is None:
        return with_figure(table, partial(figure_of(table.kind), table.columns, table.facts))
    from wavesweep.plots.intervals import Picture

    picture = Picture(table.axes, table.blocks)
    return with_figure(table.watched(picture.add), partial(picture.draw, table.facts))


def with_figure(table: Table, draw: Callable[[], Any]) -> Table:
    """The table with a figure that `draw` gives. It is drawn once, for any number of formats."""
    made = cache(draw)

    def write(path: Path) -> None:
        from wavesweep.plots.style import about_figure, save

        save(made(), path, about_figure(table.kind, table.facts))

    return replace(table, figure=write)
