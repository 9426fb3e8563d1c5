"""Lines of a plane that follow intervals from column to column."""

from itertools import pairwise

import numpy as np
import pytest

from wavesweep.program import plots
from wavesweep.program.analyses.interval_jobs import Way
from wavesweep.program.analyses.plane_columns import (
    KNOWN,
    NARROW,
    Interval,
    PlaneCurve,
    View,
    curves_of,
    seconds_of_curves,
)
from wavesweep.program.plots.plane_regions import region_of
from wavesweep.program.spec import load, sweep_axes
from wavesweep.program.tables.interval_table import intervals

from .conftest import table_of_intervals

VIEW = View("B_VE", False, 500, 400)


def column(*intervals):
    return tuple(Interval(low, high, True, True, True) for low, high in intervals), ()


def area(line):
    x, y = np.array(line).T
    return abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2


def test_an_interval_that_is_not_known_in_a_column_has_not_ended_there():
    both, one = column((0, 600), (700, 1200), (1280, 1390)), column((1283, 1387))  # two intervals end at once
    for known in (True, False):
        part = one if known else (one[0], ((-np.inf, np.inf),))
        region = region_of(PlaneCurve({6.4: both, 6.45: part, 6.5: both}, {(6.4, 6.45): NARROW, (6.45, 6.5): NARROW}), VIEW)
        across = [step for line in region.certain for step in pairwise(line) if step[0][0] == step[1][0]]
        steps = [(round(x, 3), low, high) for (x, low), (_, high) in across if low <= 1200]
        down = [(6.425, 600, 0), (6.425, 1200, 700)]
        up = [(6.475, 0, 600), (6.475, 700, 1200)]
        assert sorted(steps) == (down + up if known else [])
        assert not region.bars
        assert sum(map(area, region.areas)) == pytest.approx(0.05 * 1210 + 0.05 * 104)


def test_a_gap_that_is_not_known_beside_others_that_are_is_hatched():
    curve = PlaneCurve({x: column((0, 1)) for x in (0.0, 1.0, 2.0, 3.0)}, {(0.0, 1.0): KNOWN, (1.0, 2.0): KNOWN})
    region = region_of(curve, VIEW)
    assert region.unknown == [(2.0, 3.0, -np.inf, np.inf)]
    assert [x for x, _ in region.bars] == [2.0, 3.0]
    assert region_of(PlaneCurve(curve.columns), VIEW).unknown == []  # bars alone


def test_a_boundary_is_one_line_where_a_hole_begins():
    """The hole ends in the middle of the gap; its line has the unstable side at the left, as those of the outer ends have."""
    one, two = column((100, 1200)), column((101, 600), (700, 1201))
    region = region_of(PlaneCurve({1.0: one, 2.0: two}, {(1.0, 2.0): NARROW}), VIEW)
    outer = [(1.0, 1200), (1.5, 1200.5), (2.0, 1201)]
    lower = [(2.0, 101), (1.5, 100.5), (1.0, 100)]
    hole = [(2.0, 700), (1.5, 650), (2.0, 600)]
    assert sorted(region.certain) == sorted([outer, lower, hole])
    assert region.doubtful == []


def filled(figure):
    """Whether anything is filled in a figure."""
    return any(closed(path) for axes in figure.axes for each in axes.collections for path in each.get_paths())


def closed(path):
    return len(path.vertices) > 3 and path.codes is not None and path.codes[-1] == path.CLOSEPOLY


@pytest.mark.slow
def test_nothing_is_filled_between_values_that_are_not_joined():
    """Without the spec nothing more can be computed, and whole numbers have nothing between them."""
    walls = {"controller": {"kind": "pmw"}, "sweep": {"K_VE": {"start": 0, "stop": 4000}, "B_VE": [0.0, 1.0, 2.0]}}
    table = intervals(load(walls))
    assert filled(plots.zwidth(table.columns, table.facts))
    assert not filled(plots.zwidth(table.columns, {}))
    table = intervals(load(walls | {"sweep": {"K_VE": {"start": 0, "stop": 4000}, "environment.delay": list(range(12))}}))
    figure = plots.zwidth(table.columns, table.facts)
    assert not filled(figure)
    low, high = figure.axes[0].get_xlim()
    assert (low < 0, high > 11) == (True, True)  # so that the bars at both ends are whole


def test_what_loops_of_several_designs_leave_in_doubt_is_asked_again_by_design(monkeypatch):
    """Batches share polynomials, which a design of a tiny number may spoil; a column that stays in doubt is not joined."""
    asked = []

    def at_points(spec, axis, points, require):  # noqa: ARG001 - as the function that it stands for
        x, many = points["environment.B_VE"], len(set(points["controller.b"])) > 1
        asked.append(set(points["controller.b"]))
        certified = ~(many | ((x > 1.4) & (x < 1.6)))
        count = len(x)
        rows = {"slice": np.arange(count), "intervals": np.ones(count, int), "interval": np.zeros(count, int)}
        rows |= {"low": np.zeros(count), "high": 1000.0 + x, "low_omega": np.zeros(count), "high_omega": np.ones(count)}
        return rows | {"certified": certified, "doubt": np.where(certified, "", "rounding").astype(object)}

    monkeypatch.setattr("wavesweep.program.analyses.interval_jobs.at_points", at_points)
    spec = load(
        {"controller": {"kind": "pmw"}, "sweep": {"K_VE": {"start": 0, "stop": 4000}, "B_VE": [0.0, 2.0], "b": [10, 20]}}
    )
    rows = [(x, b) for b in (10.0, 20.0) for x in (0.0, 2.0)]
    table = table_of_intervals(["B_VE", "b"], "K_VE", [((x, b), [(0.0, 1000.0 + x, 0.0, 1.0, True)]) for x, b in rows])
    members = [{name: column[table["b"] == b] for name, column in table.items()} for b in (10.0, 20.0)]
    curves = curves_of(members, VIEW, {"spec": spec.tables()})
    assert {10.0, 20.0} in asked
    assert {10.0} in asked
    for curve in curves:
        assert all(each.certified for column, _ in curve.columns.values() for each in column)
        assert not [x for x in curve.columns if 1.4 < x < 1.6]
        (cut,) = [gap for gap in pairwise(sorted(curve.columns)) if gap[0] < 1.5 < gap[1]]
        assert cut not in curve.gaps


@pytest.fixture
def dear_columns(monkeypatch):
    """A design that takes long, stable up to a bent curve; the values that are asked of it."""
    asked = []

    def at_points(spec, axis, points, require):  # noqa: ARG001 - as the function that it stands for
        x = points["environment.B_VE"]
        asked.extend(x.tolist())
        certified = x < 109
        rows = {"slice": np.arange(x.size), "intervals": np.ones(x.size, int), "interval": np.zeros(x.size, int)}
        rows |= {"low": np.zeros(x.size), "high": bent(x), "low_omega": np.zeros(x.size), "high_omega": np.ones(x.size)}
        return rows | {"certified": certified, "doubt": np.where(certified, "", "rounding").astype(object)}

    monkeypatch.setattr("wavesweep.program.analyses.interval_jobs.at_points", at_points)
    monkeypatch.setattr("wavesweep.program.analyses.interval_jobs.cost_of", lambda *_: (1e-3, Way.DOMINANCE))
    return asked


def bent(x):
    """A line that turns at 105, within a few units."""
    return 1000 + 300 * np.sqrt(2 + (x - 105) ** 2)


def curve_of_design(values):
    sweep = {"K_VE": {"start": 0, "stop": 4000}, "B_VE": values}
    spec = load({"controller": {"kind": "pmw"}, "sweep": sweep})
    table = table_of_intervals(["B_VE"], "K_VE", [((x,), [(0.0, bent(x), 0.0, 1.0, True)]) for x in values])
    (curve,) = curves_of([table], VIEW, {"spec": spec.tables()})
    return curve


def test_dear_columns_are_computed_where_a_curve_bends(dear_columns):
    curve = curve_of_design(np.linspace(0, 108.0, 100).tolist())
    assert all(gap in curve.gaps for gap in pairwise(sorted(curve.columns)))
    assert dear_columns
    assert min(dear_columns) > 95


@pytest.mark.parametrize("count", [4, 20, 60])
def test_dear_columns_are_no_more_than_those_of_the_table(dear_columns, count):
    curve = curve_of_design(np.linspace(60, 108, count).tolist())
    assert len(dear_columns) <= count
    assert bool(dear_columns) == (count > 4)  # of so few nothing between is known
    assert set(dear_columns) <= set(curve.columns)


def test_the_time_of_further_columns_is_told(monkeypatch):
    """Each takes 0.02 s here, along a cut."""
    monkeypatch.setattr("wavesweep.program.analyses.interval_jobs.cost_of", lambda *_: (0.02, Way.CUT))
    values = np.linspace(60, 108, 20).tolist()
    spec = load({"controller": {"kind": "pmw"}, "sweep": {"K_VE": {"start": 0, "stop": 4000}, "B_VE": values}})
    seconds = seconds_of_curves(spec, *sweep_axes(spec, "K_VE"), 0.02)
    added = len(curve_of_design(values).columns) - len(values)
    assert 0 < 0.02 * added <= seconds


def test_dear_columns_in_doubt_are_left_out_between_certified_ones(dear_columns):
    values = np.linspace(100, 112, 60).tolist()
    curve = curve_of_design(values)
    assert not {x for x in dear_columns if x > 109} - set(values) & set(curve.columns)
