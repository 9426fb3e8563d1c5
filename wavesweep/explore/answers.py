"""The answers of a page: the numbers of one design, its stable intervals, and a plane of two
parameters, as JSON has them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import chain, pairwise
from types import MappingProxyType

import numpy as np

from wavesweep.capabilities import asked
from wavesweep.engine.errors import WavesweepError
from wavesweep.engine.response import Lifted, respond
from wavesweep.explore.sliders import taken
from wavesweep.haptics.felt import FELT
from wavesweep.program.analyses.interval_jobs import Way, cost_of, job_over
from wavesweep.program.analyses.own_design import own_design
from wavesweep.program.analyses.plane_columns import (
    PlaneCurve,
    View,
    curves_of,
    known_gaps,
)
from wavesweep.program.analyses.response_jobs import doubt_of
from wavesweep.program.analyses.spec_loops import loop_at_hand, radius_over
from wavesweep.program.columns import complex_columns
from wavesweep.program.plots.plane_regions import region_of
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.sweep.grid import make_grid
from wavesweep.program.sweep.running import in_memory

COLUMNS = 61  # of a plane, before a figure computes more
FEWEST_COLUMNS = 9  # of a plane whose columns take long
LOOKED_AT = 33  # values of y, evenly and towards the low end, by which its range is chosen
ROOM_OF_PLANE = 1.25  # times the highest limit, in two digits: up to where a plane goes
PIXELS = (800, 400)  # of the plane


@dataclass(frozen=True, slots=True)
class Plane:
    """The plane of two parameters. x, y: their paths, x_span, y_span: the range that is shown."""

    x: str
    y: str
    x_span: tuple[float, float]
    y_span: tuple[float, float]

    @classmethod
    def of(cls, given: Mapping[str, object]) -> Plane:
        """The plane that a page asks for. Errors: KeyError, TypeError or ValueError for anything
        else."""
        x = given["x"]
        y = given["y"]
        if not (isinstance(x, str) and isinstance(y, str) and x != y):
            raise ValueError("expected two different keys")
        return cls(x, y, span_of(given["x_span"]), span_of(given["y_span"]))


def span_of(given: Iterable[float]) -> tuple[float, float]:
    """A span that a page asks for. Errors: TypeError or ValueError for anything else."""
    low, high = map(float, given)
    if not (np.isfinite([low, high]).all() and low < high):
        raise ValueError("expected a span")
    return low, high


def quick(spec: Spec, with_response: bool = True) -> dict:
    """The numbers of the spec's own design and, if it is wanted, its response at the hand."""
    if spec.drawing and spec.drawing.hand is None:
        loop = None
    else:
        loop = loop_at_hand(spec)
    design = own_design(spec, loop)
    for numbers in asked("on_check", "numbers", spec):
        design |= numbers
    answer = {"own": design}
    if with_response:
        answer["response"] = response(spec, loop)
    return answer


def preview(
    spec: Spec, plane: Plane, cells: int, search: Mapping[str, tuple[float, float]], by_gain: bool
) -> dict:
    """The fastest preview of a plane and, if y is a gain, see `is_gain`, the intervals through the
    design.

    By proved columns if y is a gain, and otherwise by so many cells along each side; without any
    this plane is left out. search: path -> range of the stable intervals through the design.
    """
    answer = {}
    if by_gain:
        answer["ranges"] = [stable_ranges(spec, path, span) for path, span in search.items()]
    if cells and by_gain:
        curve, view = _columns(spec, plane, np.linspace(*plane.x_span, COLUMNS // 2 + 1))
        low, high = plane.y_span
        # A preview is right to 2 pixels.
        gaps = known_gaps(curve.columns, view, 2 * (high - low) / view.high)
        answer["plane"] = {**plane_of(PlaneCurve(curve.columns, gaps), view), "how": "columns"}
    elif cells:
        # the plane by the eigenvalues in the middle of so many cells along each side
        x = np.linspace(*plane.x_span, 2 * cells + 1)[1::2]
        y = np.linspace(*plane.y_span, 2 * cells + 1)[1::2]
        axes = (_axis(spec, plane.x, x), _axis(spec, plane.y, y))
        radii = radius_over(spec, axes).reshape(cells, cells)
        stable = (radii < 1).astype(object) * 1
        stable[np.isnan(radii)] = None  # not known
        answer["plane"] = {
            "how": "cells",
            "x": x.tolist(),
            "y": y.tolist(),
            "stable": stable.tolist(),
        }
    return answer


def is_gain(spec: Spec, plane: Plane) -> bool:
    """Whether intervals along y are those of a single gain of a frame, which take a few
    milliseconds for many values of x."""
    try:
        _, way = cost_of(spec, _axis(spec, plane.y, (), plane.y_span))
    except WavesweepError:
        return False
    return way is Way.CUT


def _axis(spec, path, values, span=None) -> Axis:
    names = {known_path: name for name, known_path in spec.names.symbols.items()}
    low, high = span if span is not None else (float(np.min(values)), float(np.max(values)))
    key = spec.names.keys[path]
    return Axis(
        names.get(path, path),
        path,
        tuple(np.asarray(values).tolist()),
        low,
        high,
        key.structural,
        "linear",
    )


def certified_plane(spec: Spec, plane: Plane) -> dict:
    """The plane by the stable intervals along y of the table, at values of x and, between them,
    of the figure."""
    along = _axis(spec, plane.y, (), plane.y_span)
    seconds, way = cost_of(spec, along)
    count = FEWEST_COLUMNS
    if way is Way.CUT:
        # Seconds that columns which take long may take.
        count = int(np.clip(0.4 / seconds, FEWEST_COLUMNS, COLUMNS))
    across = _axis(spec, plane.x, np.linspace(*plane.x_span, count))
    sweep = {
        "along": along.name,
        across.name: list(across.values),
        along.name: {"start": along.start, "stop": along.stop},
    }
    facts = {"spec": {**spec.tables(), "sweep": sweep}}
    return plane_of(*_columns(spec, plane, across.values, facts))


def _columns(spec, plane, x, facts=MappingProxyType({})) -> tuple[PlaneCurve, View]:
    """The stable intervals along y at some values of x and, with facts, where a figure of these
    asks for more."""
    across = _axis(spec, plane.x, x)
    along = _axis(spec, plane.y, (), plane.y_span)
    rows = in_memory(job_over(make_grid(spec, (across,), plane.y), along))
    view = View(across.name, False, *PIXELS)
    (curve,) = curves_of([rows], view, facts)
    return curve, view


def plane_of(curve: PlaneCurve, view: View) -> dict:
    """The columns of a curve, each with its intervals as (low, high, certified), and what a picture
    shows of it, see `Region`.

    known: which gaps between the columns are known. partly: whether other intervals of the column
    may be missing. lines: the certified parts of the boundary. bars: (x, low, high, certified).
    unknown: (from, to, low, high), the last two None of what is not known outside the areas.
    """
    region = region_of(curve, view)
    places = sorted(curve.columns)
    columns = []
    partly = []
    for x in places:
        intervals, open_spans = curve.columns[x]
        columns.append(
            [(interval.low, interval.high, interval.certified) for interval in intervals]
        )
        partly.append(bool(open_spans))
    unknown = []
    for left, right, low, high in region.unknown:
        everywhere = np.isinf(low)
        unknown.append((left, right, None, None) if everywhere else (left, right, low, high))
    return {
        "how": "certified",
        "x": places,
        "columns": columns,
        "known": [gap in curve.gaps for gap in pairwise(places)],
        "partly": partly,
        "areas": region.areas,
        "unproved": region.unproved,
        "lines": region.certain,
        "doubtful": region.doubtful,
        "bars": [(x, bar.low, bar.high, bar.certified) for x, bar in region.bars],
        "unknown": unknown,
    }


ENDS = ("low", "high", "low_omega", "high_omega", "certified", "doubt", "residual")
INTERVAL = (*ENDS, *FELT, "low_hz", "high_hz", "open_places", "open_low", "open_high")


def stable_ranges(spec: Spec, path: str, span: tuple[float, float]) -> dict:
    """The stable intervals of the spec's own design along a number within a span, as rows of the
    table of `zwidth`."""
    rows = in_memory(job_over(make_grid(spec, (), path), _axis(spec, path, (), span)))
    columns = {name: rows[name].tolist() for name in INTERVAL}
    intervals = []
    for row in np.flatnonzero(rows["intervals"]).tolist():
        intervals.append({name: column[row] for name, column in columns.items()})
    return {
        "path": path,
        "span": span,
        "intervals": intervals,
        "certified": bool(rows["certified"].all()),
        "doubt": str(rows["doubt"][0]),
    }


def response(spec: Spec, loop: Lifted | None) -> dict | None:
    """Admittance (m/N) and impedance (N/m) over the frequencies of [bode], as in the table of
    `bode`; None without a hand."""
    if loop is None:
        return None
    frequency = frequencies(spec)
    if spec.drawing:
        slow = None
    else:
        slow = spec.values["rates.fast_hz"] / spec.values["rates.ratio"] / 2
    at_hand = respond(loop, frequency)
    admittance = at_hand.admittance.ravel()
    impedance = at_hand.impedance.ravel()
    errors = at_hand.admittance_error.ravel(), at_hand.impedance_error.ravel()
    doubts = doubt_of(errors, True, ~np.isfinite(admittance))
    columns = complex_columns("admittance", admittance) | complex_columns("impedance", impedance)
    sizes_and_phases = {
        name: column.tolist() for name, column in columns.items() if name.endswith(("_abs", "_deg"))
    }
    return {
        "frequency_hz": frequency.tolist(),
        **sizes_and_phases,
        "doubt": sorted(set(doubts.tolist()) - {""}),
        "error": float(np.nanmax(np.concatenate(errors), initial=0.0)),
        "slow_nyquist_hz": slow,
    }


def frequencies(spec: Spec) -> np.ndarray:
    """Frequencies in Hz, evenly over the decades that the spec's [bode] has."""
    if spec.drawing:
        rate = spec.drawing.rate(spec.values)
    else:
        rate = spec.values["rates.fast_hz"]
    wanted = [f for f in spec.frequency_hz if 0 < f <= rate / 2] or [rate / 1e4, rate / 2]
    # 90 frequencies of a response.
    return np.unique(np.clip(np.geomspace(min(wanted), max(wanted), 90), None, rate / 2))


def first_plane(spec: Spec, sliders) -> Plane | None:
    """The plane that a page begins with: of what is swept the wall first, then the wall's;
    None if it has no two numbers."""
    smooth = {slider.path: slider for slider in sliders if slider.search}
    if len(smooth) < 2:
        return None
    along = spec.names.find(spec.along) if spec.along else None
    swept = [along.path] if along else []
    swept += [axis.path for axis in spec.sweep]
    candidates = [path for path in spec.wall if path in swept]
    candidates += [*swept, *spec.wall, *smooth]
    y, x, *_ = dict.fromkeys(path for path in candidates if path in smooth)
    across = smooth[x]
    return fitted(spec, smooth, x, y, across.search if across.values else (across.low, across.high))


def fitted(
    spec: Spec, sliders, x: str, y: str, x_span: tuple[float, float], widest: float = 1.0
) -> Plane:
    """The plane of two numbers with ranges that show the boundary, if it has one, and the design.

    sliders: by their paths. The range of y ends a little above the highest limit of stability, if
    there is one within the range that is searched, or within up to `widest` times this.
    """
    up = sliders[y]
    x_span = _with(spec, sliders[x], *x_span)
    whole_plane = Plane(x, y, x_span, _with(spec, up, min(up.search[0], up.low), up.search[1]))
    low, high = whole_plane.y_span
    factor = 1.0
    while factor <= widest:
        end = low + factor * (high - low)
        plane = Plane(x, y, x_span, (low, end))
        try:
            columns = _highest_limits(spec, plane)
        except WavesweepError:  # somewhere in the range there is no loop
            return whole_plane
        limits = [high for high in chain.from_iterable(columns) if high < end]
        if limits:
            top = low + float(f"{ROOM_OF_PLANE * (max(*limits, up.value) - low):.2g}")
            return Plane(x, y, x_span, (low, min(top, end)))
        if not all(columns):
            return whole_plane
        factor *= 8.0  # times the range in which no limit is found
    return whole_plane


def _highest_limits(spec: Spec, plane: Plane) -> list[list[float]]:
    """Where stable intervals along y end, at some values of x; if y is no gain, which takes long,
    by the eigenvalues at some values of y, more of them near the low end."""
    x = np.linspace(*plane.x_span, FEWEST_COLUMNS)
    if is_gain(spec, plane):
        curve, _ = _columns(spec, plane, x)
        return [[interval.high for interval in found] for found, _ in curve.columns.values()]
    low, high = plane.y_span
    shares = np.union1d(np.linspace(0.0, 1.0, LOOKED_AT), np.geomspace(1e-4, 1.0, LOOKED_AT))
    y = low + (high - low) * shares
    axes = (_axis(spec, plane.x, x), _axis(spec, plane.y, y))
    stable = radius_over(spec, axes).reshape(x.size, y.size) < 1
    ends = stable & ~np.append(stable[:, 1:], np.zeros((x.size, 1), bool), 1)
    return [y[column].tolist() for column in ends]


def _with(spec, slider, low, high):
    """A range with the slider's value in it, and space beyond this, as far as the spec takes it."""
    value = slider.value
    beyond = value + 0.05 * (max(high, value) - low)  # of a plane that is left beyond the design
    first = taken(spec, slider.path, value, min(low, value))
    last = taken(spec, slider.path, value, max(high, beyond))
    return first, last
