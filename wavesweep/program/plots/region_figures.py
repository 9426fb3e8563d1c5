"""How stable regions are drawn: areas and boundaries, what is open under [for_all], and the end
of the swept range."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesweep.program.analyses.plane_columns import View
from wavesweep.program.columns import Columns
from wavesweep.program.plots.plane_regions import Chain, Region
from wavesweep.program.plots.style import (
    DOTS_PER_INCH,
    DOUBTFUL,
    UNKNOWN,
    UNPROVED,
    Look,
    family_looks,
    paler,
)

BEYOND = {"facecolor": "0.93", "edgecolor": "0.65", "hatch": "....", "linewidth": 0, "zorder": 0.4}
CARET = {
    "color": "#D55E00",
    "markersize": 4,
    "linestyle": "none",
    "zorder": 6,
}  # seen on the star of the best design
LEFT, RIGHT, UP, DOWN = range(8, 12)  # carets of matplotlib whose base is at the point
BAR = {"marker": "|", "markersize": 8, "markeredgewidth": 2.5, "linestyle": "none"}  # in a legend
LADDER = "_ladder"  # label of what is not known at a value of x
FELT = "_felt"  # label of the stiffness felt
FELT_WIDTH = 0.6  # points: thin beside the boundary with its strokes, whose dashes it has
_SHARE = 0.5  # of its colour that a pale bar has
_SEEN = 0.01  # of what is shown

Span = tuple[float, float]


def view_of(x: str, logarithmic: bool, width: float, height: float, factors: bool = False) -> View:
    """The view of a panel of `width` by `height` inches with its labels. factors: whether its
    axis upwards goes by factors."""
    return View(x, logarithmic, 0.8 * DOTS_PER_INCH * width, 0.8 * DOTS_PER_INCH * height, factors)


def handles_of(
    names: Sequence[str], looks: Sequence[Look] = (), bars: Sequence[bool] = ()
) -> list[Any]:
    """Entries of a legend for the members of a family; bars: those that are bars at values of x."""
    from matplotlib.lines import Line2D

    looks = looks or family_looks(len(names))
    bars = bars or [False] * len(looks)
    handles = []
    for look, name, bar in zip(looks, names, bars, strict=True):
        if bar:
            style = {**BAR, "color": paler(look.colour, _SHARE)}
        else:
            style = {"color": look.colour, "linestyle": look.line}
        handles.append(Line2D([], [], **style, label=name))
    return handles


def draw_region(axes: Any, region: Region, look: Look, filled: bool, members: int = 1) -> None:
    """Draw the known part of a stable region: its area, or strokes from its boundary to the
    unstable side if not `filled`.

    members: of the panel; the strokes of many lines are fewer.
    """
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patheffects import withTickedStroke

    _draw_unknown(axes, region)
    if filled:
        # With a hairline, so that no seam shows between two outlines.
        pale = paler(look.colour, 0.22)  # share of its colour that an area has
        area = {"facecolor": pale, "edgecolor": pale, "linewidth": 0.4, "zorder": 0.6}
        axes.add_collection(PolyCollection(region.areas, **area))
        if region.unproved:
            dotted = {**UNPROVED, "edgecolor": look.colour, "zorder": 0.7}
            axes.add_collection(PolyCollection(region.unproved, **dotted))
        strokes = []
    else:
        apart = max(1.0, members / 2)
        spacing = 9 * apart
        length = 0.45 / apart
        strokes = [withTickedStroke(angle=75, spacing=spacing, length=length, linewidth=0.7)]
    line = {"linewidths": 1.2, "path_effects": strokes}
    certain = LineCollection(region.certain, colors=[look.colour], linestyles=[look.line], **line)
    doubtful = LineCollection(region.doubtful, colors=DOUBTFUL, linestyles="--", zorder=3, **line)
    axes.add_collection(certain)
    axes.add_collection(doubtful)


def _draw_unknown(axes: Any, region: Region) -> None:
    """Hatch what is not known."""
    from matplotlib.collections import PolyCollection

    columns = []
    places = []
    for begin, end, low, high in region.unknown:
        if np.isinf(low):
            columns.append((begin, end))
        else:
            places.append([(begin, low), (end, low), (end, high), (begin, high)])
    for column in columns:
        axes.axvspan(*column, **UNKNOWN)
    if columns:  # no hatching under what is known
        white = {"facecolor": "white", "linewidth": 0, "zorder": 0.5}
        axes.add_collection(PolyCollection(region.areas, **white))
    if places:
        axes.add_collection(PolyCollection(places, **UNKNOWN | {"zorder": 0.8}))


@dataclass(frozen=True)
class Bars:
    """Where bars stand, and how wide: over the values of x, at each of which those of several
    members are side by side.

    shift, width: points.
    """

    shift: float = 0.0
    width: float = 0.8

    def place(self, axes: Any) -> Any:
        """The transform of what stands at values of x."""
        from matplotlib.transforms import ScaledTranslation

        return axes.transData + ScaledTranslation(self.shift / 72, 0, axes.figure.dpi_scale_trans)

    def body(self, colour: Any) -> dict[str, Any]:
        """The style of the part between the ends, which is pale if there is room to see it."""
        # Points, from which on a bar is pale between its ends.
        seen = paler(colour, _SHARE) if self.width > 1.5 else colour
        return {"colors": [seen], "linewidths": self.width}


def draw_at_values(axes: Any, bars: Chain, look: Look, at: Bars, span: Span | None = None) -> None:
    """Draw the intervals that are known at values of x alone, as bars there, whose ends have
    strokes.

    An end of the swept range has none. span: that range, of intervals whose ends do not say whether
    the range has set them.
    """
    place = at.place(axes)
    bottom = -np.inf
    top = np.inf
    if span:
        least = _SEEN * (span[1] - span[0])
        bottom = span[0] + least
        top = span[1] - least
    doubtful = {"colors": [DOUBTFUL], "linewidths": 0.8, "linestyles": "--"}
    looks = ((True, look.colour, at.body(look.colour)), (False, DOUBTFUL, doubtful))
    for certified, colour, body in looks:
        chosen = [(x, interval) for x, interval in bars if interval.certified == certified]
        if chosen:
            spans = np.array([(x, interval.low, interval.high) for x, interval in chosen]).T
            axes.vlines(*spans, **body, transform=place)
        ends = [
            (x, interval.low)
            for x, interval in chosen
            if interval.low_real and interval.low > bottom
        ]
        ends += [
            (x, interval.high)
            for x, interval in chosen
            if interval.high_real and interval.high < top
        ]
        if ends:
            mark = {"color": colour, "markersize": max(4.0, at.width + 2), "clip_on": False}
            axes.plot(*zip(*ends, strict=True), "_", **mark, transform=place)


def draw_unknown_at_values(
    axes: Any, open_parts: Sequence[tuple[float, float, float]], span: Span, bars: Bars
) -> None:
    """Draw what is not known at values of x alone, (x, from, to), as ladders there, if it can be
    seen in the span."""
    least = _SEEN * (span[1] - span[0])
    seen = [(x, low, high) for x, low, high in open_parts if high - low > least]
    if seen:
        rung = 1 / max(bars.width, 1.0)  # a dash is measured in widths
        ladder = {
            "colors": UNKNOWN["edgecolor"],
            "linewidths": max(bars.width, 2.0),
            "linestyles": [(0, (rung, 2 * rung))],
            "zorder": 0.9,
        }
        axes.vlines(*np.array(seen).T, label=LADDER, transform=bars.place(axes), **ladder)


def draw_felt(axes: Any, region: Region, look: Look) -> None:
    """Draw the stiffness that the hand feels at the upper ends, if these are limits and not ends
    of the range."""
    for line in region.felt:
        axes.plot(
            *zip(*line, strict=True),
            color=look.colour,
            linewidth=FELT_WIDTH,
            linestyle=look.line,
            label=FELT,
        )
    single = [(x, interval.felt_high) for x, interval in region.bars if interval.high_real]
    if single:
        axes.plot(*zip(*single, strict=True), "v", color=look.colour, markersize=2.5, label=FELT)


def felt_differs(columns: Columns) -> bool:
    """Whether the hand feels another stiffness at some limit than that of the wall."""
    if "felt_high" not in columns:
        return False
    limit = ~np.isnan(columns["high_omega"]) & ~np.isnan(columns["felt_high"])
    return bool(
        (
            np.abs(columns["felt_high"] - columns["high"])[limit] > 0.005 * columns["high"][limit]
        ).any()
    )


def draw_for_all(axes: Any, x: str, columns: Columns, span: Span, bars: Bars) -> None:
    """Draw what the for_all rows of a plane leave open at each value of x, and carets where what is
    refuted begins.

    span: the part of the swept range that the axes show.
    """
    for below, above in _open_parts(columns, span):
        open_parts = np.stack([columns[x], below, above], axis=1).tolist()
        draw_unknown_at_values(axes, open_parts, span, bars)
    for name, caret in (("fails_below", DOWN), ("fails_from", UP)):
        rows = np.isfinite(columns[name])
        if rows.any():
            dots = columns[x][rows], columns[name][rows]
            axes.plot(*dots, marker=caret, clip_on=False, transform=bars.place(axes), **CARET)


def draw_for_all_bar(axes: Any, place: float, half: float, columns: Columns, span: Span) -> None:
    """The same on the bar of the for_all rows, at `place` with `half` of its height."""
    for below, above in _open_parts(columns, span):
        for low, high in zip(below.tolist(), above.tolist(), strict=True):
            if high - low > _SEEN * (span[1] - span[0]):
                axes.barh(place, high - low, left=low, height=2 * half, **UNKNOWN)
    for name, caret in (("fails_below", LEFT), ("fails_from", RIGHT)):
        ends = columns[name][np.isfinite(columns[name])]
        if ends.size:  # an empty line that is not clipped takes room below the panel
            height = np.full(ends.size, place - 0.6 * half)  # the star has the middle
            axes.plot(ends, height, marker=caret, clip_on=False, **CARET)


def _open_parts(columns: Columns, span: Span) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield both ends of what is neither proved nor refuted in each row: below what is proved, and
    above.

    If nothing is proved, all is above; where it is certified that there is nothing, nothing is
    open.
    """
    bottom, top = span
    stable = columns["intervals"] > 0
    top = np.where(~stable & columns["certified"], bottom, top)
    refuted_below = np.fmax(columns["fails_below"], bottom)
    refuted_above = np.fmin(columns["fails_from"], top)
    yield np.where(stable, refuted_below, bottom), np.where(stable, columns["low"], bottom)
    yield np.where(stable, columns["high"], bottom), np.where(stable, refuted_above, top)


def mark_range(axes: Any, columns: Columns, bars: bool) -> None:
    """Dot the space beyond the swept range if a stable interval reaches its end.

    An end of the range that is the end of the parameter itself (K_VE = 0) is a limit and not
    marked. Call it when the limits of the axes are set.
    """
    limits = axes.get_xlim() if bars else axes.get_ylim()
    span = axes.axvspan if bars else axes.axhspan
    for end, edge in zip(("low", "high"), limits, strict=True):
        value = range_end(columns, end)
        if value is not None and value != edge:
            span(*sorted((value, edge)), **BEYOND)


def range_end(columns: Columns, end: str) -> float | None:
    """The end of the swept range at which stable intervals are cut off; None if none is, or if
    it is the parameter's end."""
    from wavesweep.program.spec import find_key

    unknown = np.full(len(columns["along"]), np.nan)
    beyond = columns.get(f"open_{end}", unknown) - columns[end]
    # an open place is there, and not the end of the range
    is_open = beyond < 0 if end == "low" else beyond > 0
    cut = (columns["intervals"] > 0) & np.isnan(columns[f"{end}_omega"]) & ~is_open
    cut &= (
        columns.get("guarantee", "spec") == "spec"
    )  # an end of what is proved for all has no oscillation
    if not cut.any():
        return None
    ends = columns[end][cut]
    extreme = float(ends.min() if end == "low" else ends.max())
    key = find_key(str(columns["along"][0]))
    if key is None:  # a number of a drawn loop has no end
        return extreme
    limit = key.low if end == "low" else key.high
    return None if extreme == limit else extreme
