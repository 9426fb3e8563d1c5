"""Stable intervals between the values of a table: further columns, computed until straight lines between them are right.

At the values of x that a table has, the intervals are known. Between two of them nothing is, however close they are: a region
may end there and another may begin. A figure therefore computes further columns, by the same code as the table: midpoints of
all cells that are not decided yet, in one batch a round. A cell is known if the line between its ends is right in its middle
to half a pixel. An interval that begins or ends within a cell is located to a pixel.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from wavesweep.columns import Columns
from wavesweep.plots.style import incomplete
from wavesweep.tables.interval_tally import whose_column

BUDGET = 1.5  # s that the further columns of a figure may take; by an estimate, so that equal tables give equal figures
FEWEST = 64  # cells along a figure that are examined, however few values the table has; fewer if columns are dear
DEAR, ROUND = 6e-3, 0.1  # s of a column along other numbers than the wall's, and of a batch of them for a design, at least
KNOWN, NARROW, OPEN = "known", "narrow", "open"


@dataclass(frozen=True, slots=True)
class Interval:
    """A stable interval; an end is real unless the swept range ends there. felt_low, felt_high: N/m, NaN if not known."""

    low: float
    high: float
    low_real: bool
    high_real: bool
    certified: bool
    felt_low: float = np.nan
    felt_high: float = np.nan


@dataclass(eq=False)
class Curve:
    """The intervals of one design: x -> (its intervals, whether others may be missing), and the state of the gaps.

    gaps: (x, next x) -> KNOWN (straight lines join the intervals one by one), NARROW (a pixel) or, if missing, OPEN.
    """

    columns: dict[float, tuple[tuple[Interval, ...], bool]]
    gaps: dict[tuple[float, float], str] = field(default_factory=dict)

    @property
    def open_at_ends(self) -> bool:
        """Whether there are bars at the least or at the largest x."""
        places = sorted(self.columns)
        ends = [*pairwise(places)][:1] + [*pairwise(places)][-1:]
        return any(gap not in self.gaps for gap in ends)

    def slices(self) -> list[tuple[float, tuple[Interval, ...], bool]]:
        """Return (x, intervals, incomplete) in order of x."""
        return [(x, *self.columns[x]) for x in sorted(self.columns)]


@dataclass(frozen=True)
class View:
    """The plane that is drawn: the axis x and whether it is logarithmic, its size in pixels, and the same of the other axis."""

    x: str
    logarithmic: bool
    wide: float
    high: float
    by_factors: bool = False

    def height(self, value: Any) -> Any:
        """The coordinate along the other axis in which the figure is straight; values on a scale of factors are positive."""
        return np.log(value) if self.by_factors else value

    def position(self, x: Any) -> Any:
        """The coordinate in which the figure is straight."""
        return np.log(x) if self.logarithmic else x

    def between(self, left: float, right: float, parts: int) -> list[float]:
        """The points that divide a cell into equal parts of the figure, without its ends."""
        shares = np.arange(1, parts) / parts
        if self.logarithmic:
            return (left * (right / left) ** shares).tolist()
        return (left + (right - left) * shares).tolist()


def curves_of(members: Sequence[Columns], view: View, facts: Mapping[str, Any]) -> list[Curve]:
    """The curves of some designs over x, refined if the facts have the spec that they were computed from.

    members: the rows of each design, all of one hand and with the same value of every other axis.
    """
    curves = [Curve(_columns_of(rows, rows[view.x])) for rows in members]
    question = _question(members, view.x, facts) if any(len(curve.columns) > 1 for curve in curves) else None
    if question is None:
        return curves
    ends = view.height(np.concatenate([[*rows["low"], *rows["high"]] for rows in members]))
    height = float(np.ptp(ends[~np.isnan(ends)])) if not np.isnan(ends).all() else 0.0
    # Designs that differ only in what their controller does not read are one.
    different = [curves[question.keys.index(key)] for key in question.designs]
    _refine(different, view, height / view.high / 2, question)
    return [different[question.designs.index(key)] for key in question.keys]


def _columns_of(rows: Columns, places: np.ndarray) -> dict[float, tuple[tuple[Interval, ...], bool]]:
    """The intervals at each of the places, in order of the rows."""
    names = ("low", "high", "low_omega", "high_omega", "certified", "felt_low", "felt_high")
    nothing = np.full(len(places), np.nan)
    low, high, low_omega, high_omega, certified, felt_low, felt_high = (rows.get(name, nothing).tolist() for name in names)
    stable, unknown, found = (rows["intervals"] > 0).tolist(), incomplete(rows).tolist(), {}
    for row, place in enumerate(places.tolist()):
        each, missing = found.get(place, ((), False))
        if stable[row]:
            real = (low_omega[row] == low_omega[row], high_omega[row] == high_omega[row])  # NaN if the range ends it
            each = (*each, Interval(low[row], high[row], *real, bool(certified[row]), felt_low[row], felt_high[row]))
        found[place] = each, missing or unknown[row]
    return found


def _refine(curves: list[Curve], view: View, tolerance: float, question: _Question) -> None:
    """Add columns to the curves until all cells are known or narrow, or the budget is spent."""
    ends = [view.position(x) for curve in curves for x in curve.columns]
    whole = float(max(ends) - min(ends))
    narrow = whole / view.wide
    # A batch of dear columns costs much by itself, so that a few more of them save time.
    parts = 4 if question.batch else 2
    cells = [(n, a, b) for n, curve in enumerate(curves) for a, b in pairwise(sorted(curve.columns))]

    def width(cell):
        return view.position(cell[2]) - view.position(cell[1])

    cells.sort(key=width, reverse=True)
    smallest = whole / min(FEWEST, max(1, int(BUDGET / question.cost / len(curves) / 4)))
    left = BUDGET
    while cells:
        taken, wanted, designs = [], [], set()
        for cell in cells:
            inside = view.between(*cell[1:], max(parts if left < BUDGET else 2, 2 * int(np.ceil(width(cell) / smallest / 2))))
            if question.seconds(len(wanted) + len(inside), len(designs | {cell[0]})) > left:
                break
            designs.add(cell[0])
            taken.append((cell[0], [cell[1], *inside, cell[2]]))
            wanted += [(cell[0], x) for x in inside]
        if not wanted:
            return
        for (number, x), column in zip(wanted, question.ask(wanted), strict=True):
            curves[number].columns[x] = column
        left -= question.seconds(len(wanted), len(designs))
        cells = [each for number, points in taken for each in _undecided(curves[number], number, points, view, tolerance)]
        for number, a, b in [cell for cell in cells if width(cell) <= narrow]:
            curves[number].gaps[a, b] = NARROW
        cells = [cell for cell in cells if width(cell) > narrow]


def _undecided(curve, number, points, view, tolerance):
    """Mark the cells that are known, and return the others."""
    found = known_gaps({x: curve.columns[x] for x in points}, view, tolerance)
    curve.gaps |= found
    return [(number, *gap) for gap in pairwise(points) if gap not in found]


def known_gaps(
    columns: Mapping[float, tuple[tuple[Interval, ...], bool]], view: View, tolerance: float
) -> dict[tuple[float, float], str]:
    """The gaps of columns, two by two, in which lines are right to the tolerance (see `View.height`), by the middle column."""
    places = sorted(columns)
    found = {}
    for a, middle, b in zip(places[:-2:2], places[1::2], places[2::2], strict=True):
        if _is_straight(columns[a], columns[middle], columns[b], view, tolerance):
            found |= dict.fromkeys(((a, middle), (middle, b)), KNOWN)
    return found


def _is_straight(before, middle, after, view, tolerance) -> bool:
    """Whether all three columns have the same intervals, and those in the middle lie on lines between the others.

    An end may be that of the swept range on one side: a line to it is as right as any other.
    """
    intervals = (before[0], middle[0], after[0])
    if len({len(each) for each in intervals}) > 1 or len({before[1], middle[1], after[1]}) > 1:
        return False
    low, high = (
        view.height(np.array([[getattr(each, end) for each in found] for found in intervals])) for end in ("low", "high")
    )
    return all((np.abs(ends[1] - (ends[0] + ends[2]) / 2) <= tolerance).all() for ends in (low, high))


def spec_of(facts: Mapping[str, Any]) -> Any:
    """The spec in the facts of a run, None if there is none."""
    if "sweep" not in facts.get("spec", {}):
        return None
    from wavesweep.spec import load

    # Facts have the order and the cutoff that follow from band edges beside these; a spec has one or the other.
    filters = {
        name: {key: value for key, value in given.items() if "passband_hz" not in given or key not in ("order", "cutoff_hz")}
        for name, given in facts["spec"].get("filters", {}).items()
    }
    return load({**facts["spec"], **({"filters": filters} if filters else {})})


def smooth_axes(names: Iterable[str], facts: Mapping[str, Any]) -> list[str]:
    """Those of some axes along which further columns can be computed; none without the spec."""
    spec = spec_of(facts)
    if spec is None:
        return []
    from wavesweep.sweep.grid import is_plain

    return [name for name in names if is_plain(spec, spec.names.find(name).path)]


Design = tuple[tuple[str, float], ...]  # path -> value on each axis that is read, without that along the figure


@dataclass(frozen=True)
class _Question:
    """A source of further columns.

    axis: that of the intervals. x: the path of the other one if it is read. cost, batch: s of a column, and of a batch of them
    for a design, at least. keys: the design of each member. designs: the different ones among them, by which `ask` numbers
    them.
    """

    spec: Any
    axis: Any
    x: str | None
    keys: list[Design]
    designs: list[Design]
    cost: float
    batch: float

    def seconds(self, columns: int, designs: int) -> float:
        """About how long `ask` takes for so many columns of so many designs."""
        return max(self.cost * columns, self.batch * designs)

    def ask(self, wanted: list[tuple[int, float]]) -> list[tuple[tuple[Interval, ...], bool]]:
        """The intervals at (number of a design, x)."""
        from wavesweep.sweep.interval_job import at_points

        places = [(number, x if self.x else 0.0) for number, x in wanted]
        number = {place: at for at, place in enumerate(dict.fromkeys(places))}
        points = {path: np.array([dict(self.designs[n])[path] for n, _ in number]) for path, _ in self.designs[0]}
        if self.x:
            points[self.x] = np.array([x for _, x in number])
        if not points:  # the loop reads none of the axes
            name, value = next((path, value) for path, value in self.spec.values.items() if isinstance(value, float))
            points = {name: np.array([value])}
        found = at_points(self.spec, self.axis, points, require=self.spec.require)
        columns = _columns_of(found, found["slice"])
        return [columns[number[place]] for place in places]


def _question(members, x, facts) -> _Question | None:
    """None if columns cannot be computed: without a spec, along whole numbers, and for guarantees for hands, each of which
    takes from tenths of a second to some seconds.
    """
    spec, rows = spec_of(facts), members[0]
    hand = str(rows[whose][0]) if (whose := whose_column(rows)) else ""
    if spec is None or hand not in ("", "free", "operator", "spec"):
        return None
    from wavesweep.spec import sweep_axes
    from wavesweep.sweep.grid import is_plain, make_grid
    from wavesweep.sweep.interval_job import cost_of

    path = spec.names.find(x).path
    if not is_plain(spec, path):
        return None
    if hand == "free":
        spec = spec.with_values(dict.fromkeys((f"operator.{part}" for part in ("mass", "damping", "stiffness")), 0.0))
    axis, axes = sweep_axes(spec, str(rows["along"][0]))
    grid = make_grid(spec, axes, axis.path)
    used = grid.loop_axes
    keys = [tuple((each.path, rows[each.name][0].item()) for each in used if each.path != path) for rows in members]
    designs = list(dict.fromkeys(keys))
    cost, exact = cost_of(spec.with_values(dict(designs[0])), axis)
    cost, batch = (cost, 0.0) if exact else (max(cost, DEAR), ROUND)
    return _Question(spec, axis, path if any(each.path == path for each in used) else None, keys, designs, cost, batch)
