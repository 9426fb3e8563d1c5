"""The legend of the figure of stable intervals: its members, and its marks in words."""

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np

from wavesweep.program.analyses.claim_words import extreme
from wavesweep.program.analyses.claims import Status
from wavesweep.program.analyses.plane_columns import incomplete
from wavesweep.program.columns import FELT_ALIKE
from wavesweep.program.number_words import rounded_down, rounded_up
from wavesweep.program.plots.labels import unit, valued
from wavesweep.program.plots.member_panels import Member, look_of
from wavesweep.program.plots.region_figures import (
    BAR,
    BEYOND,
    CARET,
    DOWN,
    FELT,
    FELT_WIDTH,
    LADDER,
    LEFT,
    RIGHT,
    UP,
    handles_of,
)
from wavesweep.program.plots.shown import Shown
from wavesweep.program.plots.style import DOUBTFUL, UNKNOWN, UNPROVED, fitting
from wavesweep.program.row_kinds import COMPUTED, row_kinds

NOT_KNOWN, REFUTED = "not known", "refuted from here"
_SMALL = 7  # points, of a legend above a figure of one column
BEST = {
    "marker": "*",
    "color": "black",
    "markersize": 6,
    "zorder": 5,
    "linestyle": "none",
    "clip_on": False,
}
OWN = BEST | {"marker": "x", "markeredgewidth": 1.4}
LIMIT = {"color": "0.35", "linewidth": 0.8}
LIMITS = {
    "holds_to": ("friction holds an encoder step, $2 f_c/D$", (0, (6, 1, 1, 1, 1, 1))),
    "passive_to": ("passive by damping, without $B_{VE}$", (0, (1, 2))),
}


def entries_of(
    shown: Shown, panels: Sequence[float], drawn: Sequence[Any]
) -> tuple[list[Any], list[Any]]:
    """The entries of the legend: the members of a family, the hands or the specs, and the marks.

    drawn: the axes of the panels. What is not in them has no entry.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    members = shown.members(shown.columns)
    entries = _member_entries(shown, members)
    artists: list[Any] = []
    for axes in drawn:
        artists += [*axes.lines, *axes.patches, *axes.collections]
    if any(artist.get_label() == LADDER for artist in artists):
        entries.append(Line2D([], [], **BAR, color=UNKNOWN["edgecolor"], label=NOT_KNOWN))
    elif UNKNOWN["hatch"] in _hatches(artists):
        entries.append(Patch(**UNKNOWN, label=NOT_KNOWN))
    markers = [artist.get_marker() for artist in artists if isinstance(artist, Line2D)]
    carets = [marker for marker in markers if marker in (RIGHT, UP, LEFT, DOWN)]
    if carets:
        entries.append(Line2D([], [], marker=carets[-1], **CARET, label=REFUTED))
    return entries, _marks(shown, members, panels, artists)


def _hatches(artists: Sequence[Any]) -> set[str | None]:
    """The hatches that occur among what is drawn."""
    return {artist.get_hatch() for artist in artists if hasattr(artist, "get_hatch")}


def _member_entries(shown: Shown, members: Sequence[Member]) -> list[Any]:
    """The entries of the members; bars have none, since their names stand beside them."""
    layout = shown.layout
    if layout.x is None:
        return []
    if shown.whose:
        names = [member.name for member in members]
    elif layout.family is not None:
        first, *others = layout.members
        names = [valued(layout.family, first, shown.facts)]
        names += [f"{value:.6g}" for value in others]
    else:
        return []
    names = [name + _extent(shown, member) for name, member in zip(names, members, strict=True)]
    looks = [member.look for member in members]
    return handles_of(names, looks, [member.at_values for member in members])


def _extent(shown: Shown, member: Member) -> str:
    """What the legend says of a region that has no boundary, since no line shows it."""
    rows = member.rows
    if not rows["intervals"].any():
        return ": none"
    bottom = np.nanmin(shown.columns["low"], initial=np.inf)
    from_bottom = (rows["intervals"] == 1) & (rows["low"] == bottom)
    to_top = np.isnan(rows["high_omega"])
    whole = from_bottom & to_top & ~incomplete(rows)
    return ": whole range" if whole.all() else ""


def _marks(
    shown: Shown, members: Sequence[Member], panels: Sequence[float], artists: Sequence[Any]
) -> list[Any]:
    """The entries of the legend for single points and for lines that no member has alone;
    artists: what is drawn."""
    from matplotlib.lines import Line2D

    handles = []
    if any(artist.get_label() == FELT for artist in artists):
        colour = look_of(COMPUTED["free"]).colour if len(members) == 1 else "0.3"
        felt = {"color": colour, "linewidth": FELT_WIDTH}
        handles.append(Line2D([], [], **felt, label="stiffness felt at the limit"))
    if shown.best:
        handles.append(Line2D([], [], **BEST, label=_best(shown, members)))
    if shown.own_design(panels):
        handles.append(Line2D([], [], **OWN, label="nominal design"))
    handles += _area_marks(artists)
    for name in shown.limits_of_walls():
        said, line = LIMITS[name]
        handles.append(Line2D([], [], **LIMIT, linestyle=line, label=said))
    for walls in shown.walls:
        handles += walls.handles(shown.layout.points, shown.view)
    return handles


def _area_marks(artists: Sequence[Any]) -> list[Any]:
    """The entries for what is not certified, and for what lies beyond the swept range."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = []
    hatches = _hatches(artists)
    dashed = {"linestyle": "--", "label": "not certified"}
    if UNPROVED["hatch"] in hatches:
        handles.append(Patch(**UNPROVED | {"linewidth": 1.2}, edgecolor=DOUBTFUL, **dashed))
    elif any(_is_red(artist) for artist in artists):
        handles.append(Line2D([], [], color=DOUBTFUL, **dashed))
    if BEYOND["hatch"] in hatches:
        handles.append(Patch(**BEYOND, label="beyond the swept range"))
    return handles


def _is_red(artist: Any) -> bool:
    """Whether lines are drawn in the colour of what is not certified."""
    from matplotlib.colors import same_color, to_rgba

    if not hasattr(artist, "get_segments"):
        return False
    colours = artist.get_colors() if len(artist.get_segments()) else ()
    return any(same_color(to_rgba(colour), DOUBTFUL) for colour in colours)


def _best(shown: Shown, members: Sequence[Member]) -> str:
    """The largest value and, of a wall, the stiffness felt, with what is claimed of its row."""
    best = shown.best
    word = ""
    if shown.whose in ("guarantee", "hand"):
        word = best.get(shown.whose, "")
    claim = next(member.claim for member in members if member.guarantee == word)
    proved = claim.status is Status.PROVED
    rows = row_kinds()[word].legend if proved or shown.whose == "hand" or word else ""
    certain = all(member.rows["certified"].all() for member in members)
    certified = bool(best["certified"]) and not certain
    start, stop = shown.swept
    if best["value"] == best["low"]:
        value = rounded_up(best["value"], 5)
        at_range = best["value"] == start
    else:
        value = rounded_down(best["value"], 5)
        at_range = best["value"] == stop
    if at_range:
        value = f"at least {value}"
    felt = best["merit"]
    alike = abs(felt - best["value"]) <= 0.005 * best["value"]
    if shown.along != "K_VE" or (alike and best["high"] >= (1 - FELT_ALIKE) * best["largest"]):
        largest = extreme(claim, "largest", rows, certified=certified)
        said = f"{largest}: {value} {unit(shown.along, shown.facts)}".rstrip()
        above_a_hole = best.get("interval", 0) > 0  # and perhaps thin
        if above_a_hole:
            return f"{said}, from {rounded_up(best['low'], 5)}"
        return said
    stiffest = extreme(claim, "stiffest felt", rows, certified=certified)
    return f"{stiffest}: {rounded_down(felt, 4)} N/m at rest,\nof a wall of {value} N/m"


def draw_legends(
    canvas: Any, grid: Any, members: list[Any], marks: list[Any], at_side: bool
) -> None:
    """The members above the only panel, and the marks above these.

    Of several panels all are beside them, or above them.
    """
    if at_side and members + marks:
        canvas.legend(handles=members + marks, loc="outside right upper", handlelength=2.5)
        return
    width = canvas.get_figwidth()
    if grid.size > 1:
        marks = members + marks
        members = []
    above = {"columnspacing": 0.8, "handlelength": 2.5, "handletextpad": 0.5, "fontsize": _SMALL}
    if members:
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "borderaxespad": 0.2}
        grid[0, 0].legend(handles=members, ncols=_in_a_row(members, width), **above, **place)
    if marks:
        canvas.legend(
            handles=marks, loc="outside upper center", ncols=_in_a_row(marks, width), **above
        )


def _in_a_row(entries: Sequence[Any], width: float) -> int:
    """How many entries are side by side above the panels of a figure of this width, inches."""
    # Inches of a figure of one column that its panel leaves to numbers.
    return fitting([entry.get_label() for entry in entries], width - 0.5, _SMALL)


def rows_of(entries: Sequence[Any], width: float) -> int:
    """How many rows of a legend these entries take above a figure of this width, inches."""
    further_lines = [entry.get_label().count("\n") for entry in entries]
    return ceil(len(entries) / _in_a_row(entries, width)) + max(further_lines, default=0)
