"""The legend of the figure of stable intervals: its members, and its marks in words."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from wavesweep.core.plots.members import Member, look_of
from wavesweep.core.plots.regions import (
    BEYOND,
    CARET,
    DOWN,
    FELT_LINE,
    LEFT,
    RIGHT,
    SHADE,
    UP,
    handles_of,
    range_end,
)
from wavesweep.core.plots.shown import Shown
from wavesweep.core.plots.style import DOUBTFUL, UNKNOWN, UNPROVED, fitting, paler
from wavesweep.core.plots.words import unit, valued
from wavesweep.core.tables.planes import incomplete
from wavesweep.core.tables.row_kinds import COMPUTED, row_kinds

_BESIDE = 0.5  # inches, of a figure of one column that its panel leaves to numbers
NOT_KNOWN, REFUTED = "not known", "refuted from here"
_SMALL = 7  # points, of a legend above a figure of one column
BEST = {"marker": "*", "color": "black", "markersize": 6, "zorder": 5, "linestyle": "none", "clip_on": False}
OWN = BEST | {"marker": "x", "markeredgewidth": 1.4}
LIMIT = {"color": "0.35", "linewidth": 0.8}
LIMITS = {
    "holds_to": ("friction holds an encoder step, $2 f_c/D$", (0, (6, 1, 1, 1, 1, 1))),
    "passive_to": ("passive by damping, without $B_{VE}$", (0, (1, 2))),
}


def entries_of(shown: Shown, panels: Sequence[float]) -> tuple[list[Any], list[Any]]:
    """The entries of the legend: the members of a family, the hands or the specs, and the marks."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    members, layout, entries = shown.members(shown.columns), shown.layout, []
    if shown.whose or (layout.x is not None and layout.family is not None):
        names = [member.name for member in members]
        if not shown.whose:  # the first has name and unit, the others the value
            values = layout.members
            names = [valued(layout.family, values[0], shown.facts), *(f"{value:.6g}" for value in values[1:])]
        names = [
            name
            + _extent(shown, member)
            + " (at the dots)" * bool(member.joined and layout.x is not None and member.rows["intervals"].any())
            for name, member in zip(names, members, strict=True)
        ]
        entries = [] if layout.x is None else handles_of(names, [member.look for member in members])  # bars have their names
    if members and members[-1].proved:
        rows, colour = members[-1].rows, members[-1].look.colour
        if layout.x is not None and rows["intervals"].any():
            entries[-1] = Patch(facecolor=paler(colour, SHADE), edgecolor=colour, label=entries[-1].get_label())
        nowhere = layout.x is not None and not shown.columns["intervals"].any()
        entries += [] if rows["settled"].all() or nowhere else [Patch(**UNKNOWN, label=NOT_KNOWN)]
        carets = [
            each for end, *each in (("from", RIGHT, UP), ("below", LEFT, DOWN)) if np.isfinite(rows[f"fails_{end}"]).any()
        ]
        if carets:
            entries.append(Line2D([], [], marker=carets[0][layout.x is not None], **CARET, label=REFUTED))
    return entries, _marks(shown, members, panels)


def _extent(shown: Shown, member: Member) -> str:
    """What the legend says of a region that has no boundary, since no line shows it."""
    rows, bottom = member.rows, np.nanmin(shown.columns["low"], initial=np.inf)
    if not rows["intervals"].any():
        return ": none"
    whole = (rows["intervals"] == 1) & (rows["low"] == bottom) & np.isnan(rows["high_omega"]) & ~incomplete(rows)
    return ": whole range" if whole.all() else ""


def _marks(shown: Shown, members: Sequence[Member], panels: Sequence[float]) -> list[Any]:
    """The entries of the legend for single points and for lines that no member has alone."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    plane, certain = shown.layout.x is not None, all(member.rows["certified"].all() for member in members)
    handles = []
    if plane and shown.felt:
        alone = look_of(COMPUTED["free"]).colour if len(members) == 1 else "0.3"
        handles.append(Line2D([], [], color=alone, linestyle=FELT_LINE, linewidth=0.8, label="stiffness felt at the limit"))
    if shown.best:
        handles.append(Line2D([], [], **BEST, label=_best_in_words(shown, "" if certain else " certified")))
    if shown.own_design(panels)[0]:
        handles.append(Line2D([], [], **OWN, label="nominal design"))
    ended = [
        (np.isfinite([each.rows["low_omega"], each.rows["high_omega"]]).any(0) | plane)
        & ~each.rows["certified"]
        & (each.rows["intervals"] > 0)
        for each in members
    ]
    if any(rows.any() for rows in ended):
        dashed = {"linestyle": "--", "label": "not certified"}
        dotted = Patch(**UNPROVED | {"linewidth": 1.2}, edgecolor=DOUBTFUL, **dashed)
        handles.append(dotted if plane and len(members) == 1 and not shown.whose else Line2D([], [], color=DOUBTFUL, **dashed))
    if range_end(shown.columns, "low") is not None or range_end(shown.columns, "high") is not None:
        handles.append(Patch(**BEYOND, label="beyond the swept range"))
    limits = [LIMITS[name] for name in shown.limits_of_walls()]
    handles += [Line2D([], [], **LIMIT, linestyle=line, label=said) for said, line in limits]
    for each in shown.walls:
        handles += each.handles(shown.layout.points, shown.view)
    return handles


def _best_in_words(shown: Shown, sure: str) -> str:
    """The largest value and, of a wall, the stiffness felt; sure: what to say of it if others are in doubt."""
    best, facts = shown.best, shown.facts
    kind = row_kinds()[best.get(shown.whose, "") if shown.whose in ("guarantee", "hand") else ""]
    sure = sure if best["certified"] and not kind.proved else ""
    sure += f", {kind.legend}" * (shown.whose == "hand")
    title, over = kind.largest, "over " if np.isnan(best["high_omega"]) and not kind.proved else ""
    felt = best.get("felt_high", np.nan)
    if shown.along != "K_VE" or not abs(felt - best["high"]) > 0.005 * best["high"]:
        start = f", from {best['low']:.5g}" if best.get("interval", 0) > 0 else ""  # above a hole, and perhaps thin
        return f"{title}{sure}: {over}{best['high']:.5g} {unit(shown.along, facts)}".rstrip() + start
    title = title.replace("largest", "stiffest felt") + (sure and ",") * (not sure.startswith(",")) + sure
    return f"{title}: {felt:.4g} N/m at rest,\nof a wall of {over}{best['high']:.5g} N/m"


def draw_legends(canvas: Any, grid: Any, members: list[Any], marks: list[Any], beside: bool) -> None:
    """The members above the only panel, and the marks above these; or all beside several panels, or above them."""
    from matplotlib.patches import Patch

    named = any(each.get_label() in (NOT_KNOWN, REFUTED) for each in members)  # what is narrow needs no entry
    drawn = [each for axes in canvas.axes for each in (*axes.patches, *axes.collections)]
    if not named and any(each.get_hatch() == UNKNOWN["hatch"] for each in drawn):
        marks = [*marks, Patch(**UNKNOWN, label=NOT_KNOWN)]
    if beside and members + marks:
        canvas.legend(handles=members + marks, loc="outside right upper", handlelength=2.5)
        return
    width = canvas.get_figwidth()
    if grid.size > 1:
        members, marks = [], members + marks
    above = {"columnspacing": 0.8, "handlelength": 2.5, "handletextpad": 0.5, "fontsize": _SMALL}
    if members:
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "borderaxespad": 0.2}
        grid[0, 0].legend(handles=members, ncols=_in_a_row(members, width), **above, **place)
    if marks:
        canvas.legend(handles=marks, loc="outside upper center", ncols=_in_a_row(marks, width), **above)


def _in_a_row(entries: Sequence[Any], width: float) -> int:
    """How many entries are side by side above the panels of a figure of this width, inches."""
    return fitting([entry.get_label() for entry in entries], width - _BESIDE, _SMALL)


def rows_of(entries: Sequence[Any], width: float) -> int:
    """How many rows of a legend these entries take above a figure of this width, inches."""
    return -(-len(entries) // _in_a_row(entries, width)) + max((entry.get_label().count("\n") for entry in entries), default=0)
