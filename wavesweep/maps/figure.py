"""The figure of a plane in parts: what is proved stable, what is proved unstable, and what is open."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from wavesweep.maps.stability_map import PLACES
from wavesweep.program.columns import Columns
from wavesweep.program.plots.interval_legend import OWN
from wavesweep.program.plots.labels import assumption, label, valued
from wavesweep.program.plots.style import (
    ONE_COLUMN,
    TWO_COLUMNS,
    distinct_colour,
    figure,
    note_below,
    paler,
)

PANELS = (0.1, 0.5, 0.9)  # of the range of a third number: values at which the plane is cut
DARKEST = 4  # eigenvalues outside, from which on parts are alike
_STABLE: Any = paler(distinct_colour(0), 0.35)
_OPEN = "black"


def stability_map(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `stability-map` table: every part in its place, nothing between them; of three numbers
    cuts at some values of the third one."""
    from matplotlib.patches import Patch, Rectangle

    names = facts["numbers"]
    low, high = np.array(facts["ends"])
    if len(names) == 3:
        cuts = [low[2] + share * (high[2] - low[2]) for share in PANELS]
    else:
        cuts = [np.nan]
    with figure(ONE_COLUMN if len(cuts) == 1 else TWO_COLUMNS, 3.0) as canvas:
        panels = canvas.subplots(1, len(cuts), squeeze=False, sharey=True)[0]
        for axes, cut in zip(panels, cuts, strict=True):
            rows = np.ones(len(columns["share"]), bool)
            if len(cuts) > 1:
                rows = (columns["third_low"] <= cut) & (cut <= columns["third_high"])
                axes.set_title(valued(names[2], cut, facts), fontsize=8)
            _draw(axes, {name: column[rows] for name, column in columns.items()})
            axes.set_xlim(low[0], high[0])
            axes.set_ylim(low[1], high[1])
            for name, logarithmic in zip("xy", facts["logarithmic"], strict=False):
                if logarithmic:
                    axes.set(**{f"{name}scale": "log"})
            axes.set_xlabel(label(names[0], facts))
            axes.plot(*facts["own"][:2], **OWN)
        panels[0].set_ylabel(label(names[1], facts))
        if facts["about"]:
            start, stop = np.array(facts["about"])
            box: dict[str, Any] = {"fill": False, "linestyle": "--", "linewidth": 0.8, "zorder": 3}
            panels[0].add_patch(Rectangle(start, *(stop - start), **box))
        looks = [look for look in _looks(columns) if look[0].any()]
        handles = [Patch(facecolor=colour, label=name) for _, colour, name in looks]
        canvas.legend(handles=handles, loc="outside upper center", ncols=2)
        cross = "Cross: the spec's own design"
        dashed = "; dashed: the largest stable rectangle about it" if facts["about"] else ""
        note_below(canvas, f"{cross}{dashed}. Every point is proved or open.", assumption(facts))
    return canvas


def _looks(columns: Columns) -> Iterator[tuple[np.ndarray, Any, str]]:
    """Yield flags of the parts that are drawn alike, their colour and their name."""
    outside = columns["outside"]
    yield columns["proved"] == "stable", _STABLE, "stable"
    for number in range(1, DARKEST):
        yield outside == number, f"{0.9 - 0.15 * number:.2f}", f"unstable, {number} outside"
    more = f"unstable, {DARKEST}{' or more' if (outside > DARKEST).any() else ''} outside"
    yield outside >= DARKEST, f"{0.9 - 0.15 * DARKEST:.2f}", more
    yield columns["proved"] == "open", _OPEN, "open"


def _draw(axes: Any, columns: Columns) -> None:
    from matplotlib.collections import PolyCollection

    x, X, y, Y = (columns[f"{place}_{end}"] for place in PLACES[:2] for end in ("low", "high"))
    corners = np.stack([np.stack(each, -1) for each in ((x, y), (X, y), (X, Y), (x, Y))], 1)
    for rows, colour, _ in _looks(columns):
        if rows.any():
            axes.add_collection(
                PolyCollection(corners[rows], antialiased=False, linewidth=0, facecolor=colour)
            )
