"""The figure of stable intervals: regions over the plane of two axes, or bars; for one loop, or for several hands."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from textwrap import wrap
from typing import Any

import numpy as np

from wavesweep.columns import Columns
from wavesweep.plots.chosen import Kept
from wavesweep.plots.layout import MOST_BARS, Layout, axes_of, best_of, best_row, is_logarithmic, lay_out
from wavesweep.plots.measured import draw_walls, highest, undrawn, wall_handles, walls_in_plane
from wavesweep.plots.planes import (
    FELT_LINE,
    draw_felt,
    draw_region,
    felt_differs,
    handles_of,
    mark_range,
    range_end,
    range_handle,
    view_of,
)
from wavesweep.plots.proofs import NOT_KNOWN, REFUTED, draw_at_places, draw_beside_bar, for_all_handles
from wavesweep.plots.refine import Curve, curves_of, smooth_axes, spec_of
from wavesweep.plots.style import (
    DOUBTFUL,
    ONE_COLUMN,
    TWO_COLUMNS,
    UNKNOWN,
    UNPROVED,
    Look,
    assumed,
    by_factors,
    family_looks,
    figure,
    incomplete,
    label,
    unit,
    valued,
    wide,
)
from wavesweep.spec.require import words_of
from wavesweep.tables.columns import swept_range
from wavesweep.tables.interval_tally import whose_column

_PANEL_HEIGHT = 2.3  # inches
_LETTERS_PER_INCH = 16
_APART = 1.6  # points between thin bars of two members
_SQUEEZED, _ROOM = 0.25, 1.15  # of the largest limit, and a factor beyond the ends of a scale of factors
_WIDEST = 52  # letters of an entry of the legend
_HALF_BAR = 0.32  # of the distance between two bars

# From the one that promises least to the one that promises most; the looks stay the same whichever are there.
HANDS = {
    "free": (Look("#0072B2", "-"), "free device"),
    "operator": (Look("#56B4E9", (0, (7, 1.5))), "operator"),
    "box": (Look("#D55E00", (0, (5, 1.2, 1, 1.2))), "hands of the box"),
    "passive": (Look("#009E73", (0, (3, 1))), "every passive hand"),
    "port": (Look("#CC79A7", (0, (1.5, 0.8))), "passive port"),
    "spec": (Look("#0072B2", "-"), "the spec's own numbers"),
    "for_all": (Look("#D55E00", (0, (5, 1.2, 1, 1.2))), "proved for all"),
}


def zwidth(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw the stable intervals of a `zwidth` or `stability-region` table.

    The intervals between two values of x are computed for the figure, see `refine`; if that is not possible, thin bars show
    the values of the table. A single region is filled. Several are outlined, with strokes to the unstable side, so that none
    hides the hole of another. Boundaries are dashed red if not certified, and slices that are only partly known are hatched
    outside of their intervals. One further axis is a family of lines, the next one gives panels through the best design.
    """
    picture = Picture(axes_of(columns), lambda: (columns,))
    picture.add(columns)
    return picture.draw(facts)


class Picture(Kept):
    """The figure of a table that need not fit into memory: `add` each of its blocks, then `draw`.

    axes: name -> values of the table's leading columns. blocks: gives all blocks again, if they are too many to be kept.
    """

    def __init__(self, axes: Mapping[str, Sequence[float]], blocks: Callable[[], Iterable[Columns]]) -> None:
        super().__init__(blocks)
        self._axes, self._best, self._hands = axes, {}, False

    def add(self, columns: Columns) -> None:
        """Look for the best design in a block (its columns by name), and keep it if it fits."""
        super().add(columns)
        self._best, self._hands = best_of([self._best, best_row(columns)]), bool(whose_column(columns))

    def draw(self, facts: Mapping[str, Any]) -> Any:
        """Draw the figure."""
        layout = lay_out(self._axes, self._best, self._hands, smooth_axes(self._axes, facts))
        return _draw(_once(self.where(lambda columns, _: layout.shows(columns))), facts, layout, self._best)


def _once(columns: Columns) -> Columns:
    """The rows without those that are there again, as an axis has a value twice."""
    names = [*list(columns)[: list(columns).index("intervals")], *filter(None, [whose_column(columns)])]
    labels = [np.unique(columns[name], return_inverse=True)[1].ravel() for name in (*names, "interval")]
    rows = np.sort(np.unique(np.stack(labels, axis=1), axis=0, return_index=True)[1])
    return {name: column[rows] for name, column in columns.items()}


def _draw(columns: Columns, facts: Mapping[str, Any], layout: Layout, best: Mapping[str, Any]) -> Any:
    panels = layout.panel_values or (np.nan,)
    across = 1 if len(panels) == 1 else 2 if len(panels) in (2, 4) else 3
    down = -(-len(panels) // across)
    width = wide(ONE_COLUMN if across == 1 else TWO_COLUMNS)
    view, swept = _view(columns, facts), swept_range(facts, str(columns["along"][0]))
    walls = walls_in_plane(facts, layout.x, str(columns["along"][0]))
    view = view[0], max(view[1], _ROOM * highest(walls, swept[1]))
    span = max(view[0], swept[0]), min(view[1], swept[1])
    own = partial(_own_points, facts, str(columns["along"][0]), layout, view)
    members, marks = _entries(columns, facts, layout, best, own(panels))
    limits = _limits_of_walls(columns, facts, layout, view)
    marks += [_limit_handle(name) for name in limits]
    marks += wall_handles(walls, (layout.points[0], layout.points[-1]), view) if walls else []
    more = 0.12 * down * max(0, len(layout.bars) - MOST_BARS) if layout.x is None else 0.0
    more += 0.17 * (_rows(members) + _rows(marks)) if across == 1 else 0.0  # otherwise it is beside the panels
    height = (2.5 if across == 1 else _PANEL_HEIGHT * down) + more
    with figure(width, height) as canvas:
        grid = canvas.subplots(down, across, sharex=True, sharey=True, squeeze=False)
        for axes, value in zip(grid.flat, panels, strict=False):
            rows = _rows_where(columns, layout.panels, value)
            _draw_panel(axes, rows, facts, layout, (width / across, height / down), span)
            if layout.panels is not None:
                axes.set_title(valued(layout.panels, value, facts))
            _mark_best(axes, columns, layout, best, value)
            for x, y in zip(*own([value]), strict=True):
                axes.plot(x, y, **_OWN)
            for name, height in limits.items():
                axes.axhline(height, **_LIMIT, linestyle=_LIMITS[name][1])
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        if layout.x is not None and _by_factors_upwards(columns, facts):
            for axes in grid.flat:
                by_factors(axes.yaxis, *view)
        (grid[0, 0].set_xlim if layout.x is None else grid[0, 0].set_ylim)(view)
        for axes in grid.flat[: len(panels)]:
            mark_range(axes, columns, bars=layout.x is None)
            draw_walls(axes, walls)
        _name_axes(canvas, columns, layout, facts)
        _draw_legends(canvas, grid[0, 0], members, marks, beside=across > 1)
    return canvas


def _draw_legends(canvas: Any, axes: Any, members: list[Any], marks: list[Any], beside: bool) -> None:
    """The members above the only panel, and the marks above these; or all beside the panels."""
    from matplotlib.patches import Patch

    named = any(each.get_label() in (NOT_KNOWN, REFUTED) for each in members)  # what is narrow needs no entry
    if not named and any(patch.get_hatch() == UNKNOWN["hatch"] for each in canvas.axes for patch in each.patches):
        marks = [*marks, Patch(**UNKNOWN, label="not known outside the intervals")]
    if beside and members + marks:
        canvas.legend(handles=members + marks, loc="outside right upper", handlelength=2.5)
        return
    above = {"columnspacing": 0.8, "handlelength": 2.5, "handletextpad": 0.5, "fontsize": _SMALL}
    if members:
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "borderaxespad": 0.2}
        axes.legend(handles=members, ncols=_in_a_row(members), **above, **place)
    if marks:
        canvas.legend(handles=marks, loc="outside upper center", ncols=_in_a_row(marks), **above)


_SMALL = 7  # points, of a legend above a figure of one column


def _in_a_row(entries: Sequence[Any]) -> int:
    """How many entries are side by side above a figure of one column, in rows of about the same number."""
    texts = [str(entry.get_label()).replace("$", "").split("\n") for entry in entries]
    *_, second, longest = sorted([0.0, 0.0, *(31 + 3.4 * max(map(len, lines)) for lines in texts)])  # points
    most = 1 + int((72 * wide(ONE_COLUMN) - longest) / second) if second else 1
    return -(-len(entries) // -(-len(entries) // most)) if entries else 1


def _rows(entries: Sequence[Any]) -> int:
    return -(-len(entries) // _in_a_row(entries)) + max((str(entry.get_label()).count("\n") for entry in entries), default=0)


_EDGE = 0.03  # of the axis, beyond the bars at its ends
_BEST = {"marker": "*", "color": "black", "markersize": 6, "zorder": 5, "linestyle": "none", "clip_on": False}
_OWN = _BEST | {"marker": "x", "markeredgewidth": 1.4}


def _mark_best(axes: Any, columns: Columns, layout: Layout, best: Mapping[str, Any], panel: float) -> None:
    """The star of the best design; that of one on the frame is drawn beside it."""
    from matplotlib.transforms import ScaledTranslation

    if not best or (layout.panels is not None and best[layout.panels] != panel):
        return
    if layout.x is not None:
        left, right = axes.get_xlim()
        inwards = (best[layout.x] == left) - float(best[layout.x] == right)
        moved = ScaledTranslation(inwards * _BEST["markersize"] / 144, 0, axes.figure.dpi_scale_trans)
        axes.plot(best[layout.x], best["high"], transform=axes.transData + moved, **_BEST)
    elif whose_column(columns):
        axes.plot(best["high"], list(_members(columns)).index(best[whose_column(best)]), **_BEST)
    elif (own := {name: best[name] for name in layout.bars[0]}) in layout.bars:
        axes.plot(best["high"], layout.bars.index(own), **_BEST)


def _own_points(
    facts: Mapping[str, Any], along: str, layout: Layout, view: tuple[float, float], panels: Sequence[float]
) -> tuple[list[float], list[float]]:
    """The spec's own design in the plane of the figure, or on its bar, if one of these panels shows it; view: see `_view`."""
    spec = spec_of(facts)
    if spec is None or (
        layout.x is None and (facts.get("for_hands") or "for_all" in facts.get("spec", {}))
    ):  # bars of hands are none of designs
        return [], []
    bars = layout.bars[0] if layout.x is None else ()
    names = (along, layout.x, layout.panels, layout.family, *bars, *layout.fixed)
    own = {name: spec.own(spec.names.find(name).path) for name in names if name}
    if None in own.values():  # an edge of a filter's band, which its order and cutoff follow from
        return [], []
    there = layout.panels is None or own[layout.panels] in panels
    there = there and (layout.family is None or own[layout.family] in layout.members)
    there = there and all(own[name] == value for name, value in layout.fixed.items())
    there = there and all(low <= own[along] <= high for low, high in (swept_range(facts, along), view))
    if layout.x is None:
        bar = {name: own[name] for name in bars}
        there = there and bar in layout.bars
        return ([own[along]], [layout.bars.index(bar)]) if there else ([], [])
    x = own[layout.x]
    return ([x], [own[along]]) if there and layout.points[0] <= x <= layout.points[-1] else ([], [])


def _draw_panel(
    axes: Any,
    columns: Columns,
    facts: Mapping[str, Any],
    layout: Layout,
    inches: tuple[float, float],
    span: tuple[float, float],
) -> None:
    if layout.x is not None and not (columns["intervals"] > 0).any():
        nothing = "nothing known to be stable" if incomplete(columns).any() else "nowhere stable at the swept values"
        axes.text(0.5, 0.5, nothing, ha="center", va="center", transform=axes.transAxes)
    if whose_column(columns):
        members = _members(columns)
        looks, names = [HANDS[hand][0] for hand in members], list(members)
        members = list(members.values())
    else:
        members = [_rows_with(columns, values) for values in layout.bars]
        looks, names = family_looks(len(members)), [_name_of(values, facts) for values in layout.bars]
    if layout.x is None:
        draw_bars(axes, members, names, [look.colour for look in looks] if whose_column(columns) else ())
        if "for_all" in names:
            place = names.index("for_all")
            draw_beside_bar(axes, place, _HALF_BAR, members[place], span)
        return
    logarithmic = is_logarithmic(columns[layout.x])
    if logarithmic:
        by_factors(axes.xaxis, columns[layout.x].min(), columns[layout.x].max())
    view = view_of(layout.x, logarithmic, *inches, _by_factors_upwards(columns, facts))
    felt = _shows_felt(columns, facts, layout)
    curves = _curves(members, view, facts, whose_column(columns))
    for number, (look, curve) in enumerate(zip(looks, curves, strict=True)):
        shift = _APART * (number - (len(looks) - 1) / 2)
        draw_region(axes, curve, view, look, filled=len(members) == 1, shift=shift)
        if felt:
            draw_felt(axes, curve, look)
    if "for_all" in names:
        draw_at_places(axes, layout.x, members[names.index("for_all")], logarithmic, span, shift)  # that of the last member
    low, high = columns[layout.x].min(), columns[layout.x].max()
    if any(curve.open_at_ends for curve in curves):  # bars at the first and the last value stay whole
        more, factor = _EDGE * (high - low), (high / low) ** _EDGE if logarithmic else 1.0
        low, high = (low / factor, high * factor) if logarithmic else (low - more, high + more)
    axes.set_xlim(low, high)


def _curves(members: Sequence[Columns], view: Any, facts: Mapping[str, Any], hands: bool) -> list[Curve]:
    """The curves of all members in one batch; those of hands each on its own, since only some of them can be refined."""
    if not hands:
        return curves_of(members, view, facts)
    return [curve for member in members for curve in curves_of([member], view, facts)]


def _shows_felt(columns: Columns, facts: Mapping[str, Any], layout: Layout) -> bool:
    """Whether the hand feels other stiffnesses at the limits, some of which the panels show."""
    if layout.x != "B_VE" or str(columns["along"][0]) != "K_VE" or whose_column(columns) or not felt_differs(columns):
        return False
    low, high = _view(columns, facts)
    return bool(((columns["felt_high"] >= low) & (columns["felt_high"] <= high)).any())


def _by_factors_upwards(columns: Columns, facts: Mapping[str, Any]) -> bool:
    """Whether a scale of factors shows the limits, most of which an even one would squeeze into its lowest part."""
    ends = np.concatenate([columns["low"], columns["high"]])
    real = ends[~np.isnan(np.concatenate([columns["low_omega"], columns["high_omega"]]))]
    start = swept_range(facts, str(columns["along"][0]))[0]
    return bool(np.isfinite(start) and start > 0 and real.size and np.median(real) < _SQUEEZED * real.max())


def _view(columns: Columns, facts: Mapping[str, Any]) -> tuple[float, float]:
    """The limits that show every interval of the table, or the swept range if there is none; all panels share them.

    There is room beyond the largest value, and below the least one as far as it is swept, or if the swept range ends there.
    Space that is not swept is not shown otherwise: it would pass for unstable.
    """
    swept = swept_range(facts, str(columns["along"][0]))
    top = np.nanmax(np.concatenate([columns["high"], columns.get("fails_from", [])]), initial=0.0)
    bottom = np.nanmin(columns["low"], initial=swept[0] if 0 < swept[0] < top else 0.0)
    room = 0.06 * (top - bottom)
    lowest = range_end(columns, "low")
    if lowest is not None:
        bottom = min(bottom, lowest - room if lowest <= 0 else max(lowest - room, 0.0))
    elif 0 < swept[0] < top:
        bottom = swept[0]
    elif swept[0] < bottom:  # stability ends there, and what is below is unstable
        bottom = max(swept[0], bottom - room)
    limits = (float(bottom), float(top + room))
    if _by_factors_upwards(columns, facts):
        limits = (max(swept[0], np.nanmin(columns["low"])) / _ROOM, float(top) * _ROOM)
    if top <= bottom:
        limits = swept if np.isfinite(swept).all() else (limits[0], 1.0)
    return limits


def _rows_with(columns: Columns, values: Mapping[str, float]) -> dict[str, np.ndarray]:
    for axis, value in values.items():
        columns = _rows_where(columns, axis, value)
    return dict(columns)


def _name_of(values: Mapping[str, float], facts: Mapping[str, Any]) -> str:
    """The name of a bar: its value if the bars have one axis, otherwise its values with their names."""
    if len(values) <= 1:
        return "".join(f"{value:g}" for value in values.values())
    return ", ".join(valued(name, value, facts) for name, value in values.items())


def _rows_where(columns: Columns, axis: str | None, value: float) -> dict[str, np.ndarray]:
    chosen = slice(None) if axis is None else columns[axis] == value
    return {name: column[chosen] for name, column in columns.items()}


def _name_axes(canvas: Any, columns: Columns, layout: Layout, facts: Mapping[str, Any]) -> None:
    along = label(str(columns["along"][0]), facts)
    bars = layout.x is None
    # The note is a further line of the label: the layout makes room for that, and for nothing that is placed by hand.
    width = int(_LETTERS_PER_INCH * canvas.get_figwidth())
    unmarked = undrawn(facts, layout.x, str(columns["along"][0]))
    required = f"stable here: {words_of(facts['require'])}" if "require" in facts else ""
    note = [line for text in (required, layout.left_out, unmarked, _assumed(facts)) for line in wrap(text, width)]
    canvas.supxlabel("\n".join([along if bars else label(layout.x, facts), *note]), fontsize=8)
    across = (label(layout.family, facts) if layout.family and not layout.beside else "") if bars else along
    if across:
        canvas.supylabel(across, fontsize=8)


def _assumed(facts: Mapping[str, Any]) -> str:
    """The controller, its wall, delay and velocity, as far as the figure has a single one of each."""
    said, _, _ = assumed(facts).partition(":")  # what engines usually do follows
    kind = facts.get("spec", {}).get("controller", {}).get("kind")
    return f"{kind}, {said}" if said and kind else ""


def _entries(
    columns: Columns, facts: Mapping[str, Any], layout: Layout, best: Mapping[str, Any], own: tuple[list, list]
) -> tuple[list[Any], list[Any]]:
    """The entries of the legend: the members of a family or the hands, and the marks."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    certain = bool((columns["certified"] | promised(columns)).all())
    members, handles = hand_handles(columns) if whose_column(columns) else [], []
    if "guarantee" in columns:
        members += for_all_handles(_members(columns)["for_all"])
    if layout.x is not None and layout.family is not None:
        rows, bottom = (
            [_rows_where(columns, layout.family, value) for value in layout.members],
            np.nanmin(columns["low"], initial=np.inf),
        )
        names = [valued(layout.family, value, facts) for value in layout.members]
        # The first has name and unit, the others the value.
        names = [names[0], *(f"{value:.6g}" for value in layout.members[1:])]
        members = handles_of([name + _extent(each, bottom) for name, each in zip(names, rows, strict=True)])
    if layout.x is not None and _shows_felt(columns, facts, layout):
        alone = HANDS["free"][0].colour if layout.family is None else "0.3"
        handles.append(Line2D([], [], color=alone, linestyle=FELT_LINE, linewidth=0.8, label="stiffness felt at the limit"))
    if best:
        handles.append(Line2D([], [], **_BEST, label=_in_words(best, facts, "" if certain else " certified")))
    if own[0]:
        handles.append(Line2D([], [], **_OWN, label="the spec's own"))
    if not certain:
        handles.append(Line2D([], [], color=DOUBTFUL, linestyle="--", label="not certified"))
        if layout.x is not None and len(layout.bars) == 1 and layout.family is None and not whose_column(columns):
            handles[-1] = Patch(**UNPROVED | {"linewidth": 1.2}, edgecolor=DOUBTFUL, linestyle="--", label="not certified")
    if range_end(columns, "low") is not None or range_end(columns, "high") is not None:
        handles.append(range_handle())
    return members, handles


_LIMIT = {"color": "0.35", "linewidth": 0.8}
_LIMITS = {
    "holds_to": ("friction holds an encoder step, $2 f_c/D$", (0, (6, 1, 1, 1, 1, 1))),
    "passive_to": ("passive by damping, without $B_{VE}$", (0, (1, 2))),
}


def _limit_handle(name: str) -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], **_LIMIT, linestyle=_LIMITS[name][1], label=_LIMITS[name][0])


def _limits_of_walls(columns: Columns, facts: Mapping[str, Any], layout: Layout, view: tuple[float, float]) -> dict[str, float]:
    """Stiffnesses in the figure beyond which walls that are felt as they are may buzz, see `limits_of_walls`."""
    limits = facts.get("limits_of_walls", {}) if layout.x == "B_VE" and not felt_differs(columns) else {}
    return {name: limit for name, limit in limits.items() if view[0] < limit < view[1]}


def _in_words(best: Mapping[str, Any], facts: Mapping[str, Any], sure: str) -> str:
    """The largest value and, for a wall, the stiffness that the hand feels; sure: after the word, if others are in doubt."""
    sure = sure if best["certified"] else ""
    along = str(best["along"])
    over = "" if best["high_omega"] == best["high_omega"] else "over "
    felt = best.get("felt_high", np.nan)
    if along != "K_VE" or not abs(felt - best["high"]) > 0.005 * best["high"]:
        start = f", from {best['low']:.5g}" if best.get("interval", 0) > 0 else ""  # above a hole, and perhaps thin
        return f"largest{sure}: {over}{best['high']:.5g} {unit(along, facts)}".rstrip() + start
    first, *others = (f"{felt:.4g} N/m", *_over_band(best, facts, felt))
    texts = [f"stiffest felt{sure and ','}{sure}: {first}{' at rest' if others else ''}", *others]
    texts.append(f"of a wall of {over}{best['high']:.5g} N/m")
    unbroken = ", ".join(text.replace(" ", "\N{NO-BREAK SPACE}") for text in texts)
    return "\n".join(wrap(unbroken, _WIDEST)).replace("\N{NO-BREAK SPACE}", " ")


def _over_band(best: Mapping[str, Any], facts: Mapping[str, Any], felt: float) -> list[str]:
    """What the hand feels of that wall over frequency; nothing if it is not one for the spec's own hand."""
    from wavesweep.sweep.feel import band_at, sizes_in_words

    spec = spec_of(facts) if not whose_column(best) else None
    if spec is None or not felt > 0:
        return []
    names = list(best)[: list(best).index("along")]
    return sizes_in_words(band_at(spec, {name: best[name] for name in names} | {str(best["along"]): best["high"]}, felt))


def draw_bars(axes: Any, members: Sequence[Columns], names: Sequence[str], colours: Sequence[Any] = ()) -> None:
    """Draw a bar per stable interval, a line of bars per member, named at the left.

    An end of the stable set is marked by a stroke; if the swept range ends the bar, there is none. `colours`: one for
    each member; by default all have the same.
    """
    alike = [family_looks(1)[0].colour] * len(members)
    for place, (columns, name, colour) in enumerate(zip(members, names, colours or alike, strict=True)):
        stable = np.flatnonzero(columns["intervals"] > 0).tolist()
        unknown = bool(incomplete(columns).any())
        if unknown:
            axes.axhspan(place - _HALF_BAR, place + _HALF_BAR, **UNKNOWN)
        if not stable:
            said = "nothing proved" if name == "for_all" else "nothing known to be stable" if unknown else "nowhere stable"
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


def promised(columns: Columns) -> np.ndarray:
    """Flags of the rows with a guarantee for hands; their certainty is in the legend, not in the style of the line."""
    if not whose_column(columns):
        return np.zeros(len(columns["along"]), bool)
    return ~np.isin(columns[whose_column(columns)].astype(str), ("free", "operator", "spec", "for_all"))


def hand_handles(columns: Columns) -> list[Any]:
    """Entries of the legend, with those regions that have no boundary, since no line shows them."""
    from matplotlib.lines import Line2D

    members = _members(columns)
    names = {hand: words for hand, (_, words) in HANDS.items()}
    if "operator" in members:
        names["port"] += " (operator)"  # it is that of the spec's own loop
    if "settled" in columns and "box" in members:
        names["box"] += " (settled)" if members["box"]["settled"].all() else " (searched)"
    bottom = np.nanmin(columns["low"], initial=np.inf)
    return [
        Line2D([], [], color=HANDS[h][0].colour, linestyle=HANDS[h][0].line, label=names[h] + _extent(rows, bottom))
        for h, rows in members.items()
    ]


def _extent(rows: Columns, bottom: float) -> str:
    if not rows["intervals"].any():
        return ": none"
    whole = (rows["intervals"] == 1) & (rows["low"] == bottom) & np.isnan(rows["high_omega"]) & ~incomplete(rows)
    return ": whole range" if whole.all() else ""


def _members(columns: Columns) -> dict[str, dict[str, np.ndarray]]:
    """The rows of each hand of the table."""
    shown = {**columns, "certified": columns["certified"] | promised(columns)}
    if "guarantee" in columns:  # what is proved for all has an end, wherever a counterexample or nothing is known beyond
        for_all = columns["guarantee"] == "for_all"
        for omega, fails in (("low_omega", "fails_below"), ("high_omega", "fails_from")):
            ends = for_all & (np.isfinite(columns[fails]) | ~columns["settled"])
            shown[omega] = np.where(for_all, np.where(ends, 0.0, np.nan), columns[omega])
    rows = {hand: columns[whose_column(columns)] == hand for hand in HANDS}
    return {hand: {name: column[chosen] for name, column in shown.items()} for hand, chosen in rows.items() if chosen.any()}
