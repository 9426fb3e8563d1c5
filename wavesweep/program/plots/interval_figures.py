"""The figure of stable intervals: regions over the plane of two axes, or bars; of a family, of several hands or specs."""

import logging
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.capabilities import modules
from wavesweep.program.analyses.plane_columns import PlaneCurve, incomplete, smooth_axes
from wavesweep.program.analyses.required_words import required_in_words
from wavesweep.program.columns import Columns, axes_of, joined, whose_column
from wavesweep.program.plots.figure_layout import MOST_BARS, best_of, best_row, lay_out, rows_with
from wavesweep.program.plots.interval_legend import BEST, LIMIT, LIMITS, OWN, draw_legends, entries_of, rows_of
from wavesweep.program.plots.labels import assumed, assumption, label, printed, symbol, valued, with_unit
from wavesweep.program.plots.member_panels import (
    HALF_BAR,
    Member,
    damping_of,
    draw_bars,
    member_curves,
    over_one_damping,
    specs_of,
)
from wavesweep.program.plots.plane_regions import Region, region_of
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
from wavesweep.program.plots.style import ONE_COLUMN, TWO_COLUMNS, figure, is_narrow, note_below, wide
from wavesweep.program.tables.columns import unlike_units

LOGGER = logging.getLogger("wavesweep.figure.panels")  # hears which panel of how many is drawn
_PANEL_HEIGHT = 2.3  # inches
_APART = 0.8  # points between bars of two members at a value of x
_FILL, _THIN, _THICK = 0.6, 0.8, 4.0  # of the distance between two values of x, bars at most; and their width in points
_PANEL_WIDTH = 0.8  # of its part of the figure
_ROOM = 1.03  # times the largest value of a boundary
_EDGE = 0.03  # of the axis, beyond the bars at its ends
_HOW = {  # how stable sets are drawn, in the notes below the figure
    "strokes": "Strokes point to the unstable side.",
    "between": "Lines are computed between swept values too.",
    "bars": "Bars hold at their value of {} alone.",
}


def zwidth(table: Columns | Blocks, facts: Mapping[str, Any]) -> Any:
    """Draw the stable intervals of a `zwidth` or `stability-region` table.

    A line or an area lies between two values of x only if the intervals between them were computed, see `plane_columns`. What
    is known at the values of the table alone, as what is guaranteed for hands or for [for_all], are bars at these values. A
    single region is filled. Several are outlined, with strokes to the unstable side, so that none hides the hole of another.
    Boundaries are dashed red if not certified, and slices that are only partly known are hatched outside of their intervals.
    One further axis is a family of lines, the next one gives panels through the best design.
    """
    blocks, axes, best, several = blocks_of(table), {}, {}, False
    for block in blocks():
        note_values(axes, block, "along")
        best, several = best_of([best, best_row(block)]), bool(whose_column(block))
    axes = {name: values[~np.isnan(values)].tolist() for name, values in axes.items() if name != "spec"}
    walls = [name for tables in specs_of(facts).values() if (name := damping_of(tables))]
    layout = lay_out(axes, best, several, [] if several else smooth_axes(axes, facts), walls)
    return _draw(Shown(_once(rows_where(blocks, layout.shows)), facts, layout, best))


def of_specs(table: Columns | Blocks, facts: Mapping[str, Any]) -> Any:
    """Draw a `zwidth-specs` table as `zwidth` draws one, a colour for each spec. The dampings of walls, which drawn loops name,
    are one axis."""
    return zwidth(over_one_damping(joined(table()) if callable(table) else table, facts), facts)


def _once(columns: Columns) -> Columns:
    """The rows without those that are there again, as an axis has a value twice."""
    names = dict.fromkeys([*axes_of(columns), *filter(None, [whose_column(columns)]), "interval"])
    labels = [np.unique(columns[name], return_inverse=True)[1].ravel() for name in names]
    rows = np.sort(np.unique(np.stack(labels, axis=1), axis=0, return_index=True)[1])
    return {name: column[rows] for name, column in columns.items()}


def _draw(shown: Shown) -> Any:
    """Draw all panels with their legends and notes."""
    layout, panels = shown.layout, shown.layout.panel_values or (np.nan,)
    across = _panels_in_a_row(len(panels), bars=layout.x is None)
    down = -(-len(panels) // across)
    usual = ONE_COLUMN if across == 1 else TWO_COLUMNS
    with figure(usual, _height(shown, across, down)) as canvas:
        grid = canvas.subplots(down, across, sharex=True, sharey=True, squeeze=False)
        reached, how = list(shown.view), set()
        for number, (axes, value) in enumerate(zip(grid.flat, panels, strict=False)):
            LOGGER.info("%d of %d", number, len(panels))
            reached += _draw_panel(shown, axes, value, (wide(usual) / across, canvas.get_figheight() / down), how)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        _scale_values(shown, grid, (min(reached), max(reached)))
        for number, axes in enumerate(grid.flat[: len(panels)]):
            axes.tick_params(labelbottom=number + across >= len(panels))
            mark_range(axes, shown.columns, bars=layout.x is None)
            for walls in shown.walls:
                walls.draw(axes)
        members, marks = entries_of(shown, panels, grid.flat[: len(panels)])
        # Beside the panels, if it is more than a row.
        legends_beside = across > 1 and down > 1 and not is_narrow() and rows_of(members + marks, wide(usual)) > 1
        legends = [] if legends_beside else [members, marks] if across == 1 else [members + marks]
        legend_height = 0.17 * sum(rows_of(entries, wide(usual)) for entries in legends)
        canvas.set_figheight(canvas.get_figheight() + legend_height)
        _name_axes(shown, canvas, how)
        draw_legends(canvas, grid, members, marks, legends_beside)
    return canvas


def _panels_in_a_row(number: int, *, bars: bool) -> int:
    if number == 1 or (bars and is_narrow()):  # whose names need the room
        return 1
    return 2 if number in (2, 4) or is_narrow() else 3


def _height(shown: Shown, across: int, down: int) -> float:
    """The height of all panels, in inches, with room for many bars."""
    height = 2.5 if across == down == 1 else _PANEL_HEIGHT * down
    if shown.layout.x is not None:
        return height
    bars = len(shown.layout.bars)
    if is_narrow():  # names of bars have two lines
        return max(height, down * (0.6 + 0.26 * bars))
    return height + 0.12 * down * max(0, bars - MOST_BARS)


def _scale_values(shown: Shown, grid: np.ndarray, view: tuple[float, float]) -> None:
    """Give the axis of the values, which all panels share, its scale and its ends."""
    bars = shown.layout.x is None
    if shown.by_factors:
        for axes in grid.flat:
            by_factors(axes.xaxis if bars else axes.yaxis, *view)
    (grid[0, 0].set_xlim if bars else grid[0, 0].set_ylim)(view)


def _draw_panel(shown: Shown, axes: Any, panel: float, inches: tuple[float, float], how: set[str]) -> list[float]:
    """Draw a panel, and return how far boundaries go between the values of the table, with some room.

    how: is added what of _HOW occurs.
    """
    layout, reached = shown.layout, []
    columns = rows_with(shown.columns, {layout.panels: panel} if layout.panels else {})
    members, bars_of = shown.members(columns), {}
    if layout.x is None:
        draw_bars(axes, members)
    else:
        reached, bars_of = _draw_plane(shown, axes, columns, members, inches, how)
    if layout.panels is not None:
        axes.set_title(valued(layout.panels, panel, shown.facts))
    if shown.best and (layout.panels is None or shown.best[layout.panels] == panel):
        _mark_best(shown, axes, members, bars_of)
    for place in shown.own_design([panel]):
        axes.plot(*place, **OWN)
    for name, height in shown.limits_of_walls().items():
        axes.axhline(height, **LIMIT, linestyle=LIMITS[name][1])
    if layout.x is None:
        for place, member in enumerate(members):
            if member.proved:
                draw_for_all_bar(axes, place, HALF_BAR, member.rows, shown.span)
    return reached


def _mark_best(shown: Shown, axes: Any, members: Sequence[Member], bars_of: Mapping[str, Bars]) -> None:
    """Draw the mark of the best design, on the bar of its guarantee if it is one of these."""
    at = bars_of.get(shown.best.get(shown.whose, ""))
    axes.plot(*shown.place(shown.best, members), **BEST, **({"transform": at.place(axes)} if at else {}))


def _draw_plane(
    shown: Shown, axes: Any, columns: Columns, members: Sequence[Member], inches: tuple[float, float], how: set[str]
) -> tuple[list[float], dict[str, Bars]]:
    """Draw a panel over x; gives how far boundaries go, and where the bars of the guarantees stand."""
    reached: list[float] = []
    bars_of: dict[str, Bars] = {}
    x, (low, high) = shown.layout.x, (shown.layout.points[0], shown.layout.points[-1])
    somewhere = bool((columns["intervals"] > 0).any())
    if not somewhere:
        nothing = "nothing known to be stable" if incomplete(columns).any() else "nowhere stable at the swept values"
        axes.text(0.5, 0.5, nothing, ha="center", va="center", transform=axes.transAxes)
    logarithmic = is_logarithmic(columns[x])
    if logarithmic:
        by_factors(axes.xaxis, low, high)
    view = view_of(x, logarithmic, *inches, shown.by_factors)
    curves = member_curves(members, view, (low, high))
    single = [not curve.gaps for curve in curves]  # of which there are bars alone
    points = 72 * inches[0] * _PANEL_WIDTH
    width = float(np.clip(_FILL * points * view.closest(shown.layout.points) / max(sum(single), 1), _THIN, _THICK))
    for number, (member, curve) in enumerate(zip(members, curves, strict=True)):
        region = region_of(curve, view)
        at = Bars((width + _APART) * (sum(single[:number]) - (sum(single) - 1) / 2) * single[number], width)
        filled = len(members) == 1 and shown.whose != "spec"
        if member.at_values:
            bars_of[member.guarantee] = at
        else:
            draw_region(axes, region, member.look, filled, len(members))
        draw_at_values(axes, region.bars, member.look, at, shown.span if member.at_values else None)
        outline = [*region.certain, *region.doubtful]
        reached += [_ROOM * y for line in outline for _, y in line]
        how |= _how_drawn(region, filled)
        if shown.felt:
            draw_felt(axes, region, member.look)
        if member.proved and somewhere:  # without a stable loop nothing is open
            draw_for_all(axes, x, member.rows, shown.span, at)
        elif member.at_values:
            draw_unknown_at_values(axes, _unknown_spans(curve, shown.view), shown.span, at)
    if any(curve.open_at_ends for curve in curves):  # bars at the first and the last value stay whole
        low, high = _with_room(low, high, max(_EDGE, (width + _APART) * sum(single) / 2 / points), logarithmic)
    axes.set_xlim(low, high)
    return [y for y in reached if y > shown.view[1]], bars_of


def _how_drawn(region: Region, filled: bool) -> set[str]:
    """What of _HOW occurs in a region."""
    outlined = bool(region.certain or region.doubtful)
    occurs = {"strokes": outlined and not filled, "between": outlined, "bars": bool(region.bars)}
    return {word for word in occurs if occurs[word]}


def _unknown_spans(curve: PlaneCurve, view: tuple[float, float]) -> list[tuple[float, float, float]]:
    """What is not known at the values of x, (x, from, to), as far as it is in the view."""
    return [(x, *np.clip(span, *view)) for x, (_, spans) in curve.columns.items() for span in spans]


def _with_room(low: float, high: float, edge: float, logarithmic: bool) -> tuple[float, float]:
    """The ends of an axis with room beyond both; edge: its share of the axis."""
    if logarithmic:
        factor = (high / low) ** edge
        return low / factor, high * factor
    room = edge * (high - low)
    return low - room, high + room


def _label_along(shown: Shown) -> str:
    """The label of the axis of the values."""
    names = dict.fromkeys(shown.columns["along"].tolist())
    along = "stiffness of the wall" if len(names) > 1 else label(shown.along, shown.facts)
    if units := unlike_units(shown.facts).get("high"):
        along = with_unit(symbol(shown.along) if len(names) == 1 else along, printed(units))
    return along


def _assumption(shown: Shown) -> str:
    """The note on controller, wall, delay and velocity."""
    if shown.whose == "spec":
        return assumption(shown.facts)
    said, _, _ = assumed(shown.facts).partition(":")  # usual engines follow
    kind = shown.facts.get("spec", {}).get("controller", {}).get("kind")
    return f"{kind}, {said}" if kind and said else said


def _name_axes(shown: Shown, canvas: Any, how: set[str]) -> None:
    layout, facts, bars = shown.layout, shown.facts, shown.layout.x is None
    along = _label_along(shown)
    required = f"stable here: {required_in_words(facts['require'])}" if "require" in facts else ""
    unmarked = [module.undrawn(facts, layout.x, shown.along) for module in modules("marks")]
    drawn = " ".join(said.format(symbol(layout.x)) for word, said in _HOW.items() if word in how)
    along_x = along if bars else label(layout.x, facts)
    note_below(canvas, required, layout.left_out, drawn, *unmarked, _assumption(shown), axis=along_x)
    across = (label(layout.family, facts) if layout.family and not layout.beside else "") if bars else along
    if across:
        canvas.supylabel(across, fontsize=8)
