"""Stable intervals as horizontal bars, for tables without a second axis to draw a plane over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.plots.style import DOUBTFUL, UNKNOWN, family_colours, incomplete

_HALF = 0.32  # of the distance between two bars


def draw_bars(
    axes: Any, members: Sequence[Mapping[str, np.ndarray]], names: Sequence[str], colours: Sequence[Any] = ()
) -> None:
    """Draw a bar per stable interval, a line of bars per member, named at the left.

    An end of the stable set has a stroke across; where the swept range ends the bar, it has none. `colours`: one for
    each member; by default all have the same.
    """
    alike = family_colours(1) * len(members)
    for place, (columns, colour) in enumerate(zip(members, colours or alike, strict=True)):
        stable = np.flatnonzero(columns["intervals"] > 0).tolist()
        unknown = bool(incomplete(columns).any())
        if unknown:
            axes.axhspan(place - _HALF, place + _HALF, **UNKNOWN)
        if not stable:
            said = "nothing known to be stable" if unknown else "nowhere stable"
            axes.annotate(said, (0, place), (3, 0), textcoords="offset points", va="center", color="0.35")
        for row in stable:
            _draw_bar(axes, place, {name: column[row] for name, column in columns.items()}, colour)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(-0.6, max(len(members) - 0.4, 0.6))


def _draw_bar(axes: Any, place: int, row: Mapping[str, Any], colour: Any) -> None:
    edge, style = (colour, "-") if row["certified"] else (DOUBTFUL, "--")
    bar = {"width": row["high"] - row["low"], "left": row["low"], "height": 2 * _HALF, "linewidth": 0}
    axes.barh(place, **bar, color="white", zorder=0.5)
    axes.barh(place, **bar, color=colour, alpha=0.25)
    for end in ("low", "high"):
        if not np.isnan(row[f"{end}_omega"]):
            axes.vlines(row[end], place - _HALF, place + _HALF, colors=edge, linestyles=style)
