"""How stable regions are drawn: areas and boundaries, what is open under [for_all], and the end of the swept range."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesweep.program.analyses.plane_columns import View
from wavesweep.program.columns import Columns
from wavesweep.program.plots.plane_regions import Chain, Region
from wavesweep.program.plots.style import DOTS_PER_INCH, DOUBTFUL, UNKNOWN, UNPROVED, Look, family_looks, paler

SHADE = 0.22  # share of its colour that an area has
BEYOND = {"facecolor": "0.93", "edgecolor": "0.65", "hatch": "....", "linewidth": 0, "zorder": 0.4}
CARET = {"color": "#D55E00", "markersize": 4, "linestyle": "none", "zorder": 6}  # seen on the star of the best design
LEFT, RIGHT, UP, DOWN = 8, 9, 10, 11  # carets whose base is at the point
FELT_LINE = (0, (1, 1.2))
BAR = {"marker": "|", "markersize": 8, "markeredgewidth": 2.5, "linestyle": "none"}  # in a legend
LADDER, FELT = "_ladder", "_felt"  # labels of what is not known at a value of x, and of the stiffness felt
_PALE, _SHARE = 1.5, 0.5  # points, from which on a bar is pale between its ends, and the share of its colour then
_SEEN = 0.01  # of what is shown

Span = tuple[float, float]


def view_of(x: str, logarithmic: bool, width: float, height: float, factors: bool = False) -> View:
    """The view of a panel of `width` by `height` inches with its labels. factors: whether its axis upwards goes by factors."""
    return View(x, logarithmic, 0.8 * DOTS_PER_INCH * width, 0.8 * DOTS_PER_INCH * height, factors)


def handles_of(names: Sequence[str], looks: Sequence[Look] = (), bars: Sequence[bool] = ()) -> list[Any]:
    """Entries of a legend for the members of a family; bars: those that are bars at values of x."""
    from matplotlib.lines import Line2D

    looks = looks or family_looks(len(names))
    return [
        Line2D([], [], **BAR, color=paler(look.colour, _SHARE), label=name)
        if bar
        else Line2D([], [], color=look.colour, linestyle=look.line, label=name)
        for look, name, bar in zip(looks, names, bars or [False] * len(looks), strict=True)
    ]


def draw_region(axes: Any, region: Region, look: Look, filled: bool, members: int = 1) -> None:
    """Draw the known part of a stable region: its area, or strokes from its boundary to the unstable side if not `filled`.

    members: of the panel; the strokes of many lines are fewer.
    """
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patheffects import withTickedStroke

    unknown = [(left, right) for left, right, low, _ in region.unknown if np.isinf(low)]
    for cell in unknown:
        axes.axvspan(*cell, **UNKNOWN)
    if unknown:  # no hatching under what is known
        axes.add_collection(PolyCollection(region.areas, facecolor="white", linewidth=0, zorder=0.5))
    places = [[(a, low), (b, low), (b, high), (a, high)] for a, b, low, high in region.unknown if not np.isinf(low)]
    if places:
        axes.add_collection(PolyCollection(places, **UNKNOWN | {"zorder": 0.8}))
    if filled:  # with a hairline, so that no seam shows between two outlines; what is stable and not certified is dotted
        pale = paler(look.colour, SHADE)
        axes.add_collection(PolyCollection(region.areas, facecolor=pale, edgecolor=pale, linewidth=0.4, zorder=0.6))
        if region.unproved:
            axes.add_collection(PolyCollection(region.unproved, **UNPROVED, edgecolor=look.colour, zorder=0.7))
    apart = max(1.0, members / 2)
    strokes = [] if filled else [withTickedStroke(angle=75, spacing=9 * apart, length=0.45 / apart, linewidth=0.7)]
    line = {"linewidths": 1.2, "path_effects": strokes}
    axes.add_collection(LineCollection(region.certain, colors=[look.colour], linestyles=[look.line], **line))
    axes.add_collection(LineCollection(region.doubtful, colors=DOUBTFUL, linestyles="--", zorder=3, **line))


@dataclass(frozen=True)
class Bars:
    """Where bars stand, and how wide: over the values of x, at each of which those of several members are side by side.

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
        return {"colors": [paler(colour, _SHARE) if self.width > _PALE else colour], "linewidths": self.width}


def draw_at_values(axes: Any, bars: Chain, look: Look, at: Bars, span: Span | None = None) -> None:
    """Draw the intervals that are known at values of x alone, as bars there, whose ends have strokes.

    An end of the swept range has none. span: that range, of intervals whose ends do not say whether the range has set them.
    """
    place = {"transform": at.place(axes)}
    bottom, top, least = (*span, _SEEN * (span[1] - span[0])) if span else (-np.inf, np.inf, 0.0)
    for certified, colour in ((True, look.colour), (False, DOUBTFUL)):
        chosen = [(x, interval) for x, interval in bars if interval.certified == certified]
        if chosen:
            spans = np.array([(x, interval.low, interval.high) for x, interval in chosen]).T
            body = at.body(colour) if certified else {"colors": [colour], "linewidths": 0.8, "linestyles": "--"}
            axes.vlines(*spans, **body, **place)
        ends = [(x, e.low) for x, e in chosen if e.low_real and e.low - bottom > least]
        ends += [(x, e.high) for x, e in chosen if e.high_real and top - e.high > least]
        if ends:
            size = max(4.0, at.width + 2)
            axes.plot(*zip(*ends, strict=True), "_", color=colour, markersize=size, clip_on=False, **place)


def draw_unknown_at_values(axes: Any, open_parts: Sequence[tuple[float, float, float]], span: Span, at: Bars) -> None:
    """Draw what is not known at values of x alone, (x, from, to), as ladders there, if it can be seen in the span."""
    open_parts = [open_part for open_part in open_parts if open_part[2] - open_part[1] > _SEEN * (span[1] - span[0])]
    if open_parts:
        rung = 1 / max(at.width, 1.0)  # a dash is measured in widths
        ladder = {"colors": UNKNOWN["edgecolor"], "linewidths": max(at.width, 2.0), "linestyles": [(0, (rung, 2 * rung))]}
        axes.vlines(*np.array(open_parts).T, zorder=0.9, label=LADDER, transform=at.place(axes), **ladder)


def draw_felt(axes: Any, region: Region, look: Look) -> None:
    """Draw the stiffness that the hand feels at the upper ends, if these are limits and not ends of the range."""
    for line in region.felt:
        axes.plot(*zip(*line, strict=True), color=look.colour, linewidth=0.8, linestyle=FELT_LINE, label=FELT)
    single = [(x, interval.felt_high) for x, interval in region.bars if interval.high_real]
    if single:
        axes.plot(*zip(*single, strict=True), "v", color=look.colour, markersize=2.5, label=FELT)


def felt_differs(columns: Columns) -> bool:
    """Whether the hand feels another stiffness at some limit than that of the wall."""
    if "felt_high" not in columns:
        return False
    limit = ~np.isnan(columns["high_omega"]) & ~np.isnan(columns["felt_high"])
    return bool((np.abs(columns["felt_high"] - columns["high"])[limit] > 0.005 * columns["high"][limit]).any())


def draw_for_all(axes: Any, x: str, columns: Columns, span: Span, at: Bars) -> None:
    """Draw what the for_all rows of a plane leave open at each value of x, up to what is refuted, and carets where that begins.

    span: the part of the swept range that the axes show.
    """
    for below, above in _open_parts(columns, span):
        draw_unknown_at_values(axes, list(zip(columns[x].tolist(), below.tolist(), above.tolist(), strict=True)), span, at)
    for name, caret in (("fails_below", DOWN), ("fails_from", UP)):
        rows = np.isfinite(columns[name])
        if rows.any():
            dots = columns[x][rows], columns[name][rows]
            axes.plot(*dots, marker=caret, clip_on=False, transform=at.place(axes), **CARET)


def draw_for_all_bar(axes: Any, place: float, half: float, columns: Columns, span: Span) -> None:
    """The same on the bar of the for_all rows, at `place` with `half` of its height."""
    for below, above in _open_parts(columns, span):
        for low, high in zip(below.tolist(), above.tolist(), strict=True):
            if high - low > _SEEN * (span[1] - span[0]):
                axes.barh(place, high - low, left=low, height=2 * half, **UNKNOWN)
    for name, caret in (("fails_below", LEFT), ("fails_from", RIGHT)):
        ends = columns[name][np.isfinite(columns[name])]
        if ends.size:  # an empty line that is not clipped takes room below the panel
            axes.plot(
                ends, np.full(ends.size, place - 0.6 * half), marker=caret, clip_on=False, **CARET
            )  # the star has the middle


def _open_parts(columns: Columns, span: Span) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield both ends of what is neither proved nor refuted in each row, below and above what is proved; all if nothing is."""
    stable = columns["intervals"] > 0
    yield np.where(stable, np.fmax(columns["fails_below"], span[0]), span[0]), np.where(stable, columns["low"], span[0])
    yield np.where(stable, columns["high"], span[0]), np.where(stable, np.fmin(columns["fails_from"], span[1]), span[1])


def mark_range(axes: Any, columns: Columns, bars: bool = False) -> None:
    """Dot the space beyond the swept range if a stable interval reaches its end.

    An end of the range that is the end of the parameter itself (K_VE = 0) is a limit and not marked. Call it when the limits
    of the axes are set.
    """
    limits = axes.get_xlim() if bars else axes.get_ylim()
    span = axes.axvspan if bars else axes.axhspan
    for end, edge in zip(("low", "high"), limits, strict=True):
        value = range_end(columns, end)
        if value is not None and value != edge:
            span(*sorted((value, edge)), **BEYOND)


def range_end(columns: Columns, end: str) -> float | None:
    """The end of the swept range at which stable intervals are cut off; None if none is, or if it is the parameter's end."""
    from wavesweep.program.spec import find_key

    beyond = columns.get(f"open_{end}", np.full(len(columns["along"]), np.nan)) - columns[end]
    open_ = beyond < 0 if end == "low" else beyond > 0  # an open place is there, and not the end of the range
    cut = (columns["intervals"] > 0) & np.isnan(columns[f"{end}_omega"]) & ~open_
    cut &= columns.get("guarantee", "spec") == "spec"  # an end of what is proved for all has no oscillation
    if not cut.any():
        return None
    extreme = columns[end][cut].min() if end == "low" else columns[end][cut].max()
    key = find_key(str(columns["along"][0]))
    limit = None if key is None else key.low if end == "low" else key.high  # a number of a drawn loop has no end
    return None if limit is not None and float(extreme) == limit else float(extreme)
