"""How stable regions are drawn: areas and boundaries, what is open under [for_all], and the end of the swept range."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from wavesweep.core.columns import Columns
from wavesweep.core.plots.style import DOTS_PER_INCH, DOUBTFUL, UNKNOWN, UNPROVED, Look, family_looks, paler
from wavesweep.core.tables.planes import Region, View

SHADE = 0.22  # share of its colour that an area has
BEYOND = {"facecolor": "0.93", "edgecolor": "0.65", "hatch": "....", "linewidth": 0, "zorder": 0.4}
CARET = {"color": "#D55E00", "markersize": 4, "linestyle": "none", "zorder": 6}  # seen on the star of the best design
LEFT, RIGHT, UP, DOWN = 8, 9, 10, 11  # carets whose base is at the point
FELT_LINE = (0, (1, 1.2))
ALONE = "alone"  # gid of thin bars

Span = tuple[float, float]


def view_of(x: str, logarithmic: bool, width: float, height: float, factors: bool = False) -> View:
    """The view of a panel of `width` by `height` inches with its labels. factors: whether its axis upwards goes by factors."""
    return View(x, logarithmic, 0.8 * DOTS_PER_INCH * width, 0.8 * DOTS_PER_INCH * height, factors)


def handles_of(names: Sequence[str], looks: Sequence[Look] = ()) -> list[Any]:
    """Entries of a legend for the members of a family."""
    from matplotlib.lines import Line2D

    pairs = zip(looks or family_looks(len(names)), names, strict=True)
    return [Line2D([], [], color=look.colour, linestyle=look.line, label=name) for look, name in pairs]


def draw_region(axes: Any, region: Region, look: Look, filled: bool, shift: float = 0.0, members: int = 1) -> None:
    """Draw the known part of a stable region: its area, or strokes from its boundary to the unstable side if not `filled`.

    If the gap between two values of x is not known, a thin bar at each of them shows its intervals; `shift` (points) keeps
    bars of different members apart. members: of the panel; the strokes of many lines are fewer.
    """
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patheffects import withTickedStroke
    from matplotlib.transforms import ScaledTranslation

    whole = [(left, right) for left, right, low, _ in region.unknown if np.isinf(low)]
    for cell in whole:
        axes.axvspan(*cell, **UNKNOWN)
    if whole:  # no hatching under what is known
        axes.add_collection(PolyCollection(region.areas, facecolor="white", linewidth=0, zorder=0.5))
    places = [[(a, low), (b, low), (b, high), (a, high)] for a, b, low, high in region.unknown if not np.isinf(low)]
    if places:
        axes.add_collection(PolyCollection(places, **UNKNOWN | {"zorder": 0.8}))
    if filled:  # with a hairline, so that no seam shows between two outlines; what is stable and not certified is dotted
        pale = paler(look.colour, SHADE)
        axes.add_collection(PolyCollection(region.areas, facecolor=pale, edgecolor=pale, linewidth=0.4, zorder=0.6))
        axes.add_collection(PolyCollection(region.unproved, **UNPROVED, edgecolor=look.colour, zorder=0.7))
    apart = max(1.0, members / 2)
    strokes = [] if filled else [withTickedStroke(angle=75, spacing=9 * apart, length=0.45 / apart, linewidth=0.7)]
    line = {"linewidths": 1.2, "path_effects": strokes}
    axes.add_collection(LineCollection(region.certain, colors=[look.colour], linestyles=[look.line], **line))
    axes.add_collection(LineCollection(region.doubtful, colors=DOUBTFUL, linestyles="--", zorder=3, **line))
    place = {"transform": axes.transData + ScaledTranslation(shift / 72, 0, axes.figure.dpi_scale_trans)}
    for certified, colour, line in ((True, look.colour, look.line), (False, DOUBTFUL, "--")):
        chosen = [(x, each) for x, each in region.bars if each.certified == certified]
        if chosen:
            spans = np.array([(x, each.low, each.high) for x, each in chosen]).T
            axes.vlines(*spans, colors=[colour], linewidths=0.8, linestyles=line, gid=ALONE, **place)
        ends = [(x, e.low) for x, e in chosen if e.low_real] + [(x, e.high) for x, e in chosen if e.high_real]  # get a stroke
        if ends:
            axes.plot(*zip(*ends, strict=True), "_", color=colour, markersize=4, **place)


def draw_felt(axes: Any, region: Region, look: Look) -> None:
    """Draw the stiffness that the hand feels at the upper ends, if these are limits and not ends of the range."""
    for line in region.felt:
        axes.plot(*zip(*line, strict=True), color=look.colour, linewidth=0.8, linestyle=FELT_LINE)
    single = [(x, each.felt_high) for x, each in region.bars if each.high_real]
    if single:
        axes.plot(*zip(*single, strict=True), "v", color=look.colour, markersize=2.5)


def felt_differs(columns: Columns) -> bool:
    """Whether the hand feels another stiffness at some limit than that of the wall."""
    if "felt_high" not in columns:
        return False
    limit = ~np.isnan(columns["high_omega"]) & ~np.isnan(columns["felt_high"])
    return bool((np.abs(columns["felt_high"] - columns["high"])[limit] > 0.005 * columns["high"][limit]).any())


def draw_for_all(axes: Any, x: str, columns: Columns, span: Span) -> None:
    """Draw what the for_all rows of a plane leave open, as hatches up to what is refuted, and carets where that begins.

    They know it at the swept values of x, between which the hatches are joined. span: the part of the swept range that the
    axes show.
    """
    order = np.argsort(columns[x], kind="stable")
    for below, above in _open_parts(columns, span):
        axes.fill_between(columns[x][order], below[order], np.fmax(below, above)[order], **UNKNOWN)
    for name, caret in (("fails_below", DOWN), ("fails_from", UP)):
        rows = np.isfinite(columns[name])
        if rows.any():
            axes.plot(columns[x][rows], columns[name][rows], marker=caret, clip_on=False, **CARET)


def draw_for_all_bar(axes: Any, place: float, half: float, columns: Columns, span: Span) -> None:
    """The same on the bar of the for_all rows, at `place` with `half` of its height."""
    for below, above in _open_parts(columns, span):
        for low, high in zip(below.tolist(), above.tolist(), strict=True):
            if low < high:
                axes.barh(place, high - low, left=low, height=2 * half, **UNKNOWN)
    for name, caret in (("fails_below", LEFT), ("fails_from", RIGHT)):
        known = columns[name][np.isfinite(columns[name])]
        if known.size:  # an empty line that is not clipped takes room below the panel
            axes.plot(
                known, np.full(known.size, place - 0.6 * half), marker=caret, clip_on=False, **CARET
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
    from wavesweep.core.spec import find_key

    beyond = columns.get(f"open_{end}", np.full(len(columns["along"]), np.nan)) - columns[end]
    open_ = beyond < 0 if end == "low" else beyond > 0  # an open place is there, and not the end of the range
    cut = (columns["intervals"] > 0) & np.isnan(columns[f"{end}_omega"]) & ~open_
    cut &= columns.get("guarantee", "spec") == "spec"  # an end of what is proved for all has no oscillation
    if not cut.any():
        return None
    extreme = columns[end][cut].min() if end == "low" else columns[end][cut].max()
    key = find_key(str(columns["along"][0]))
    own = None if key is None else key.low if end == "low" else key.high  # a number of a drawn loop has no end
    return None if own is not None and float(extreme) == own else float(extreme)
