"""Several stable regions of one loop beside each other: free, held, guaranteed, passive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wavesweep.plots.bars import draw_bars
from wavesweep.plots.layout import MOST_PANELS, Layout, evenly, lay_out
from wavesweep.plots.region import draw_region

# From the one that promises least to the one that promises most; the colours stay the same whichever are there.
HANDS = {
    "free": ("#0072B2", "free device"),
    "operator": ("#56B4E9", "operator"),
    "box": ("#D55E00", "hands of the box"),
    "passive": ("#009E73", "every passive hand"),
    "port": ("#CC79A7", "passive port"),
}


def lay_out_hands(axes: Mapping[str, Sequence[float]]) -> Layout:
    """Give the axes their roles where the hands are the family: one along the figure, one for the panels."""
    several = {name: tuple(sorted(set(values))) for name, values in axes.items() if len(set(values)) > 1}
    x = lay_out(axes).x
    rest = [name for name in several if name != x]
    held = {name: several[name][len(several[name]) // 2] for name in rest[1:]}
    shown = lay_out({name: values for name, values in several.items() if name not in held})
    panels = rest[0] if rest else None
    notes = [f"{name} at {value:g} alone, of {len(several[name])} values" for name, value in held.items()]
    if panels and len(several[panels]) > MOST_PANELS:
        notes.insert(0, f"{MOST_PANELS} of {len(several[panels])} values of {panels}")
    if x and len(shown.points) < len(several[x]):
        notes.insert(0, f"{len(shown.points)} of {len(several[x])} values of {x}")
    return replace(
        shown, panels=panels, panel_values=evenly(several, panels, MOST_PANELS), family=None, members=(), fixed=held,
        left_out=f"Shown: {'; '.join(notes)}." if notes else "",
    )  # fmt: skip


def draw_hand_regions(axes: Any, columns: Mapping[str, np.ndarray], x: str) -> None:
    """Draw the regions of all hands in one panel."""
    for hand, rows in _members(columns).items():
        # Filled faintly: regions of hands lie over each other, and none is always the smaller one.
        draw_region(axes, rows, x, HANDS[hand][0], alone=False)


def draw_hand_bars(axes: Any, columns: Mapping[str, np.ndarray]) -> None:
    """Draw them as bars, a line of bars per hand."""
    members = _members(columns)
    draw_bars(axes, list(members.values()), list(members), [HANDS[hand][0] for hand in members])


def promised(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Which rows promise something for hands; how sure they are is said in the legend, not by the line's style."""
    if "hand" not in columns:
        return np.zeros(len(columns["along"]), bool)
    return ~np.isin(columns["hand"].astype(str), ("free", "operator"))


def hand_handles(columns: Mapping[str, np.ndarray]) -> list[Any]:
    """Entries of the legend; a region without a boundary is told there, since no line shows it."""
    from matplotlib.patches import Patch

    members = _members(columns)
    names = {hand: words for hand, (_, words) in HANDS.items()}
    if "operator" in members:
        names["port"] += " (operator)"  # it is that of the spec's own loop
    if "settled" in columns and "box" in members:
        names["box"] += " (settled)" if members["box"]["settled"].all() else " (searched)"
    bottom = np.nanmin(columns["low"], initial=np.inf)
    return [
        Patch(facecolor=(HANDS[hand][0], 0.15), edgecolor=HANDS[hand][0], label=names[hand] + _extent(rows, bottom))
        for hand, rows in members.items()
    ]


def _extent(rows: Mapping[str, np.ndarray], bottom: float) -> str:
    if not rows["intervals"].any():
        return ": none"
    whole = (rows["intervals"] == 1) & (rows["low"] == bottom) & np.isnan(rows["high_omega"])
    return ": whole range" if whole.all() else ""


def _members(columns: Mapping[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
    """The rows of each hand that is there."""
    shown = {**columns, "certified": columns["certified"] | promised(columns)}
    rows = {hand: columns["hand"] == hand for hand in HANDS}
    return {
        hand: {name: column[chosen] for name, column in shown.items()} for hand, chosen in rows.items() if chosen.any()
    }
