"""The figure of stable intervals: regions over the plane of two axes, or bars; of a family, of several hands or specs."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from wavesweep.columns import Columns
from wavesweep.plots.layout import MOST_BARS, Layout, axes_of, best_of, best_row, is_logarithmic, lay_out, rows_with
from wavesweep.plots.measured import coloured, draw_walls, highest, undrawn, wall_handles, walls_by_kind, walls_in_plane
from wavesweep.plots.members import (
    HALF_BAR,
    HANDS,
    Member,
    damping_of,
    draw_bars,
    draw_dots,
    extent_of,
    member_curves,
    members_of,
    over_one_damping,
    specs_of,
    whose_of,
)
from wavesweep.plots.regions import (
    FELT_LINE,
    NOT_KNOWN,
    REFUTED,
    area_handle,
    draw_felt,
    draw_for_all,
    draw_for_all_bar,
    draw_region,
    felt_differs,
    for_all_handles,
    handles_of,
    mark_range,
    range_end,
    range_handle,
    view_of,
)
from wavesweep.plots.sampling import Kept
from wavesweep.plots.style import (
    DOUBTFUL,
    ONE_COLUMN,
    TWO_COLUMNS,
    UNKNOWN,
    UNPROVED,
    assumed,
    by_factors,
    distinct_colour,
    drawn_into,
    figure,
    fitting,
    is_narrow,
    label,
    note_below,
    printed,
    symbol,
    unit,
    valued,
    wide,
    with_unit,
)
from wavesweep.spec.require import words_of
from wavesweep.tables.columns import swept_range, unlike_units
from wavesweep.tables.regions import incomplete, region_of, smooth_axes, spec_of

_PANEL_HEIGHT = 2.3  # inches
_BESIDE = 0.5  # inches, of a figure of one column that its panel leaves to numbers
_SMALL = 7  # points, of a legend above a figure of one column
_APART = 1.6  # points between thin bars of two members
_SQUEEZED, _ROOM = 0.25, 1.15  # of the largest limit, and a factor beyond the ends of a scale of factors
_EDGE = 0.03  # of the axis, beyond the bars at its ends
_BEST = {"marker": "*", "color": "black", "markersize": 6, "zorder": 5, "linestyle": "none", "clip_on": False}
_OWN = _BEST | {"marker": "x", "markeredgewidth": 1.4}
_LIMIT = {"color": "0.35", "linewidth": 0.8}
_LIMITS = {
    "holds_to": ("friction holds an encoder step, $2 f_c/D$", (0, (6, 1, 1, 1, 1, 1))),
    "passive_to": ("passive by damping, without $B_{VE}$", (0, (1, 2))),
}


def zwidth(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw the stable intervals of a `zwidth` or `stability-region` table.

    The intervals between two values of x are those of `tables.regions`; if these cannot be computed, thin bars show the values
    of the table. A single region is filled, and so is what is proved under [for_all]. Several are outlined, with strokes to the
    unstable side, so that none hides the hole of another. Boundaries are dashed red if not certified, and slices that are only
    partly known are hatched outside of their intervals. One further axis is a family of lines, the next one gives panels
    through the best design. What is guaranteed for hands or for [for_all] is known at the swept values, which have dots.
    """
    picture = Picture(axes_of(columns), lambda: (columns,))
    picture.add(columns)
    return picture.draw(facts)


def compare(
    columns: Columns,
    facts: Mapping[str, Any],
    responses: Columns | None = None,
    of_responses: Mapping[str, Any] | None = None,
) -> Any:
    """Draw a `compare` table as `zwidth` draws one, a colour for each spec.

    responses, of_responses: columns and facts of its `compare-bode`, which is drawn below as `bode` draws it. The dampings of
    walls, which drawn loops name, are one axis.
    """
    columns = over_one_damping(columns, facts)
    if responses is None:
        return zwidth(columns, facts)
    from wavesweep.plots.responses import bode

    with figure(TWO_COLUMNS, 11.5 if is_narrow() else 7.4) as canvas:
        above, below = canvas.subfigures(2, 1, height_ratios=[2, 4] if is_narrow() else [3, 4])
        drawn_into(above, partial(zwidth, columns, facts))
        drawn_into(below, partial(bode, responses, of_responses or facts))
    return canvas


class Picture(Kept):
    """The figure of a table that need not fit into memory: `add` each of its blocks, then `draw`.

    axes: name -> values of the table's leading columns. blocks: gives all blocks again, if they are too many to be kept.
    """

    def __init__(self, axes: Mapping[str, Sequence[float]], blocks: Callable[[], Iterable[Columns]]) -> None:
        super().__init__(blocks)
        self._axes, self._best, self._several = axes, {}, False

    def add(self, columns: Columns) -> None:
        """Look for the best design in a block (its columns by name), and keep it if it fits."""
        super().add(columns)
        self._best, self._several = best_of([self._best, best_row(columns)]), bool(whose_of(columns))

    def draw(self, facts: Mapping[str, Any]) -> Any:
        """Draw the figure."""
        walls = [name for tables in specs_of(facts).values() if (name := damping_of(tables))]
        smooth = [] if self._several else smooth_axes(self._axes, facts)
        layout = lay_out(self._axes, self._best, self._several, smooth, walls)
        return _Intervals(_once(self.where(lambda columns, _: layout.shows(columns))), facts, layout, self._best).draw()


def _once(columns: Columns) -> Columns:
    """The rows without those that are there again, as an axis has a value twice."""
    names = [*axes_of(columns), *filter(None, [whose_of(columns)])]
    labels = [np.unique(columns[name], return_inverse=True)[1].ravel() for name in (*names, "interval")]
    rows = np.sort(np.unique(np.stack(labels, axis=1), axis=0, return_index=True)[1])
    return {name: column[rows] for name, column in columns.items()}


class _Intervals:
    """The figure of the rows of a table, with the roles of its axes and the best design."""

    def __init__(self, columns: Columns, facts: Mapping[str, Any], layout: Layout, best: Mapping[str, Any]) -> None:
        self.columns, self.facts, self.layout = columns, facts, layout
        self.along, self.whose = str(columns["along"][0]), whose_of(columns)
        self.best = {} if self.whose == "spec" else best  # each spec has its own
        self.spec = spec_of(facts)
        swept = np.array([swept_range({"spec": tables}, self.along) for tables in specs_of(facts).values()])
        self.swept = float(swept[:, 0].min()), float(swept[:, 1].max())
        self.by_factors, self.view = self._limits()
        self.walls = self._measured_walls()
        tops = [highest(walls, self.swept[1]) for walls, _ in self.walls]
        self.view = self.view[0], max(self.view[1], _ROOM * max(tops, default=0.0))
        self.span = max(self.view[0], self.swept[0]), min(self.view[1], self.swept[1])
        self.felt = self._shows_felt()

    def draw(self) -> Any:
        """Draw all panels with their legends and notes."""
        layout, panels = self.layout, self.layout.panel_values or (np.nan,)
        across = 1 if len(panels) == 1 else 2 if len(panels) in (2, 4) or is_narrow() else 3
        beside = across > 1 and not is_narrow()  # the legend
        down = -(-len(panels) // across)
        usual = ONE_COLUMN if across == 1 else TWO_COLUMNS
        members, marks = self._entries(panels)
        more = 0.12 * down * max(0, len(layout.bars) - MOST_BARS) if layout.x is None else 0.0
        more += 0.0 if beside else 0.17 * (_rows(members) + _rows(marks))
        height = (2.5 if across == 1 else _PANEL_HEIGHT * down) + more
        with figure(usual, height) as canvas:
            grid = canvas.subplots(down, across, sharex=True, sharey=True, squeeze=False)
            for axes, value in zip(grid.flat, panels, strict=False):
                self._draw_panel(axes, value, (wide(usual) / across, canvas.get_figheight() / down))
            for axes in grid.flat[len(panels) :]:
                axes.set_visible(False)
            for axes in grid.flat if layout.x is not None and self.by_factors else ():
                by_factors(axes.yaxis, *self.view)
            (grid[0, 0].set_xlim if layout.x is None else grid[0, 0].set_ylim)(self.view)
            for axes in grid.flat[: len(panels)]:
                mark_range(axes, self.columns, bars=layout.x is None)
                for walls, colour in self.walls:
                    draw_walls(axes, walls, colour)
            self._name_axes(canvas)
            _draw_legends(canvas, grid, members, marks, beside)
        return canvas

    def _draw_panel(self, axes: Any, panel: float, inches: tuple[float, float]) -> None:
        layout = self.layout
        columns = rows_with(self.columns, {layout.panels: panel} if layout.panels else {})
        members = self.members(columns)
        if layout.x is None:
            draw_bars(axes, members)
        else:
            self._draw_plane(axes, columns, members, inches)
        if layout.panels is not None:
            axes.set_title(valued(layout.panels, panel, self.facts))
        if self.best and (layout.panels is None or self.best[layout.panels] == panel):
            axes.plot(*self._place(self.best, members), **_BEST)
        for place in self._own_places([panel]):
            axes.plot(*place, **_OWN)
        for name, height in self._limits_of_walls().items():
            axes.axhline(height, **_LIMIT, linestyle=_LIMITS[name][1])
        for place, member in enumerate(members) if layout.x is None else ():
            if member.guarantee == "for_all":
                draw_for_all_bar(axes, place, HALF_BAR, member.rows, self.span)

    def _draw_plane(self, axes: Any, columns: Columns, members: Sequence[Member], inches: tuple[float, float]) -> None:
        x, (low, high) = self.layout.x, (self.layout.points[0], self.layout.points[-1])
        if not (columns["intervals"] > 0).any():
            nothing = "nothing known to be stable" if incomplete(columns).any() else "nowhere stable at the swept values"
            axes.text(0.5, 0.5, nothing, ha="center", va="center", transform=axes.transAxes)
        logarithmic = is_logarithmic(columns[x])
        if logarithmic:
            by_factors(axes.xaxis, low, high)
        view = view_of(x, logarithmic, *inches, self.by_factors)
        curves = member_curves(members, view, (low, high))
        for number, (member, curve) in enumerate(zip(members, curves, strict=True)):
            region, shift = region_of(curve, view), _APART * (number - (len(members) - 1) / 2)
            region = replace(region, unknown=[]) if member.joined else region  # nothing is computed between its dots
            filled = member.guarantee == "for_all" or (len(members) == 1 and self.whose != "spec")
            draw_region(axes, region, member.look, filled, shift, len(members))
            if self.felt:
                draw_felt(axes, region, member.look)
            if member.guarantee == "for_all":
                draw_for_all(axes, x, member.rows, self.span)
            if member.joined:
                draw_dots(axes, x, member, self.span)
        if any(curve.open_at_ends for curve in curves):  # bars at the first and the last value stay whole
            more, factor = _EDGE * (high - low), (high / low) ** _EDGE if logarithmic else 1.0
            low, high = (low / factor, high * factor) if logarithmic else (low - more, high + more)
        axes.set_xlim(low, high)

    def members(self, columns: Columns) -> list[Member]:
        """The members of a panel, whose rows these are."""
        specs = dict.fromkeys(self.columns["spec"].tolist()) if self.whose == "spec" else ()
        return members_of(columns, self.facts, self.layout.bars, list(specs))

    def _place(self, row: Mapping[str, Any], members: Sequence[Member]) -> tuple[float, float]:
        """The coordinates of the high end of a row."""
        if self.layout.x is not None:
            return row[self.layout.x], row["high"]
        if self.whose:
            return row["high"], [member.guarantee for member in members].index(row[self.whose])
        bar = {name: row[name] for name in self.layout.bars[0]}
        return row["high"], self.layout.bars.index(bar) if bar in self.layout.bars else np.nan

    def _own_places(self, panels: Sequence[float]) -> list[tuple[float, float]]:
        """The spec's own design in the plane of the figure, or on its bar, if one of these panels shows it."""
        layout, spec = self.layout, self.spec
        if spec is None or self.whose == "spec" or (layout.x is None and self.whose):  # bars of hands are not designs
            return []
        bars = layout.bars[0] if layout.x is None else ()
        names = (self.along, layout.x, layout.panels, layout.family, *bars, *layout.fixed)
        own = {name: spec.own(spec.names.find(name).path) for name in names if name}
        if None in own.values():  # an edge of a filter's band, from which its order and cutoff follow
            return []
        shown = {name: (value,) for name, value in layout.fixed.items()}
        shown |= {layout.panels: panels, layout.family: layout.members}
        there = all(own[name] in values for name, values in shown.items() if name)
        there = there and all(low <= own[self.along] <= high for low, high in (self.swept, self.view))
        bar = {name: own[name] for name in bars}
        if not there or (layout.x is None and bar not in layout.bars):
            return []
        if layout.x is None:
            return [(own[self.along], layout.bars.index(bar))]
        return [(own[layout.x], own[self.along])] if layout.points[0] <= own[layout.x] <= layout.points[-1] else []

    def _limits(self) -> tuple[bool, tuple[float, float]]:
        """Whether a scale of factors shows the limits, most of which an even one would squeeze into its lowest part, and the
        ends of the axis, which show every interval of the table, or the swept range if there is none; all panels share them.

        There is room beyond the largest value, and below the least one as far as it is swept, or if the swept range ends there.
        Space that is not swept is not shown otherwise: it would pass for unstable.
        """
        columns, swept = self.columns, self.swept
        ends = np.concatenate([columns["low"], columns["high"]])
        real = ends[~np.isnan(np.concatenate([columns["low_omega"], columns["high_omega"]]))]
        factors = bool(np.isfinite(swept[0]) and swept[0] > 0 and real.size and np.median(real) < _SQUEEZED * real.max())
        top = float(np.nanmax(np.concatenate([columns["high"], columns.get("fails_from", [])]), initial=0.0))
        bottom = float(np.nanmin(columns["low"], initial=swept[0] if 0 < swept[0] < top else 0.0))
        if top <= bottom:
            return factors, swept if np.isfinite(swept).all() else (bottom, 1.0)
        if factors:
            return factors, (max(swept[0], float(np.nanmin(columns["low"]))) / _ROOM, top * _ROOM)
        room, lowest = 0.06 * (top - bottom), range_end(columns, "low")
        if lowest is not None:
            bottom = min(bottom, lowest - room if lowest <= 0 else max(lowest - room, 0.0))
        elif 0 < swept[0] < top:
            bottom = swept[0]
        elif swept[0] < bottom:  # stability ends there, and what is below is unstable
            bottom = max(swept[0], bottom - room)
        return factors, (bottom, top + room)

    def _measured_walls(self) -> list[tuple[Mapping[bool | None, np.ndarray], Any]]:
        """The walls that were measured, with the colour of those of each spec."""
        if self.whose != "spec":
            walls = walls_in_plane(self.facts, self.layout.x, self.along)
            return [(walls, "black")] if walls else []
        if self.layout.x not in [damping_of(tables) or "B_VE" for tables in specs_of(self.facts).values()]:
            return []
        colours = coloured(self.facts, "z_width", {name: distinct_colour(at) for at, name in enumerate(specs_of(self.facts))})
        return [(walls_by_kind(self.facts, spec), colour) for spec, colour in colours.items()]

    def _shows_felt(self) -> bool:
        """Whether the hand feels other stiffnesses at the limits, some of which the panels show."""
        walls = self.layout.x == "B_VE" and self.along == "K_VE" and self.whose in ("", "spec")
        if not walls or not felt_differs(self.columns):
            return False
        felt = self.columns["felt_high"]
        return bool(((felt >= self.view[0]) & (felt <= self.view[1])).any())

    def _limits_of_walls(self) -> dict[str, float]:
        """Stiffnesses in the figure beyond which walls that are felt as they are may buzz, see `limits_of_walls`."""
        felt_as_it_is = self.layout.x == "B_VE" and not felt_differs(self.columns)
        limits = self.facts.get("limits_of_walls", {}) if felt_as_it_is else {}
        return {name: limit for name, limit in limits.items() if self.view[0] < limit < self.view[1]}

    def _name_axes(self, canvas: Any) -> None:
        layout, facts, bars = self.layout, self.facts, self.layout.x is None
        names = dict.fromkeys(self.columns["along"].tolist())
        along = label(self.along, facts)
        if len(names) > 1:
            along = "stiffness of the wall"
        if units := unlike_units(facts).get("high"):
            along = with_unit(symbol(self.along) if len(names) == 1 else along, printed(units))
        required = f"stable here: {words_of(facts['require'])}" if "require" in facts else ""
        unmarked = undrawn(facts, layout.x, self.along)
        note_below(canvas, required, layout.left_out, unmarked, self._assumed(), axis=along if bars else label(layout.x, facts))
        across = (label(layout.family, facts) if layout.family and not layout.beside else "") if bars else along
        if across:
            canvas.supylabel(across, fontsize=8)

    def _assumed(self) -> str:
        """The controller, its wall, delay and velocity, as far as the figure has a single one of each."""
        said, _, _ = assumed(self.facts).partition(":")  # what engines usually do follows
        kind = self.facts.get("spec", {}).get("controller", {}).get("kind")
        return f"{kind}, {said}" if said and kind and self.whose != "spec" else ""

    def _entries(self, panels: Sequence[float]) -> tuple[list[Any], list[Any]]:
        """The entries of the legend: the members of a family, the hands or the specs, and the marks."""
        members, layout = self.members(self.columns), self.layout
        bottom, entries = np.nanmin(self.columns["low"], initial=np.inf), []
        if self.whose or (layout.x is not None and layout.family is not None):
            names = [member.name for member in members]
            if not self.whose:  # the first has name and unit, the others the value
                values = layout.members
                names = [valued(layout.family, values[0], self.facts), *(f"{value:.6g}" for value in values[1:])]
            names = [
                name + extent_of(member.rows, bottom) + " (at the dots)" * (member.joined and layout.x is not None)
                for name, member in zip(names, members, strict=True)
            ]
            entries = handles_of(names, [member.look for member in members])
        if members and members[-1].guarantee == "for_all":
            filled = layout.x is not None and members[-1].rows["intervals"].any()
            entries[-1] = area_handle(members[-1].look, entries[-1].get_label()) if filled else entries[-1]
            entries += for_all_handles(members[-1].rows, layout.x is None)
        return entries, self._marks(members, panels)

    def _marks(self, members: Sequence[Member], panels: Sequence[float]) -> list[Any]:
        """The entries of the legend for single points and for lines that no member has alone."""
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        plane, certain = self.layout.x is not None, all(member.rows["certified"].all() for member in members)
        handles = []
        if plane and self.felt:
            alone = HANDS["free"][0].colour if len(members) == 1 else "0.3"
            handles.append(Line2D([], [], color=alone, linestyle=FELT_LINE, linewidth=0.8, label="stiffness felt at the limit"))
        if self.best:
            handles.append(Line2D([], [], **_BEST, label=self._best_in_words("" if certain else " certified")))
        if self._own_places(panels):
            handles.append(Line2D([], [], **_OWN, label="nominal design"))
        if not certain:
            dashed = {"linestyle": "--", "label": "not certified"}
            dotted = Patch(**UNPROVED | {"linewidth": 1.2}, edgecolor=DOUBTFUL, **dashed)
            handles.append(
                dotted if plane and len(members) == 1 and not self.whose else Line2D([], [], color=DOUBTFUL, **dashed)
            )
        if range_end(self.columns, "low") is not None or range_end(self.columns, "high") is not None:
            handles.append(range_handle())
        limits = [_LIMITS[name] for name in self._limits_of_walls()]
        handles += [Line2D([], [], **_LIMIT, linestyle=line, label=said) for said, line in limits]
        if self.walls:
            kinds = dict.fromkeys(kind for walls, _ in self.walls for kind in walls)
            walls = {kind: np.hstack([each[kind] for each, _ in self.walls if kind in each]) for kind in kinds}
            colour = self.walls[0][1] if len(self.walls) == 1 else "0.4"
            handles += wall_handles(walls, (self.layout.points[0], self.layout.points[-1]), self.view, colour)
        return handles

    def _best_in_words(self, sure: str) -> str:
        """The largest value and, of a wall, the stiffness felt; sure: what to say of it if others are in doubt."""
        best, facts = self.best, self.facts
        sure = sure if best["certified"] else ""
        title = "largest proved for all" if best.get("guarantee") == "for_all" else "largest"
        over = "over " if np.isnan(best["high_omega"]) and best.get("guarantee") != "for_all" else ""
        felt = best.get("felt_high", np.nan)
        if self.along != "K_VE" or not abs(felt - best["high"]) > 0.005 * best["high"]:
            start = f", from {best['low']:.5g}" if best.get("interval", 0) > 0 else ""  # above a hole, and perhaps thin
            return f"{title}{sure}: {over}{best['high']:.5g} {unit(self.along, facts)}".rstrip() + start
        title = title.replace("largest", "stiffest felt") + (sure and ",") + sure
        return f"{title}: {felt:.4g} N/m at rest,\nof a wall of {over}{best['high']:.5g} N/m"


def _draw_legends(canvas: Any, grid: Any, members: list[Any], marks: list[Any], beside: bool) -> None:
    """The members above the only panel, and the marks above these; or all beside several panels, or above them."""
    from matplotlib.patches import Patch

    named = any(each.get_label() in (NOT_KNOWN, REFUTED) for each in members)  # what is narrow needs no entry
    if not named and any(patch.get_hatch() == UNKNOWN["hatch"] for each in canvas.axes for patch in each.patches):
        marks = [*marks, Patch(**UNKNOWN, label="not known outside the intervals")]
    if beside and members + marks:
        canvas.legend(handles=members + marks, loc="outside right upper", handlelength=2.5)
        return
    if grid.size > 1:
        members, marks = [], members + marks
    above = {"columnspacing": 0.8, "handlelength": 2.5, "handletextpad": 0.5, "fontsize": _SMALL}
    if members:
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "borderaxespad": 0.2}
        grid[0, 0].legend(handles=members, ncols=_in_a_row(members), **above, **place)
    if marks:
        canvas.legend(handles=marks, loc="outside upper center", ncols=_in_a_row(marks), **above)


def _in_a_row(entries: Sequence[Any]) -> int:
    """How many entries are side by side above a figure of one column."""
    return fitting([entry.get_label() for entry in entries], wide(ONE_COLUMN) - _BESIDE, _SMALL)


def _rows(entries: Sequence[Any]) -> int:
    return -(-len(entries) // _in_a_row(entries)) + max((entry.get_label().count("\n") for entry in entries), default=0)
