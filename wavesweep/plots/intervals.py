"""The figure of stable intervals: regions over the plane of two axes, or bars; for one loop, or for several hands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from wavesweep.plots.layout import MOST_PANELS, Layout, axes_of, evenly, lay_out
from wavesweep.plots.planes import draw_region
from wavesweep.plots.style import DOUBTFUL, ONE_COLUMN, TWO_COLUMNS, UNKNOWN, family_colours, figure, incomplete, label, symbol

_PANEL_HEIGHT = 2.3  # inches
_LETTERS_PER_INCH = 16
_HALF_BAR = 0.32  # of the distance between two bars

# From the one that promises least to the one that promises most; the colours stay the same whichever are there.
HANDS = {
    "free": ("#0072B2", "free device"),
    "operator": ("#56B4E9", "operator"),
    "box": ("#D55E00", "hands of the box"),
    "passive": ("#009E73", "every passive hand"),
    "port": ("#CC79A7", "passive port"),
}


def zwidth(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any], path: Path) -> None:
    """Draw the stable intervals of a `zwidth` or `stability-region` table as PNG.

    The stable region is filled, with white holes. Its boundary is solid if certified, otherwise dashed red. Slices that
    are only partly known are hatched outside of their intervals. The values of a second axis are panels, those of a third
    axis a family of lines. A note lists the values that do not fit.
    """
    picture = Picture(axes_of(columns))
    picture.add(columns)
    picture.draw(facts, path)


class Picture:
    """The figure of a table that need not fit into memory: `add` each of its blocks, then `draw`.

    `axes`: name -> values of the table's leading columns.
    """

    def __init__(self, axes: Mapping[str, Sequence[float]]) -> None:
        self._axes, self._layout = axes, None
        self._kept: list[dict[str, np.ndarray]] = []

    def add(self, columns: Mapping[str, np.ndarray]) -> None:
        """Keep the rows of a block (its columns by name) that the figure shows."""
        if self._layout is None:
            self._layout = (lay_out_hands if "hand" in columns else lay_out)(self._axes)
        shown = self._layout.shows(columns)
        self._kept.append({name: column[shown] for name, column in columns.items()})

    def draw(self, facts: Mapping[str, Any], path: Path) -> None:
        """Draw the figure as PNG."""
        rows = {name: np.concatenate([block[name] for block in self._kept]) for name in self._kept[0]}
        _draw(rows, path, self._layout, facts)


def _draw(columns: Mapping[str, np.ndarray], path: Path, layout: Layout, facts: Mapping[str, Any]) -> None:
    panels = layout.panel_values or (np.nan,)
    across = 1 if len(panels) == 1 else 2 if len(panels) in (2, 4) else 3
    rows = -(-len(panels) // across)
    width = ONE_COLUMN if across == 1 else TWO_COLUMNS
    height = 2.8 if across == 1 else _PANEL_HEIGHT * rows + 0.4
    with figure(path, width, height) as canvas:
        grid = canvas.subplots(rows, across, sharex=True, sharey=True, squeeze=False)
        for axes, value in zip(grid.flat, panels, strict=False):
            _draw_panel(axes, _rows_where(columns, layout.panels, value), layout)
            if layout.panels is not None:
                axes.set_title(f"{symbol(layout.panels)} = {value:g}")
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        _limit(grid[0, 0], columns, bars=layout.x is None)
        _name_axes(canvas, columns, layout, facts)
        _add_legend(canvas, columns, layout, facts)


def _draw_panel(axes: Any, columns: Mapping[str, np.ndarray], layout: Layout) -> None:
    if layout.x is not None and not (columns["intervals"] > 0).any():
        nothing = "nothing known to be stable" if incomplete(columns).any() else "nowhere stable in the swept range"
        axes.text(0.5, 0.5, nothing, ha="center", va="center", transform=axes.transAxes)
    members = [_rows_where(columns, layout.family, value) for value in layout.members or (np.nan,)]
    if layout.x is None:
        if "hand" in columns:
            draw_hand_bars(axes, columns)
        else:
            draw_bars(axes, members, [f"{v:g}" for v in layout.members])
        return
    if _logarithmic(columns[layout.x]):
        axes.set_xscale("log")
    if "hand" in columns:
        draw_hand_regions(axes, columns, layout.x)
    else:
        for colour, member in zip(family_colours(len(members)), members, strict=True):
            draw_region(axes, member, layout.x, colour, alone=len(members) == 1)
    axes.set_xlim(columns[layout.x].min(), columns[layout.x].max())


def _limit(axes: Any, columns: Mapping[str, np.ndarray], bars: bool) -> None:
    """Show every interval of the table; all panels share these limits, so that they can be compared."""
    bottom, top = np.nanmin(columns["low"], initial=0.0), np.nanmax(columns["high"], initial=0.0)
    limits = (float(bottom), float(top + 0.05 * (top - bottom)) if top > bottom else 1.0)
    axes.set_xlim(limits) if bars else axes.set_ylim(limits)


def _rows_where(columns: Mapping[str, np.ndarray], axis: str | None, value: float) -> dict[str, np.ndarray]:
    chosen = slice(None) if axis is None else columns[axis] == value
    return {name: column[chosen] for name, column in columns.items()}


def _logarithmic(values: np.ndarray) -> bool:
    """Whether an axis is spaced by a constant factor, so that its scale is logarithmic."""
    steps = np.unique(values)
    if len(steps) < 4 or steps[0] <= 0:
        return False
    return bool(np.ptp(np.diff(np.log(steps))) < 1e-6 * np.log(steps[-1] / steps[0]))


def _name_axes(canvas: Any, columns: Mapping[str, np.ndarray], layout: Layout, facts: Mapping[str, Any]) -> None:
    along = label(str(columns["along"][0]), facts)
    bars = layout.x is None
    # The note is a further line of the label: the layout makes room for that, and for nothing that is placed by hand.
    note = wrap(layout.left_out, int(_LETTERS_PER_INCH * canvas.get_figwidth()))
    canvas.supxlabel("\n".join([along if bars else label(layout.x, facts), *note]), fontsize=8)
    across = (label(layout.family, facts) if layout.family else "") if bars else along
    if across:
        canvas.supylabel(across, fontsize=8)


def _add_legend(canvas: Any, columns: Mapping[str, np.ndarray], layout: Layout, facts: Mapping[str, Any]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = hand_handles(columns) if "hand" in columns else []
    if layout.x is not None and layout.family is not None:
        colours = family_colours(len(layout.members))
        handles = [Line2D([], [], color=c, label=f"{v:g}") for c, v in zip(colours, layout.members, strict=True)]
    if not (columns["certified"] | promised(columns)).all():
        handles.append(Line2D([], [], color=DOUBTFUL, linestyle="--", label="not certified"))
    if incomplete(columns).any():
        handles.append(Patch(**UNKNOWN, label="not known outside the intervals"))
    if handles:
        title = label(layout.family, facts) if layout.family is not None and len(handles) > 1 else None
        across = 2 if "hand" in columns else 6
        place = {"loc": "outside upper center", "ncols": across, "columnspacing": 1.0, "handlelength": 1.3}
        canvas.legend(handles=handles, title=title, **place)


def draw_bars(
    axes: Any, members: Sequence[Mapping[str, np.ndarray]], names: Sequence[str], colours: Sequence[Any] = ()
) -> None:
    """Draw a bar per stable interval, a line of bars per member, named at the left.

    An end of the stable set is marked by a stroke; if the swept range ends the bar, there is none. `colours`: one for
    each member; by default all have the same.
    """
    alike = family_colours(1) * len(members)
    for place, (columns, colour) in enumerate(zip(members, colours or alike, strict=True)):
        stable = np.flatnonzero(columns["intervals"] > 0).tolist()
        unknown = bool(incomplete(columns).any())
        if unknown:
            axes.axhspan(place - _HALF_BAR, place + _HALF_BAR, **UNKNOWN)
        if not stable:
            said = "nothing known to be stable" if unknown else "nowhere stable"
            axes.annotate(said, (0, place), (3, 0), textcoords="offset points", va="center", color="0.35")
        for row in stable:
            _draw_bar(axes, place, {name: column[row] for name, column in columns.items()}, colour)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(-0.6, max(len(members) - 0.4, 0.6))


def _draw_bar(axes: Any, place: int, row: Mapping[str, Any], colour: Any) -> None:
    edge, style = (colour, "-") if row["certified"] else (DOUBTFUL, "--")
    bar = {"width": row["high"] - row["low"], "left": row["low"], "height": 2 * _HALF_BAR, "linewidth": 0}
    axes.barh(place, **bar, color="white", zorder=0.5)
    axes.barh(place, **bar, color=colour, alpha=0.25)
    for end in ("low", "high"):
        if not np.isnan(row[f"{end}_omega"]):
            axes.vlines(row[end], place - _HALF_BAR, place + _HALF_BAR, colors=edge, linestyles=style)


def lay_out_hands(axes: Mapping[str, Sequence[float]]) -> Layout:
    """Give the axes their roles if the hands are the family: one along the figure, one for the panels."""
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
    """Draw the intervals as bars, a line of bars per hand."""
    members = _members(columns)
    draw_bars(axes, list(members.values()), list(members), [HANDS[hand][0] for hand in members])


def promised(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Flags of the rows with a guarantee for hands; their certainty is in the legend, not in the style of the line."""
    if "hand" not in columns:
        return np.zeros(len(columns["along"]), bool)
    return ~np.isin(columns["hand"].astype(str), ("free", "operator"))


def hand_handles(columns: Mapping[str, np.ndarray]) -> list[Any]:
    """Entries of the legend, with those regions that have no boundary, since no line shows them."""
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
    """The rows of each hand of the table."""
    shown = {**columns, "certified": columns["certified"] | promised(columns)}
    rows = {hand: columns["hand"] == hand for hand in HANDS}
    return {hand: {name: column[chosen] for name, column in shown.items()} for hand, chosen in rows.items() if chosen.any()}
