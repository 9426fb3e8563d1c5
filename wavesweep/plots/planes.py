"""Stable regions of a plane, drawn from curves; the end of the swept range; several designs side by side."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from wavesweep.plots.refine import KNOWN, NARROW, Curve, Interval, View, curves_of
from wavesweep.plots.style import (
    DOTS_PER_INCH,
    DOUBTFUL,
    ONE_COLUMN,
    TWO_COLUMNS,
    UNKNOWN,
    UNPROVED,
    Look,
    family_looks,
    figure,
    fitting,
    incomplete,
    label,
    wide,
)

_SHADE, _FAINT = 0.22, 0.05
_BEYOND = {"facecolor": "0.93", "edgecolor": "0.65", "hatch": "....", "linewidth": 0, "zorder": 0.4}

Facts = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Plane:
    """One panel: a title, the axis along it, (name, `zwidth` columns, facts) of each design, the top of the axis (N/m).

    mark: a point (x, y) to compare with. note: text in the middle of the panel.
    """

    title: str
    x: str
    designs: Sequence[tuple[str, Mapping[str, np.ndarray], Facts]]
    top: float
    mark: tuple[float, float] | None = None
    note: str = ""


def draw_planes(planes: Sequence[Plane]) -> Any:
    """Draw the panels side by side: the boundaries of stable regions, with strokes to the unstable side."""
    width = wide(ONE_COLUMN if len(planes) == 1 else TWO_COLUMNS)
    with figure(width, 2.8) as canvas:
        grid = np.atleast_1d(canvas.subplots(1, len(planes), sharey=True))
        for axes, plane in zip(grid, planes, strict=True):
            _draw_plane(axes, plane, view_of(plane.x, False, width / len(planes), 2.8))
        along = str(planes[0].designs[0][1]["along"][0])
        grid[0].set_ylabel(label(along))
        names = [name for name, *_ in planes[0].designs]
        canvas.legend(handles=handles_of(names), loc="outside lower center", ncols=fitting(names, width))
    return canvas


def view_of(x: str, logarithmic: bool, width: float, height: float, factors: bool = False) -> View:
    """The view of a panel of `width` by `height` inches with its labels. factors: whether its axis upwards goes by factors."""
    return View(x, logarithmic, 0.8 * DOTS_PER_INCH * width, 0.8 * DOTS_PER_INCH * height, factors)


def _draw_plane(axes: Any, plane: Plane, view: View) -> None:
    looks = family_looks(len(plane.designs))
    for look, (_, columns, facts) in zip(looks, plane.designs, strict=True):
        (curve,) = curves_of([columns], view, facts)
        draw_region(axes, curve, view, look, filled=False)
    if plane.mark is not None:
        axes.plot(*plane.mark, "x", color="black", markersize=7, zorder=4)
    columns = plane.designs[0][1]
    axes.set_xlim(columns[plane.x].min(), columns[plane.x].max())
    axes.set_ylim(0.0, plane.top)
    axes.set_xlabel(label(plane.x))
    axes.set_title(plane.title)
    axes.text(0.5, 0.5, plane.note, ha="center", va="center", transform=axes.transAxes)


def handles_of(names: Sequence[str]) -> list[Any]:
    """Entries of a legend for the members of a family."""
    from matplotlib.lines import Line2D

    looks = family_looks(len(names))
    return [Line2D([], [], color=k.colour, linestyle=k.line, label=name) for k, name in zip(looks, names, strict=True)]


# An interval followed over neighbouring values of x: (x, interval) in order of x.
Chain = list[tuple[float, Interval]]
Line = list[tuple[float, float]]


def draw_region(axes: Any, curve: Curve, view: View, look: Look, filled: bool, shift: float = 0.0) -> None:
    """Draw the known part of a stable region: its area, or strokes from its boundary to the unstable side if not `filled`.

    If the gap between two values of x is not known, a thin bar at each of them shows its intervals; `shift` (points) keeps
    bars of different members apart.
    """
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patheffects import withTickedStroke

    region = region_of(curve, view)
    for left, right in region.unknown:
        axes.axvspan(left, right, **UNKNOWN)
    if region.unknown:  # no hatching under what is known
        axes.add_collection(PolyCollection(region.areas, facecolor="white", linewidth=0, zorder=0.5))
    if filled:  # opaque, with a hairline, so that no seam shows between two outlines
        shade = {"facecolor": _mixed(look.colour), "edgecolor": _mixed(look.colour), "linewidth": 0.4, "zorder": 0.6}
    else:
        shade = {"facecolor": look.colour, "alpha": _FAINT, "linewidth": 0}
    axes.add_collection(PolyCollection(region.areas, **shade))
    if filled:  # what is stable and not certified is dotted
        axes.add_collection(PolyCollection(region.unproved, **UNPROVED, edgecolor=look.colour, zorder=0.7))
    strokes = [] if filled else [withTickedStroke(angle=75, spacing=9, length=0.45, linewidth=0.7)]
    line = {"linewidths": 1.2, "path_effects": strokes}
    axes.add_collection(LineCollection(region.certain, colors=[look.colour], linestyles=[look.line], **line))
    axes.add_collection(LineCollection(region.doubtful, colors=DOUBTFUL, linestyles="--", zorder=3, **line))
    _draw_bars_at(axes, region.bars, look, shift)


@dataclass(frozen=True)
class Region:
    """What a picture shows of a curve.

    areas: outlines of what is stable. unproved: those of its parts that are not certified. certain, doubtful: lines along its
    boundary, the unstable side at their left. bars: (x, interval) at values of x beside which nothing is known. unknown: (from,
    to) of x that are known in part, outside the areas, and gaps that are not known beside others that are.
    """

    areas: list[Line]
    unproved: list[Line]
    certain: list[Line]
    doubtful: list[Line]
    bars: Chain
    unknown: list[tuple[float, float]]


def region_of(curve: Curve, view: View) -> Region:
    """The areas, lines, and bars of a curve, for figures and for the page of `explore`."""
    chains, jumps, seams, bars = _followed(curve)
    return Region(
        areas=[_outline(chain) for chain in chains if len(chain) > 1] + seams,
        unproved=[
            _outline(part)
            for chain in chains
            for part in _stretches([(x, e, True, e.certified) for x, e in chain], certified=False)
        ],
        certain=[line for chain in chains for line in _boundary(chain, certified=True)] + jumps,
        doubtful=[line for chain in chains for line in _boundary(chain, certified=False)],
        bars=bars,
        unknown=[
            *_unknown_cells(curve, view),
            *(gap for gap in pairwise(sorted(curve.columns)) if curve.gaps and gap not in curve.gaps),
        ],
    )


def _mixed(colour: Any) -> tuple[float, ...]:
    from matplotlib.colors import to_rgb

    return tuple(1 - _SHADE * (1 - part) for part in to_rgb(colour))


def _draw_bars_at(axes: Any, bars: Chain, look: Look, shift: float) -> None:
    """Draw the intervals at single values of x, with a short stroke at each end of the stable set."""
    from matplotlib.transforms import ScaledTranslation

    place = {"transform": axes.transData + ScaledTranslation(shift / 72, 0, axes.figure.dpi_scale_trans)}
    for certified in (True, False):
        chosen = [(x, each) for x, each in bars if each.certified == certified]
        if chosen:
            colour = look.colour if certified else DOUBTFUL
            places, found = zip(*chosen, strict=True)
            low, high = [each.low for each in found], [each.high for each in found]
            style = look.line if certified else "--"
            axes.vlines(places, low, high, colors=[colour], linewidths=0.8, linestyles=style, **place)
            ends = [(x, e.low) for x, e in chosen if e.low_real] + [(x, e.high) for x, e in chosen if e.high_real]
            if ends:
                axes.plot(*zip(*ends, strict=True), "_", color=colour, markersize=4, **place)


def draw_felt(axes: Any, curve: Curve, look: Look) -> None:
    """Draw the stiffness that the hand feels at the upper ends, if these are limits and not ends of the range."""
    chains, _, _, bars = _followed(curve)
    for chain in chains:
        ends = [(x, e.felt_high, e.high_real and e.felt_high == e.felt_high, e.certified) for x, e in chain]
        for line in (*_stretches(ends, True), *_stretches(ends, False)):
            axes.plot(*zip(*line, strict=True), color=look.colour, linewidth=0.8, linestyle=FELT_LINE)
    single = [(x, e.felt_high) for x, e in bars if e.high_real]
    if single:
        axes.plot(*zip(*single, strict=True), "v", color=look.colour, markersize=2.5)


FELT_LINE = (0, (1, 1.2))


def felt_differs(columns: Mapping[str, np.ndarray]) -> bool:
    """Whether the hand feels another stiffness at some limit than that of the wall."""
    if "felt_high" not in columns:
        return False
    limit = ~np.isnan(columns["high_omega"]) & ~np.isnan(columns["felt_high"])
    return bool((np.abs(columns["felt_high"] - columns["high"])[limit] > 0.005 * columns["high"][limit]).any())


def _unknown_cells(curve: Curve, view: View) -> Iterator[tuple[float, float]]:
    """Give the cells about the partly known values of x, half way to their neighbours."""
    found = curve.slices()
    places = [x for x, *_ in found]
    middle = [view.between(left, right, 2)[0] for left, right in pairwise(places)]
    for left, right, (_, _, unknown) in zip([places[0], *middle], [*middle, places[-1]], found, strict=True):
        if unknown:
            yield left, right


def _followed(curve: Curve) -> tuple[list[Chain], list[Line], list[Line], Chain]:
    """Follow each interval over the gaps that are known.

    Returns chains; lines across x at which intervals begin, end, part or jump; outlines of the set common to both sides of
    such a narrow gap; and the intervals beside gaps that are not known, for bars.
    """
    found = curve.slices()
    growing: dict[int, Chain] = dict(enumerate([[(found[0][0], each)] for each in found[0][1]]))
    chains, jumps, seams, bars = [], [], [], []
    alone = True
    for (left, before, *less), (right, after, *more) in pairwise(found):
        gap = curve.gaps.get((left, right))
        kept = {}
        if gap == KNOWN:
            kept = {index: index for index in range(len(after))}
        elif gap == NARROW:
            kept = _partners(before, after)
            if not any(less + more):  # an interval that is not known has not ended
                jumps += [*_jumps(left, before, right, after), *_around(left, before, right, after)]
                seams += _seams(left, before, right, after, kept)
        else:
            bars += [(left, each) for each in before] * alone + [(right, each) for each in after]
        alone = gap is not None
        grown = {}
        for index, interval in enumerate(after):
            grown[index] = [*(growing.pop(kept[index]) if index in kept else []), (right, interval)]
        chains += growing.values()
        growing = grown
    if len(found) == 1:
        bars = [(found[0][0], each) for each in found[0][1]]
    return chains + list(growing.values()), jumps, seams, bars


def _partners(before: Sequence[Interval], after: Sequence[Interval]) -> dict[int, int]:
    """Index in `after` -> index in `before`, for pairs of intervals that overlap only each other."""
    overlaps = [(i, j) for i, a in enumerate(before) for j, b in enumerate(after) if a.low < b.high and b.low < a.high]
    first, second = [i for i, _ in overlaps], [j for _, j in overlaps]
    return {j: i for i, j in overlaps if first.count(i) == 1 and second.count(j) == 1}


def _seams(left: float, before: Sequence[Interval], right: float, after: Sequence[Interval], kept: dict) -> list[Line]:
    common = [
        (max(a.low, b.low), min(a.high, b.high)) for i, a in enumerate(before) for j, b in enumerate(after) if kept.get(j) != i
    ]
    return [[(left, low), (left, high), (right, high), (right, low)] for low, high in common if low < high]


def _jumps(left: float, before: Sequence[Interval], right: float, after: Sequence[Interval]) -> list[Line]:
    """Lines across a narrow gap: down if the left side is stable alone, up if the right side is, so that the unstable side
    is at their left.
    """
    lines = []
    for x, these, those, down in ((left, before, after, True), (right, after, before, False)):
        for each in these:
            for low, high in _less(each, those):
                lines.append([(x, high), (x, low)] if down else [(x, low), (x, high)])
    return lines


def _around(left: float, before: Sequence[Interval], right: float, after: Sequence[Interval]) -> Iterator[Line]:
    """Lines along the outer ends of an interval that parts across a narrow gap, or of several that become one."""
    for x, these, end, those in ((left, before, right, after), (right, after, left, before)):
        for each in these:
            parts = [o for o in those if o.low < each.high and each.low < o.high]
            if len(parts) > 1 and all(o.certified for o in (each, *parts)):
                if each.high_real and parts[-1].high_real:
                    yield sorted([(x, each.high), (end, parts[-1].high)])
                if each.low_real and parts[0].low_real:
                    yield sorted([(x, each.low), (end, parts[0].low)], reverse=True)


def _less(each: Interval, others: Sequence[Interval]) -> Iterator[tuple[float, float]]:
    """The parts of an interval that others do not cover; but not those beside an interval that it goes on in alone."""
    low = each.low
    touching = [o for o in others if o.low < each.high and each.low < o.high]
    for other in touching:
        if other.low > low and other is not touching[0]:
            yield low, other.low
        low = max(low, other.high)
    if not touching:
        yield each.low, each.high


def _outline(chain: Chain) -> Line:
    return [(x, each.high) for x, each in chain] + [(x, each.low) for x, each in reversed(chain)]


def _boundary(chain: Chain, certified: bool) -> Iterator[Line]:
    """Return the lines along both real ends, either the certified ones or the others; the unstable side is at their left."""
    yield from _stretches([(x, e.low, e.low_real, e.certified) for x, e in reversed(chain)], certified)
    yield from _stretches([(x, e.high, e.high_real, e.certified) for x, e in chain], certified)


def _stretches(ends: list[tuple[float, Any, bool, bool]], certified: bool) -> Iterator[list[tuple[float, Any]]]:
    """Join pieces that touch to one line, for its dashes; a piece is certified if both of its ends are."""
    line: list[tuple[float, Any]] = []
    for (x, value, real, sure), (next_x, next_value, next_real, next_sure) in pairwise(ends):
        if real and next_real and (sure and next_sure) == certified:
            line = [*(line or [(x, value)]), (next_x, next_value)]
        elif line:
            yield line
            line = []
    if line:
        yield line


def mark_range(axes: Any, columns: Mapping[str, np.ndarray], bars: bool = False) -> None:
    """Dot the space beyond the swept range if a stable interval reaches its end.

    An end of the range that is the end of the parameter itself (K_VE = 0) is a limit and not marked. Call it when the limits
    of the axes are set.
    """
    limits = axes.get_xlim() if bars else axes.get_ylim()
    span = axes.axvspan if bars else axes.axhspan
    beyond = [range_end(columns, end) for end in ("low", "high")]
    for value, edge in zip(beyond, limits, strict=True):
        if value is not None and value != edge:
            span(*sorted((value, edge)), **_BEYOND)


def range_end(columns: Mapping[str, np.ndarray], end: str) -> float | None:
    """The end of the swept range at which stable intervals are cut off; None if none is, or if it is the parameter's end."""
    from wavesweep.spec import find_key

    cut = (columns["intervals"] > 0) & np.isnan(columns[f"{end}_omega"]) & ~incomplete(columns)
    cut &= columns.get("guarantee", "spec") == "spec"  # an end of what is proved for all has no oscillation
    if not cut.any():
        return None
    extreme = columns[end][cut].min() if end == "low" else columns[end][cut].max()
    key = find_key(str(columns["along"][0]))
    own = None if key is None else key.low if end == "low" else key.high  # a number of a drawn loop has no end
    return None if own is not None and float(extreme) == own else float(extreme)


def range_handle() -> Any:
    """The entry of a legend for the space beyond the swept range."""
    from matplotlib.patches import Patch

    return Patch(**_BEYOND, label="beyond the swept range")
