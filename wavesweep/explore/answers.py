"""The answers of a page: the numbers of one design, its stable intervals, and a plane of two parameters, as JSON has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from wavesweep.capabilities import asked
from wavesweep.engine.errors import WavesweepError
from wavesweep.engine.monodromy.cut import LinearFractional
from wavesweep.engine.response.lifted import Lifted
from wavesweep.engine.response.steady import respond
from wavesweep.explore.plane import quick_columns, refined_curve
from wavesweep.explore.sliders import taken
from wavesweep.haptics.controller_page import wall_cut
from wavesweep.haptics.controllers import WALL
from wavesweep.haptics.felt import FELT
from wavesweep.program.analyses.interval_jobs import Way, cost_of, job_over
from wavesweep.program.analyses.own_design import own_design
from wavesweep.program.analyses.plane_columns import NARROW, Interval, PlaneCurve, View, curves_of, known_gaps
from wavesweep.program.analyses.response_jobs import doubt_of
from wavesweep.program.analyses.spec_loops import loop_at_hand, radius_over
from wavesweep.program.columns import complex_columns
from wavesweep.program.plots.plane_regions import region_of
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.sweep.grid import make_grid
from wavesweep.program.sweep.running import in_memory

COLUMNS, FEWEST = 61, 9  # of a plane, before a figure computes more
SECONDS = 0.4  # that these may take
POINTS = 90  # frequencies of a response
ROUNDS = 6  # of false position for the intervals through the design
EDGE = 0.05  # of a plane that is left beyond the design
ROOM, WIDER = 1.25, 8.0  # times the highest limit, in two digits; times the range in which none is found
PIXELS = (800, 400)  # of the plane
ROUGH, FINER = 2, 8  # pixels to which a preview is right, and parts of its cells where lines are not


@dataclass(frozen=True, slots=True)
class Plane:
    """The plane of two parameters. x, y: their paths, x_span, y_span: the range that is shown."""

    x: str
    y: str
    x_span: tuple[float, float]
    y_span: tuple[float, float]

    @classmethod
    def of(cls, given: Mapping[str, object]) -> Plane:
        """The plane that a page asks for. Errors: KeyError, TypeError or ValueError for anything else."""
        x, y = given["x"], given["y"]
        spans = [tuple(float(end) for end in given[name]) for name in ("x_span", "y_span")]
        if not (isinstance(x, str) and isinstance(y, str) and x != y):
            raise ValueError("expected two different keys")
        if not all(len(span) == 2 and np.isfinite(span).all() and span[0] < span[1] for span in spans):
            raise ValueError("expected two spans")
        return cls(x, y, *spans)


def quick(spec: Spec, with_response: bool = True) -> dict:
    """The numbers of the spec's own design and, if it is wanted, its response at the hand."""
    loop = None if spec.drawing and spec.drawing.hand is None else loop_at_hand(spec)
    design = own_design(spec, loop)
    for numbers in asked("on_check", "numbers", spec):
        design |= numbers
    return {"own": design} | ({"response": response(spec, loop)} if with_response else {})


def preview(spec: Spec, plane: Plane, cells: int, search: Mapping[str, tuple[float, float]], by_gain: bool) -> dict:
    """The fastest preview of a plane, and the intervals through the design if these come with it.

    By the boundary's explicit curve if the plane is that of a wall, by proved columns if y is a gain, see `is_gain`, and
    otherwise by so many cells along each side; without any this plane is left out, and so are columns. search: path -> range of
    the stable intervals through the design.
    """
    cut = None if spec.drawing else wall_cut(spec.values)
    if cut is not None and {plane.x, plane.y} == set(WALL):
        return _by_curve(spec, cut, plane, search)
    if not cells:
        return {}
    if by_gain or (cut is not None and plane.y in WALL):
        curve, view = _columns(spec, plane, np.linspace(*plane.x_span, COLUMNS // 2 + 1))
        gaps = known_gaps(curve.columns, view, ROUGH * (plane.y_span[1] - plane.y_span[0]) / view.high)
        return {"plane": plane_of(PlaneCurve(curve.columns, gaps), view) | {"how": "columns"}}
    return {"plane": _cell_plane(spec, plane, cells)}


def is_gain(spec: Spec, plane: Plane) -> bool:
    """Whether intervals along y are those of a single gain of a frame, which take a few milliseconds for many values of x."""
    try:
        return cost_of(spec, _axis(spec, plane.y, (), plane.y_span))[1] is Way.CUT
    except WavesweepError:
        return False


def _by_curve(spec, cut: LinearFractional, plane: Plane, search) -> dict:
    """The wall's plane and the intervals through the design by the boundary's explicit curve; K_VE may be either axis."""
    solved = WALL.index(plane.y)
    theta, walls = refined_curve(cut, (plane.x_span, plane.y_span) if solved else (plane.y_span, plane.x_span))
    ranges = []
    for path, span in search.items():
        at, other_value = WALL.index(path), np.array([spec.values[WALL[1 - WALL.index(path)]]])
        pairs = quick_columns(cut, theta, walls, at, other_value, span, ROUNDS)[0]
        ranges.append({"path": path, "span": span, "intervals": [{"low": low, "high": high} for low, high in pairs]})
    shape = _preview(plane, lambda x: quick_columns(cut, theta, walls, solved, np.array(x), plane.y_span))
    return {"plane": shape | {"how": "curve", "angles": theta.size}, "ranges": ranges}


def _preview(plane, columns_at) -> dict:
    """The plane by columns without a proof, which lie closer together where lines between them are not right.

    columns_at: gives a list of intervals for each of some values of x.
    """
    (low, high), view, intervals_at, gaps = plane.y_span, View(plane.x, False, *PIXELS), {}, {}
    places, cells = np.linspace(*plane.x_span, COLUMNS).tolist(), []
    for _ in range(2):
        for x, column in zip(places, columns_at(places) if places else [], strict=True):
            intervals_at[x] = tuple(Interval(*ends, ends[0] > low, ends[1] < high, False) for ends in column), ()
        for points in cells or [places]:
            gaps |= known_gaps({x: intervals_at[x] for x in points}, view, ROUGH * (high - low) / view.high)
        cells = [[a, *view.between(a, b, FINER), b] for a, b in pairwise(sorted(intervals_at)) if (a, b) not in gaps]
        places = [x for points in cells for x in points[1:-1]]
    gaps |= {gap: NARROW for gap in pairwise(sorted(intervals_at)) if gap not in gaps}
    return plane_of(PlaneCurve(intervals_at, gaps), view)


def _cell_plane(spec: Spec, plane: Plane, cells: int) -> dict:
    """The plane by the eigenvalues in the middle of so many cells along each side."""
    x, y = (np.linspace(*span, 2 * cells + 1)[1::2] for span in (plane.x_span, plane.y_span))
    axes = tuple(_axis(spec, *pair) for pair in ((plane.x, x), (plane.y, y)))
    stable = (radius_over(spec, axes) < 1).reshape(cells, cells)
    return {"how": "cells", "x": x.tolist(), "y": y.tolist(), "stable": stable.astype(int).tolist()}


def _axis(spec, path, values, span=None) -> Axis:
    names = {known_path: name for name, known_path in spec.names.symbols.items()}
    low, high = span if span is not None else (float(np.min(values)), float(np.max(values)))
    key = spec.names.keys[path]
    return Axis(names.get(path, path), path, tuple(np.asarray(values).tolist()), low, high, key.structural, "linear")


def certified_plane(spec: Spec, plane: Plane) -> dict:
    """The plane by the stable intervals along y of the table, at values of x and, between them, of the figure."""
    along = _axis(spec, plane.y, (), plane.y_span)
    seconds, way_of = cost_of(spec, along)
    count = int(np.clip(SECONDS / seconds, FEWEST, COLUMNS)) if way_of is Way.CUT else FEWEST
    across = _axis(spec, plane.x, np.linspace(*plane.x_span, count))
    sweep = {"along": along.name, across.name: list(across.values), along.name: {"start": along.start, "stop": along.stop}}
    return plane_of(*_columns(spec, plane, across.values, {"spec": {**spec.tables(), "sweep": sweep}}))


def _columns(spec, plane, x, facts=MappingProxyType({})) -> tuple[PlaneCurve, View]:
    """The stable intervals along y at some values of x and, with facts, where a figure of these asks for more."""
    axes = _axis(spec, plane.x, x), _axis(spec, plane.y, (), plane.y_span)
    rows = in_memory(job_over(make_grid(spec, axes[:1], plane.y), axes[1]))
    view = View(axes[0].name, False, *PIXELS)
    return curves_of([rows], view, facts)[0], view


def plane_of(curve: PlaneCurve, view: View) -> dict:
    """The columns of a curve, each with its intervals as (low, high, certified), and what a picture shows of it, see `Region`.

    known: which gaps between the columns are known. partly: whether other intervals of the column may be missing. lines: the
    certified parts of the boundary. bars: (x, low, high, certified). unknown: (from, to, low, high), the last two None of what
    is not known outside the areas.
    """
    region, places = region_of(curve, view), sorted(curve.columns)
    columns = [curve.columns[x] for x in places]
    return {
        "how": "certified",
        "x": places,
        "columns": [[(interval.low, interval.high, interval.certified) for interval in intervals] for intervals, _ in columns],
        "known": [gap in curve.gaps for gap in pairwise(places)],
        "partly": [bool(spans) for _, spans in columns],
        "areas": region.areas,
        "unproved": region.unproved,
        "lines": region.certain,
        "doubtful": region.doubtful,
        "bars": [(x, bar.low, bar.high, bar.certified) for x, bar in region.bars],
        "unknown": [(*cell, *(None if np.isinf(end) else end for end in (low, high))) for *cell, low, high in region.unknown],
    }


ENDS = ("low", "high", "low_omega", "high_omega", "certified", "doubt", "residual")
INTERVAL = (*ENDS, *FELT, "low_hz", "high_hz", "open_places", "open_low", "open_high")


def stable_ranges(spec: Spec, path: str, span: tuple[float, float]) -> dict:
    """The stable intervals of the spec's own design along a number within a span, as rows of the table of `zwidth`."""
    rows = in_memory(job_over(make_grid(spec, (), path), _axis(spec, path, (), span)))
    columns = {name: rows[name].tolist() for name in INTERVAL}
    ranges = [dict(zip(INTERVAL, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    stable = [row for row, count in zip(ranges, rows["intervals"].tolist(), strict=True) if count]
    certified = bool(rows["certified"].all())
    return {"path": path, "span": span, "intervals": stable, "certified": certified, "doubt": str(rows["doubt"][0])}


def response(spec: Spec, loop: Lifted | None) -> dict | None:
    """Admittance (m/N) and impedance (N/m) over the frequencies of [bode], as in the table of `bode`; None without a hand."""
    if loop is None:
        return None
    frequency = frequencies(spec)
    slow = None if spec.drawing else spec.values["rates.fast_hz"] / spec.values["rates.ratio"] / 2
    at_hand = respond(loop, frequency)
    errors = at_hand.admittance_error.ravel(), at_hand.impedance_error.ravel()
    lost = ~np.isfinite(at_hand.admittance.ravel())
    columns = complex_columns("admittance", at_hand.admittance.ravel()) | complex_columns(
        "impedance", at_hand.impedance.ravel()
    )
    return {
        "frequency_hz": frequency.tolist(),
        **{name: column.tolist() for name, column in columns.items() if name.endswith(("_abs", "_deg"))},
        "doubt": sorted(set(doubt_of(errors, True, lost).tolist()) - {""}),
        "error": float(np.nanmax(np.concatenate(errors), initial=0.0)),
        "slow_nyquist_hz": slow,
    }


def frequencies(spec: Spec) -> np.ndarray:
    """Frequencies in Hz, evenly over the decades that the spec's [bode] has."""
    rate = spec.drawing.rate(spec.values) if spec.drawing else spec.values["rates.fast_hz"]
    wanted = [f for f in spec.frequency_hz if 0 < f <= rate / 2] or [rate / 1e4, rate / 2]
    return np.unique(np.clip(np.geomspace(min(wanted), max(wanted), POINTS), None, rate / 2))


def first_plane(spec: Spec, sliders) -> Plane | None:
    """The plane that a page begins with: the wall's, or of a drawn loop that of its [sweep]; None if it has no two numbers."""
    smooth = {slider.path: slider for slider in sliders if slider.search}
    if len(smooth) < 2:
        return None
    along = spec.names.find(spec.along) if spec.along else None
    swept = [axis.path for axis in spec.sweep if axis.path in smooth]
    order = dict.fromkeys([*spec.wall, *([along.path] if along else []), *swept, *smooth])
    y, x, *_ = [path for path in order if path in smooth]
    across = smooth[x]
    return fitted(spec, smooth, x, y, across.search if across.values else (across.low, across.high))


def fitted(spec: Spec, sliders, x: str, y: str, x_span: tuple[float, float], widest: float = 1.0) -> Plane:
    """The plane of two numbers with ranges that show the boundary, if it has one, and the design.

    sliders: by their paths. The range of y ends a little above the highest limit of stability, if there is one within the range
    that is searched, or within up to `widest` times this.
    """
    up = sliders[y]
    x_span = _with(spec, sliders[x], *x_span)
    whole_plane = Plane(x, y, x_span, _with(spec, up, min(up.search[0], up.low), up.search[1]))
    (low, high), factor = whole_plane.y_span, 1.0
    while factor <= widest:
        plane = Plane(x, y, x_span, (low, low + factor * (high - low)))
        try:
            columns = _columns(spec, plane, np.linspace(*x_span, FEWEST))[0].columns.values()
        except WavesweepError:  # somewhere in the range there is no loop
            return whole_plane
        limits = [interval.high for column, _ in columns for interval in column if interval.high < plane.y_span[1]]
        if limits:
            top = low + float(f"{ROOM * (max(*limits, up.value) - low):.2g}")
            return Plane(x, y, x_span, (low, min(top, plane.y_span[1])))
        if not all(column for column, _ in columns):
            return whole_plane
        factor *= WIDER
    return whole_plane


def _with(spec, slider, low, high):
    """A range with the slider's value in it, and space beyond this, as far as the spec takes it."""
    value = slider.value
    ends = min(low, value), max(high, value + EDGE * (max(high, value) - low))
    return tuple(taken(spec, slider.path, value, end) for end in ends)
