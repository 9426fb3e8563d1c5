"""The figure of stable intervals: regions over the plane of two axes, or bars; of a family, of
several hands or specs."""

import logging
from collections.abc import Mapping, Sequence
from math import ceil
from textwrap import fill
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.program.analyses.claim_words import nothing
from wavesweep.program.analyses.plane_columns import PlaneCurve, incomplete, smooth_axes
from wavesweep.program.columns import Columns, axes_of, joined, whose_column
from wavesweep.program.plots.figure_layout import best_of, best_row, lay_out, rows_with
from wavesweep.program.plots.interval_legend import (
    BEST,
    LIMIT,
    LIMITS,
    OWN,
    draw_legends,
    entries_of,
    rows_of,
)
from wavesweep.program.plots.labels import (
    assumed,
    assumption,
    claimed,
    label,
    printed,
    symbol,
    valued,
    with_unit,
)
from wavesweep.program.plots.member_panels import (
    HALF_BAR,
    Member,
    bar_names,
    damping_of,
    draw_bars,
    member_curves,
    over_one_damping,
    specs_of,
)
from wavesweep.program.plots.plane_regions import region_of
from wavesweep.program.plots.region_figures import (
    Bars,
    draw_at_values,
    draw_felt,
    draw_for_all,
    draw_for_all_bar,
    draw_region,
    draw_unknown_at_values,
    mark_range,
    view_of,
)
from wavesweep.program.plots.sampling import Blocks, blocks_of, note_values, rows_where
from wavesweep.program.plots.scales import by_factors, is_logarithmic
from wavesweep.program.plots.shown import Shown
from wavesweep.program.plots.style import (
    ONE_COLUMN,
    TWO_COLUMNS,
    figure,
    is_narrow,
    note_below,
    wide,
)
from wavesweep.program.tables.columns import unlike_units

# hears which panel of how many is drawn
PANELS_LOGGER = logging.getLogger("wavesweep.figure.panels")
_APART = 0.8  # points between bars of two members at a value of x
# share of the axis without intervals at its high end, from which it is not shown; and what is
_EMPTY, _SHOWN_OF_EMPTY = 0.4, 0.1
_HOW = {  # how stable sets are drawn, in the notes below the figure
    "strokes": "Strokes: the unstable side.",
    "bars": "Bars: at their value alone.",
    "cut": "Beyond the axis no swept value has an interval.",
}


def zwidth(table: Columns | Blocks, facts: Mapping[str, Any]) -> Any:
    """Draw the stable intervals of a `zwidth` or `stability-region` table.

    A line or an area lies between two values of x only if the intervals between them were computed,
    see `plane_columns`. What is known at the values of the table alone, as what is guaranteed for
    hands or for [for_all], are bars at these values. A single region is filled. Several are
    outlined, with strokes to the unstable side, so that none hides the hole of another. Boundaries
    are dashed red if not certified, and slices that are only partly known are hatched outside of
    their intervals. One further axis is a family of lines, the next one gives panels through the
    best design.
    """
    blocks = blocks_of(table)
    values_of: dict[str, np.ndarray] = {}
    best: dict[str, Any] = {}
    several = False
    for block in blocks():
        note_values(values_of, block, "along")
        best = best_of([best, best_row(block)])
        several = bool(whose_column(block))
    axes = {
        name: values[~np.isnan(values)].tolist()
        for name, values in values_of.items()
        if name != "spec"
    }
    dampings = [damping_of(tables) for tables in specs_of(facts).values()]
    smooth = [] if several else smooth_axes(axes, facts)
    layout = lay_out(axes, best, several, smooth, [name for name in dampings if name])
    rows = _once(rows_where(blocks, layout.shows))
    return _draw(Shown(rows, facts, layout, best))


def of_specs(table: Columns | Blocks, facts: Mapping[str, Any]) -> Any:
    """Draw a `zwidth-specs` table as `zwidth` draws one, a colour for each spec.

    The dampings of walls, which drawn loops name, are one axis.
    """
    columns = joined(table()) if callable(table) else table
    return zwidth(over_one_damping(columns, facts), facts)


def _once(columns: Columns) -> Columns:
    """The rows without those that are there again, as an axis has a value twice."""
    whose = {"spec", "hand", "guarantee"} & columns.keys()
    names = {*axes_of(columns), "interval", *whose}
    labels = []
    for name in names:
        _, labels_of_rows = np.unique(columns[name], return_inverse=True)
        labels.append(labels_of_rows.ravel())
    _, first = np.unique(np.stack(labels, axis=1), axis=0, return_index=True)
    rows = np.sort(first)
    return {name: column[rows] for name, column in columns.items()}


def _draw(shown: Shown) -> Any:
    """Draw all panels with their legends and notes."""
    bars = shown.layout.x is None
    panels = shown.layout.panel_values or (np.nan,)
    across = _panels_in_a_row(len(panels), bars=bars)
    down = ceil(len(panels) / across)
    usual = ONE_COLUMN if across == 1 else TWO_COLUMNS
    with figure(usual, _height(shown, across, down, wide(usual))) as canvas:
        grid = canvas.subplots(down, across, sharex=True, sharey=True, squeeze=False)
        inches = (wide(usual) / across, canvas.get_figheight() / down)
        reached = list(shown.view)
        how: set[str] = set()
        for number, (axes, value) in enumerate(zip(grid.flat, panels, strict=False)):
            PANELS_LOGGER.info("%d of %d", number, len(panels))
            reached += _draw_panel(shown, axes, value, inches, how)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        _scale_values(shown, grid, (min(reached), max(reached)))
        drawn = grid.flat[: len(panels)]
        for number, axes in enumerate(drawn):
            axes.tick_params(labelbottom=number + across >= len(panels))
            mark_range(axes, shown.columns, bars=bars)
            for walls in shown.walls:
                walls.draw(axes)
        members, marks = entries_of(shown, panels, drawn)
        many_panels = across > 1 and down > 1 and not is_narrow()
        legends_beside = many_panels and rows_of(members + marks, wide(usual)) > 1
        rows = 0
        if across == 1:
            rows = rows_of(members, wide(usual)) + rows_of(marks, wide(usual))
        elif not legends_beside:
            rows = rows_of(members + marks, wide(usual))
        canvas.set_figheight(canvas.get_figheight() + 0.17 * rows)
        _name_axes(shown, canvas, how)
        draw_legends(canvas, grid, members, marks, legends_beside)
    return canvas


def _panels_in_a_row(number: int, *, bars: bool) -> int:
    if number == 1 or (bars and is_narrow()):  # whose names need the room
        return 1
    return 2 if number in (2, 4) or is_narrow() else 3


def _height(shown: Shown, across: int, down: int, width: float) -> float:
    """The height of all panels, in inches: that of a plot, or of its bars with the lines of their
    names. width: of the figure."""
    if shown.layout.x is None:
        names = bar_names(shown.members(shown.columns), width)
        lines = max(name.count("\n") + 1 for name in names)
        return down * (0.75 + len(names) * (0.13 * lines + 0.09))
    return 2.5 if across == down == 1 else 2.3 * down


def _scale_values(shown: Shown, grid: np.ndarray, view: tuple[float, float]) -> None:
    """Give the axis of the values, which all panels share, its scale and its ends."""
    bars = shown.layout.x is None
    if shown.by_factors:
        for axes in grid.flat:
            by_factors(axes.xaxis if bars else axes.yaxis, *view)
    if bars:
        grid[0, 0].set_xlim(view)
    else:
        grid[0, 0].set_ylim(view)


def _draw_panel(
    shown: Shown, axes: Any, panel: float, inches: tuple[float, float], how: set[str]
) -> list[float]:
    """Draw a panel, and return how far boundaries go between the values of the table, with some
    room.

    how: is added what of _HOW occurs.
    """
    layout = shown.layout
    columns = rows_with(shown.columns, {layout.panels: panel} if layout.panels else {})
    members = shown.members(columns)
    reached: list[float] = []
    bars_of: dict[str, Bars] = {}
    if layout.x is None:
        draw_bars(axes, members)
    else:
        reached, bars_of = _draw_plane(shown, axes, columns, members, inches, how)
    if layout.panels is not None:
        axes.set_title(valued(layout.panels, panel, shown.facts))
    if shown.best and (layout.panels is None or shown.best[layout.panels] == panel):
        style = dict(BEST)
        bar = bars_of.get(shown.best.get(shown.whose, ""))
        if bar:  # of the guarantee that the best design has
            style["transform"] = bar.place(axes)
        axes.plot(*shown.place(shown.best, members), **style)
    for place in shown.own_design([panel]):
        axes.plot(*place, **OWN)
    for name, height in shown.limits_of_walls().items():
        axes.axhline(height, **LIMIT, linestyle=LIMITS[name][1])
    if layout.x is None:
        for place, member in enumerate(members):
            if member.proved and "fails_from" in member.rows:
                draw_for_all_bar(axes, place, HALF_BAR, member.rows, shown.span)
    return reached


def _side_by_side(curves: Sequence[PlaneCurve], room: float) -> list[Bars]:
    """The bars of members in the room of a value: those that have bars alone stand beside each
    other."""
    in_bars = sum(not curve.gaps for curve in curves)
    # Bars fill at most 0.6 of the distance between two values of x.
    width = float(np.clip(0.6 * room / max(in_bars, 1), 0.8, 4.0))
    bars = []
    place = 0
    for curve in curves:
        if curve.gaps:
            bars.append(Bars(0.0, width))
            continue
        bars.append(Bars((width + _APART) * (place - (in_bars - 1) / 2), width))
        place += 1
    return bars


def _draw_plane(
    shown: Shown,
    axes: Any,
    columns: Columns,
    members: Sequence[Member],
    inches: tuple[float, float],
    how: set[str],
) -> tuple[list[float], dict[str, Bars]]:
    """Draw a panel over x; gives how far boundaries go, and where the bars of the guarantees
    stand."""
    x = shown.layout.x
    low = shown.layout.points[0]
    high = shown.layout.points[-1]
    somewhere = bool((columns["intervals"] > 0).any())
    if not somewhere:
        # 12 letters in an inch of the panel, which has 0.8 of its part of the figure
        nothing = fill(_nothing_stable(columns, members), int(12 * 0.8 * inches[0]))
        axes.text(0.5, 0.5, nothing, ha="center", va="center", transform=axes.transAxes)
    logarithmic = is_logarithmic(columns[x])
    if logarithmic:
        by_factors(axes.xaxis, low, high)
    elif somewhere and not shown.whose:
        end = _end_of_intervals(shown)
        if end < high:
            how.add("cut")
            high = end
    view = view_of(x, logarithmic, *inches, shown.by_factors)
    curves = member_curves(members, view, (low, high))
    points = 72 * inches[0] * 0.8  # a panel's width, of its part of the figure
    bars_of_members = _side_by_side(curves, points * view.closest(shown.layout.points))
    filled = len(members) == 1 and shown.whose != "spec"
    reached: list[float] = []
    bars_of: dict[str, Bars] = {}
    for member, curve, bars in zip(members, curves, bars_of_members, strict=True):
        region = region_of(curve, view)
        if member.at_values:
            bars_of[member.guarantee] = bars
        else:
            draw_region(axes, region, member.look, filled, len(members))
        draw_at_values(
            axes, region.bars, member.look, bars, shown.span if member.at_values else None
        )
        lines = [*region.certain, *region.doubtful]
        if lines and not filled:
            how.add("strokes")
        # Room above the largest value of a boundary.
        reached += [1.03 * y for line in lines for _, y in line]
        if region.bars:
            how.add("bars")
        if shown.felt:
            draw_felt(axes, region, member.look)
        # Without a stable loop nothing is open.
        if somewhere and member.proved and "fails_from" in member.rows:
            draw_for_all(axes, x, member.rows, shown.span, bars)
        elif member.at_values:
            draw_unknown_at_values(axes, _unknown_spans(curve, shown.view), shown.span, bars)
    # Bars at the first and the last value stay whole.
    if any(curve.open_at_ends for curve in curves):
        in_bars = sum(not curve.gaps for curve in curves)
        width = bars_of_members[0].width
        # Of the axis, beyond the bars at its ends.
        edge = max(0.03, (width + _APART) * in_bars / 2 / points)
        low, high = _with_room(low, high, edge, logarithmic)
    axes.set_xlim(low, high)
    return [y for y in reached if y > shown.view[1]], bars_of


def _end_of_intervals(shown: Shown) -> float:
    """Where the axis x ends: at its last value or, if much of it has nothing to show in any panel,
    a little after what there is."""
    columns = shown.columns
    values = np.asarray(shown.layout.points, dtype=float)
    if shown.layout.panels:
        panels = np.unique(columns[shown.layout.panels])
    else:
        panels = [np.nan]
    empty = (columns["intervals"] == 0) & ~incomplete(columns)
    own = [place[0] for place in shown.own_design(panels)]
    last = max([*columns[shown.layout.x][~empty], *own])
    beyond = values[values > last]
    if not beyond.size:
        return float(values[-1])
    end = beyond[0] + _SHOWN_OF_EMPTY * (beyond[0] - values[0])
    long = end <= values[-1] - _EMPTY * (values[-1] - values[0])
    return float(end if long else values[-1])


def _nothing_stable(columns: Columns, members: Sequence[Member]) -> str:
    """What a panel without stable intervals says."""
    best = max(members, key=lambda member: member.claim.status)
    if incomplete(columns).any():
        return nothing(best.claim, certain=False)
    return nothing(best.claim, certain=True) + " at the swept values"


def _unknown_spans(
    curve: PlaneCurve, view: tuple[float, float]
) -> list[tuple[float, float, float]]:
    """What is not known at the values of x, (x, from, to), as far as it is in the view."""
    spans_in_view = []
    for x, (_, spans) in curve.columns.items():
        for span in spans:
            low, high = np.clip(span, *view)
            spans_in_view.append((x, low, high))
    return spans_in_view


def _with_room(low: float, high: float, edge: float, logarithmic: bool) -> tuple[float, float]:
    """The ends of an axis with room beyond both; edge: its share of the axis."""
    if logarithmic:
        factor = (high / low) ** edge
        return low / factor, high * factor
    room = edge * (high - low)
    return low - room, high + room


def _label_along(shown: Shown) -> str:
    """The label of the axis of the values."""
    several = len(set(shown.columns["along"].tolist())) > 1
    units = unlike_units(shown.facts).get("high")
    if several:
        name = "stiffness of the wall"
        if units:
            return with_unit(name, printed(units))
        return name
    if units:
        return with_unit(symbol(shown.along), printed(units))
    return label(shown.along, shown.facts)


def _assumption(shown: Shown) -> str:
    """The note on controller, wall, delay and velocity, and on what the rows of each kind say."""
    if shown.whose == "spec":
        return assumption(shown.facts)
    said, _, _ = assumed(shown.facts).partition(":")  # usual engines follow
    kind = shown.facts.get("spec", {}).get("controller", {}).get("kind")
    note = f"{kind}, {said}" if kind and said else said
    return " ".join(filter(None, (f"{note}." if note else "", claimed(shown.facts))))


def _name_axes(shown: Shown, canvas: Any, how: set[str]) -> None:
    layout = shown.layout
    facts = shown.facts
    along = _label_along(shown)
    if layout.x is not None:
        beneath = label(layout.x, facts)
        upright = along
    else:
        beneath = along
        if layout.family and not layout.beside:
            upright = label(layout.family, facts)
        else:
            upright = ""
    marks = offered("marks")
    unmarked = marks.undrawn(facts, layout.x, shown.along) if marks else ""
    drawn = " ".join(said for word, said in _HOW.items() if word in how)
    below = " ".join(filter(None, (drawn, unmarked, _assumption(shown))))
    note_below(canvas, layout.left_out, below, axis=beneath)
    if upright:
        canvas.supylabel(upright, fontsize=8)
