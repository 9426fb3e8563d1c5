"""Stable regions of a plane: the intervals of a table, and further ones that are computed between
them.

At the values of x that a table has, the intervals are known. Between two of them nothing is known,
however close they are: a region may end there and another may begin. Further columns are therefore
computed by the code of the table: the middles of all cells that are not decided yet, in one batch a
round. A cell is known if the line between its ends is right in its middle to half a pixel. Where
columns are dear, this is asked of the table's own columns first, three by three. An interval that
begins or ends within a cell is located to a pixel, or to LOOSE of them where more are in doubt or
too dear. What is certified at two neighbouring values of the table is joined only by columns that
are certified too.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import isnan, prod
from typing import Any, NamedTuple

import numpy as np

from wavesweep.program.columns import INCOMPLETE, Columns, whose_column
from wavesweep.program.row_kinds import COMPUTED, row_kinds

# hears which share of the further columns is computed
CURVES_LOGGER = logging.getLogger("wavesweep.figure.curves")
# s that the further columns along a wall's number may take, by an estimate, so that equal tables give
# equal pictures; along other numbers columns are dear, and no more of them than the table has
BUDGET = 1.5
# cells along a picture that are examined, however few values the table has: of cheap columns, as far
# as these are affordable, and of dear ones
FEWEST_CELLS, FEWEST_DEAR = 64, 16
LOOSE = 2  # pixels of a cell that is not decided, up to which it is drawn as if it were one
KNOWN, NARROW, UNDECIDED = "known", "narrow", "undecided"


@dataclass(frozen=True, slots=True)
class Interval:
    """A stable interval; an end is real unless the swept range ends there. felt_low, felt_high:
    N/m, NaN if not known."""

    low: float
    high: float
    low_real: bool
    high_real: bool
    certified: bool
    felt_low: float = np.nan
    felt_high: float = np.nan


Span = tuple[float, float]
Column = tuple[tuple[Interval, ...], tuple[Span, ...]]
"""The intervals at one value of x, and the spans in which open places lie, or others may be
missing."""


@dataclass(eq=False)
class PlaneCurve:
    """The intervals of one design over x, and the state of the gaps between neighbouring columns.

    gaps: (x, next x) -> KNOWN (straight lines join the intervals one by one), NARROW (a pixel) or,
    if missing, UNDECIDED. in_table: the values of x that the table has.
    """

    columns: dict[float, Column]
    gaps: dict[tuple[float, float], str] = field(default_factory=dict)
    in_table: frozenset[float] = frozenset()

    @property
    def open_at_ends(self) -> bool:
        """Whether there are bars at the least or at the largest x."""
        gaps = [*pairwise(sorted(self.columns))]
        return any(gap not in self.gaps for gap in gaps[:1] + gaps[-1:])


@dataclass(frozen=True)
class View:
    """The plane of a picture: the axis x and whether it is logarithmic, its size in pixels, and
    the same of the other axis."""

    x: str
    logarithmic: bool
    wide: float
    high: float
    by_factors: bool = False

    def height(self, value: Any) -> Any:
        """The coordinate along the other axis in which the picture is straight; values on a
        scale of factors are positive."""
        return np.log(value) if self.by_factors else value

    def position(self, x: Any) -> Any:
        """The coordinate along x in which the picture is straight."""
        return np.log(x) if self.logarithmic else x

    def closest(self, values: Sequence[float]) -> float:
        """The distance of the two values of x that are next to each other, as a share of the
        picture."""
        places = self.position(np.sort(values))
        if places.size > 1:
            return float(np.diff(places).min() / np.ptp(places))
        return 1.0

    def between(self, low: float, right: float, parts: int) -> list[float]:
        """The points that divide a cell into parts of equal width, without its ends."""
        shares = np.arange(1, parts) / parts
        if self.logarithmic:
            return (low * (right / low) ** shares).tolist()
        return (low + (right - low) * shares).tolist()


def incomplete(columns: Columns) -> np.ndarray:
    """Flags of the rows of slices that are known in part only; figures hatch them outside the
    known stable intervals."""
    whose = columns.get("hand", columns.get("guarantee"))
    apart = [word for word, kind in row_kinds().items() if kind.unsettled]  # drawn by themselves
    drawn_apart = False if whose is None else np.isin(whose.astype(str), apart)
    return np.isin(columns["doubt"].astype(str), INCOMPLETE) & ~np.asarray(drawn_apart)


def curves_of(members: Sequence[Columns], view: View, facts: Mapping[str, Any]) -> list[PlaneCurve]:
    """The curves of some designs over x, with further columns if the facts have the spec that they
    were computed from.

    members: the rows of each design, all of one hand and with the same value of every other axis.
    """
    curves = []
    for rows in members:
        columns = columns_of(rows, rows[view.x])
        curves.append(PlaneCurve(columns, in_table=frozenset(columns)))
    if any(len(curve.columns) > 1 for curve in curves):
        source = _source(members, view.x, facts)
    else:
        source = None
    if source is None:
        return curves
    ends = view.height(np.concatenate([[*rows["low"], *rows["high"]] for rows in members]))
    if not np.isnan(ends).all():
        height = float(np.ptp(ends[~np.isnan(ends)]))
    else:
        height = 0.0
    # Designs that differ only in what their controller does not read are one.
    different = [curves[source.keys.index(key)] for key in source.designs]
    _refine(different, view, height / view.high / 2, source)
    for curve in different:
        _leave_out_doubtful(curve, view)
    return [different[source.designs.index(key)] for key in source.keys]


def seconds_of_curves(spec: Any, axis: Any, axes: Sequence[Any], slice_seconds: float) -> float:
    """Seconds that further columns may take, by an estimate; none are computed if no axis is plain.

    Dear columns are no more than the table has, each as long as one of its slices; those of a cut
    are computed within BUDGET, which is spent in each plane of a figure and counted once. axes: of
    the table; slice_seconds: of one of its slices.
    """
    from wavesweep.program.analyses.interval_jobs import Way, cost_of
    from wavesweep.program.sweep.grid import is_plain

    _, method = cost_of(spec, axis)
    if not any(len(swept.values) > 1 and is_plain(spec, swept.path) for swept in axes):
        return 0.0
    if method is Way.CUT:
        return BUDGET
    return prod(len(swept.values) for swept in axes) * slice_seconds


def columns_of(rows: Columns, places: np.ndarray) -> dict[float, Column]:
    """The intervals at each of the places, in the order of the rows."""
    names = ("low", "high", "low_omega", "high_omega", "certified", "felt_low", "felt_high")
    missing = np.full(len(places), np.nan)
    values = zip(*(rows.get(name, missing).tolist() for name in names), strict=True)
    flags = zip((rows["intervals"] > 0).tolist(), open_spans(rows), strict=True)
    columns: dict[float, Column] = {}
    for place, (low, high, *omegas, certified, felt_low, felt_high), (stable, unknown) in zip(
        places.tolist(), values, flags, strict=True
    ):
        intervals, partly = columns.get(place, ((), ()))
        if stable:  # an omega is NaN if the range ends the interval
            low_real, high_real = (not isnan(omega) for omega in omegas)
            intervals = (
                *intervals,
                Interval(low, high, low_real, high_real, bool(certified), felt_low, felt_high),
            )
        columns[place] = intervals, (*partly, *unknown)
    return columns


def open_spans(rows: Columns) -> list[tuple[Span, ...]]:
    """Of each row the span of its open places; all values in the first row of a slice that is
    known in part, and not where."""
    places = rows.get("open_places", np.zeros(len(rows["interval"]), int))
    everywhere = incomplete(rows) & (places == 0) & (rows["interval"] == 0)
    ends = ("open_low", -np.inf), ("open_high", np.inf)
    low, high = (np.where(everywhere, end, rows.get(name, np.nan)).tolist() for name, end in ends)
    unknown = (everywhere | (places > 0)).tolist()
    return [
        ((first, last),) if is_unknown else ()
        for is_unknown, first, last in zip(unknown, low, high, strict=True)
    ]


class _Cell(NamedTuple):
    """Two neighbouring columns of a curve, by its number, with what is not decided between them."""

    number: int
    start: float
    stop: float

    def width(self, view: View) -> float:
        """The width along x."""
        return view.position(self.stop) - view.position(self.start)


class _Round(NamedTuple):
    """Cells that are examined together.

    points: of each cell, the number of its curve and the values of x with those of its ends.
    wanted: the columns that are computed.
    """

    points: list[tuple[int, list[float]]]
    wanted: list[tuple[int, float]]


def _cells_examined(source: _Source, curves: int) -> int:
    """Into how many cells each of some curves is cut at least, as far as the budget has it."""
    if source.dear:
        return FEWEST_DEAR
    return min(FEWEST_CELLS, max(1, int(BUDGET / source.cost / curves / 4)))


def _refine(curves: list[PlaneCurve], view: View, tolerance: float, source: _Source) -> None:
    """Add columns to the curves until all cells are known or narrow, or the budget is spent."""
    places = [view.position(x) for curve in curves for x in curve.columns]
    width_of_all = float(max(places) - min(places))
    pixel = width_of_all / view.wide
    # Of a cell that its middle may decide.
    widest = width_of_all / _cells_examined(source, len(curves))
    if source.dear:
        for curve in curves:
            curve.gaps |= _gaps_of_neighbours(curve.columns, view, tolerance, widest)
    cells = []
    for number, curve in enumerate(curves):
        cells += _undecided(number, curve, sorted(curve.columns))
    cells.sort(key=lambda cell: cell.width(view), reverse=True)
    seconds_left = BUDGET
    skipped = []
    while cells:
        CURVES_LOGGER.info("%f", 1 - seconds_left / BUDGET)
        examined = _examined(cells, view, source, widest, seconds_left)
        skipped += cells[len(examined.points) :]
        if not examined.wanted:
            break
        seconds_left -= source.cost * len(examined.wanted)
        columns = source.ask(examined.wanted)
        for (number, x), column in zip(examined.wanted, columns, strict=True):
            curves[number].columns[x] = column
        cells = []
        for number, points in examined.points:
            curve = curves[number]
            within = {x: curve.columns[x] for x in points}
            curve.gaps |= known_gaps(within, view, tolerance)
            undecided = _undecided(number, curve, points)
            wide = [cell for cell in undecided if cell.width(view) > pixel]
            _call_narrow(curve, {*undecided} - {*wide})
            cells += wide
    for cell in skipped:
        if cell.width(view) <= LOOSE * pixel:
            _call_narrow(curves[cell.number], [cell])


def _undecided(number: int, curve: PlaneCurve, places: Sequence[float]) -> list[_Cell]:
    """The cells between neighbouring places of a curve that are not decided."""
    return [_Cell(number, *gap) for gap in pairwise(places) if gap not in curve.gaps]


def _call_narrow(curve: PlaneCurve, cells: Iterable[_Cell]) -> None:
    """Draw what lies between the ends of cells as if it were a pixel wide."""
    curve.gaps |= dict.fromkeys(((cell.start, cell.stop) for cell in cells), NARROW)


def _examined(
    cells: Sequence[_Cell], view: View, source: _Source, widest: float, seconds: float
) -> _Round:
    """The first cells whose columns take no more than some seconds. widest: the width of a cell that
    its middle may decide."""
    points: list[tuple[int, list[float]]] = []
    wanted: list[tuple[int, float]] = []
    for cell in cells:
        count = 2 * max(1, int(np.ceil(cell.width(view) / widest / 2)))
        inside = view.between(cell.start, cell.stop, count)
        if source.cost * (len(wanted) + len(inside)) > seconds:
            break
        points.append((cell.number, [cell.start, *inside, cell.stop]))
        wanted += [(cell.number, x) for x in inside]
    return _Round(points, wanted)


def _gaps_of_neighbours(columns, view, tolerance, widest):
    """The gaps of which a line is right over two, by the column between; none is wider than
    `widest`."""
    gaps = {}
    places = sorted(columns)
    for three in zip(places, places[1:], places[2:], strict=False):
        if np.diff(view.position(np.array(three))).max() <= widest:
            gaps |= known_gaps({x: columns[x] for x in three}, view, tolerance)
    return gaps


def _leave_out_doubtful(curve: PlaneCurve, view: View) -> None:
    """Leave out the columns that are in doubt although the table's on both sides of them are
    certified.

    A gap that is left and no wider than LOOSE pixels is narrow; a wider one is not known.
    """
    places = sorted(curve.columns)
    width_of_all = float(np.ptp(view.position(np.array(places))))
    pixel = width_of_all / view.wide
    in_table = [x for x in places if x in curve.in_table]
    doubtful = {x for x in places if _doubtful(curve.columns[x])}
    for before, after in pairwise(in_table):
        if before in doubtful or after in doubtful:
            continue
        inside = [x for x in places if before <= x <= after]
        certain = [x for x in inside if x not in doubtful]
        for x in {*inside} - {*certain}:
            del curve.columns[x]
        for gap in {*pairwise(inside)} - {*pairwise(certain)}:
            curve.gaps.pop(gap, None)
        for start, stop in {*pairwise(certain)} - {*pairwise(inside)}:
            if view.position(stop) - view.position(start) <= LOOSE * pixel:
                curve.gaps[start, stop] = NARROW


def known_gaps(
    columns: Mapping[float, Column], view: View, tolerance: float
) -> dict[tuple[float, float], str]:
    """The gaps of columns, two by two, in which lines are right to the tolerance (see
    `View.height`), by the middle column."""
    places = sorted(columns)
    gaps: dict[tuple[float, float], str] = {}
    for a, middle, b in zip(places[:-2:2], places[1::2], places[2::2], strict=True):
        if _is_straight(columns[a], columns[middle], columns[b], view, tolerance):
            gaps |= dict.fromkeys(((a, middle), (middle, b)), KNOWN)
    return gaps


def _is_straight(
    before: Column, middle: Column, after: Column, view: View, tolerance: float
) -> bool:
    """Whether all three columns have the same intervals, and those in the middle lie on lines
    between the others.

    An end may be that of the swept range on one side: a line to it is as right as any other.
    """
    numbers = set()
    ends = []
    for intervals, unknown in (before, middle, after):
        numbers.add((len(intervals), bool(unknown)))
        ends.append([(interval.low, interval.high) for interval in intervals])
    if len(numbers) > 1:
        return False
    first, centre, last = view.height(np.array(ends))
    return bool((np.abs(centre - (first + last) / 2) <= tolerance).all())


def spec_of(facts: Mapping[str, Any]) -> Any:
    """The spec in the facts of a run, None if there is none."""
    if "sweep" not in facts.get("spec", {}):
        return None
    from wavesweep.program.spec import load

    # Facts have the order and the cutoff that follow from band edges next to these; a spec has one
    # or the other.
    filters = {}
    for name, written in facts["spec"].get("filters", {}).items():
        following = ("order", "cutoff_hz") if "passband_hz" in written else ()
        filters[name] = {key: value for key, value in written.items() if key not in following}
    return load({**facts["spec"], **({"filters": filters} if filters else {})})


def smooth_axes(names: Iterable[str], facts: Mapping[str, Any]) -> list[str]:
    """Those axes along which further columns can be computed; none without the spec."""
    spec = spec_of(facts)
    if spec is None:
        return []
    from wavesweep.program.sweep.grid import is_plain

    return [name for name in names if is_plain(spec, spec.names.find(name).path)]


Design = tuple[
    tuple[str, float], ...
]  # path -> value on each axis that is read, without that along the picture


@dataclass(frozen=True)
class _Source:
    """A source of further columns.

    axis: that of the intervals. x: the path of the other one if it is read. keys: the design of each
    member. designs: the different ones among them, by which `ask` numbers them. cost: s of a column;
    of a dear one its share of BUDGET.
    """

    spec: Any
    axis: Any
    x: str | None
    keys: list[Design]
    designs: list[Design]
    cost: float
    dear: bool

    def ask(self, wanted: list[tuple[int, float]]) -> list[Column]:
        """The intervals at (number of a design, x)."""
        places = [(number, x if self.x else 0.0) for number, x in wanted]
        columns = self._columns_at(list(dict.fromkeys(places)))
        designs = {number for number, _ in columns}
        if not self.dear and len(designs) > 1:
            # What loops of several designs leave in doubt may be clear in those of one.
            for design in sorted(designs):
                doubtful = [
                    place
                    for place, column in columns.items()
                    if place[0] == design and _doubtful(column)
                ]
                columns |= self._columns_at(doubtful) if doubtful else {}
        return [columns[place] for place in places]

    def _columns_at(self, places: list[tuple[int, float]]) -> dict[tuple[int, float], Column]:
        from wavesweep.program.analyses.interval_jobs import at_points

        numbers = [dict(self.designs[number]) for number, _ in places]
        points = {}
        for path, _ in self.designs[0]:
            points[path] = np.array([of_place[path] for of_place in numbers])
        if self.x:
            points[self.x] = np.array([x for _, x in places])
        if not points:  # the loop reads none of the axes
            name, value = next(
                (path, value)
                for path, value in self.spec.values.items()
                if isinstance(value, float)
            )
            points = {name: np.array([value])}
        rows = at_points(self.spec, self.axis, points, require=self.spec.require)
        columns = columns_of(rows, rows["slice"])
        return {place: columns[number] for number, place in enumerate(places)}


def _doubtful(column: Column) -> bool:
    """Whether a column has an interval that is not certified, or a place that is not known."""
    return bool(column[1]) or not all(interval.certified for interval in column[0])


def _source(members: Sequence[Columns], x: str, facts: Mapping[str, Any]) -> _Source | None:
    """None if columns cannot be computed: without a spec, along whole numbers, and for guarantees
    for hands, each of which takes from tenths of a second to some seconds.
    """
    spec, rows = spec_of(facts), members[0]
    whose = whose_column(rows)
    hand = "" if whose in ("", "spec") else str(rows[whose][0])
    if spec is None or hand not in ("", *COMPUTED):
        return None
    from wavesweep.program.analyses.interval_jobs import Way, cost_of
    from wavesweep.program.spec import sweep_axes
    from wavesweep.program.sweep.grid import is_plain, make_grid

    path = spec.names.find(x).path
    if not is_plain(spec, path):
        return None
    if hand == "free":
        numbers = ("mass", "damping", "stiffness")
        spec = spec.with_values({f"operator.{number}": 0.0 for number in numbers})
    axis, axes = sweep_axes(spec, str(rows["along"][0]))
    used = make_grid(spec, axes, axis.path).loop_axes
    keys = [
        tuple((swept.path, rows[swept.name][0].item()) for swept in used if swept.path != path)
        for rows in members
    ]
    designs = list(dict.fromkeys(keys))
    cost, method = cost_of(spec.with_values(dict(designs[0])), axis)
    dear = method is not Way.CUT
    if dear:
        cost = BUDGET / sum(len(np.unique(columns[x])) for columns in members)
    place = path if any(swept.path == path for swept in used) else None
    return _Source(spec, axis, place, keys, designs, cost, dear)
