"""Intervals for hands beside those of the loop as it is: which rows, how sure, whoever computes them."""

import numpy as np
import pytest
from support.held import damping_needed
from support.published import colgate_schenkel
from support.tables import same

from wavesweep.engine.errors import UsageError
from wavesweep.program.spec import load
from wavesweep.program.tables.hand_rows import hands_of
from wavesweep.program.tables.interval_sentences import interval_lines
from wavesweep.program.tables.interval_summary import IntervalSummary
from wavesweep.program.tables.interval_table import intervals

OPERATOR = {"mass": 0.2, "damping": 5.0, "stiffness": 300.0}
BOX = {"mass": (0.1, 0.6), "damping": (2.0, 4.0), "stiffness": (100.0, 400.0)}


def spec_of(kind="dc", operator=None, velocity="difference", **axes):
    device = {"velocity": velocity, "damping": 3.0}
    return load({"controller": {"kind": kind}, "device": device, "operator": operator or {}, "sweep": axes})


def rows_of(run, hand):
    rows = run.columns["hand"] == hand
    return {name: column[rows] for name, column in run.columns.items()}


def worded(box):
    return "box:" + ",".join(f"{name}={low:g}..{high:g}" for name, (low, high) in box.items())


@pytest.mark.slow
def test_the_other_rows_are_those_of_the_plain_table():
    spec = spec_of(operator=OPERATOR, B_VE=[1.0])
    run = intervals(spec, hands=hands_of("passive"))
    for hand, loop in (("operator", spec), ("free", spec_of(B_VE=[1.0]))):
        rows = rows_of(run, hand)
        del rows["hand"]
        same(rows, intervals(loop).columns)


@pytest.mark.parametrize("kind", ["dc", "dc-slow", "dc-lm"])
@pytest.mark.parametrize("delay", [0, 2])
def test_the_damping_asked_for_is_convex_over_the_walls_of_direct_coupling(kind, delay):
    """Which is why the walls that a damping pays for are one interval, proved by its ends."""
    values = load({"controller": {"kind": kind}, "device": {"velocity": "difference"}, "rates": {"ratio": 4}}).values
    generator = np.random.default_rng(5)
    K, B = generator.uniform(0, 5000, (2, 40)), generator.uniform(0, 20, (2, 40))

    def needed(K, B):
        walls = {"environment.K_VE": K, "environment.B_VE": B, "environment.delay": delay}
        return damping_needed(dict(values) | walls).damping

    middle = needed(K.mean(0), B.mean(0))
    assert np.all(middle <= (needed(K[0], B[0]) + needed(K[1], B[1])) / 2 * (1 + 1e-7) + 1e-7)


@pytest.mark.slow
def test_along_another_number_the_least_damping_of_the_device_is_found():
    spec = spec_of(along="device.damping", **{"device.damping": {"start": 0, "stop": 20}, "B_VE": [2.0]})
    rows = rows_of(intervals(spec, hands=hands_of("passive")), "passive")
    expected = colgate_schenkel(500.0, np.array([2.0]), 1e-3)
    assert rows["low"] == pytest.approx(expected, rel=1e-5)
    assert rows["high"].tolist() == [20]


def test_a_box_that_is_too_much_to_prove_is_not_settled(monkeypatch):
    monkeypatch.setattr(pytest.importorskip("wavesweep.for_all.unknown"), "OPERATIONS_OF_CASE", 1e6)
    run = intervals(spec_of("dc-slow"), hands=hands_of(worded(BOX)))
    rows = rows_of(run, "box")
    assert not rows["settled"].any()
    tally = IntervalSummary(facts=run.facts)
    tally.add(rows)
    assert ("1 row of the box not certified (settled 0): a hand that the search missed may be unstable", True) in list(
        interval_lines(tally.numbers({"slices": {}}))
    )


@pytest.mark.parametrize(
    ("spec", "hand", "said"),
    [
        (spec_of(velocity="exact"), "passive", 'expected device.velocity = "difference", found "exact"'),
        pytest.param(
            spec_of(**{"operator.mass": [0.1, 0.2]}),
            "box",
            "operator.mass cannot be an axis as well",
            marks=pytest.mark.asks("for_all"),
        ),
    ],
)
def test_what_cannot_be_answered_is_refused(spec, hand, said):
    with pytest.raises(UsageError, match=said):
        intervals(spec, hands=hands_of(hand))


@pytest.mark.slow
def test_rows_along_a_dead_time_of_several_ticks_end_where_its_damping_is_needed():
    """`d/T = K (1/2 + r) + K^2 T r (1 - r)/(4 d)` at r ticks, below one; beyond one even the free device is unstable."""
    K, T, d = 1200.0, 1e-3, 1.5
    tables = {"controller": {"kind": "dc"}, "environment": {"K_VE": K, "B_VE": 0.0}}
    tables |= {"device": {"damping": d, "velocity": "difference", "dead_time": 0.0002}}
    tables |= {"sweep": {"along": "device.dead_time", "device.dead_time": {"start": 0.0, "stop": 0.002}}}
    row = {name: column[-1] for name, column in intervals(load(tables), hands=hands_of("passive"), jobs=1).columns.items()}
    c = K**2 * T / (4 * d)
    r = (K + c - np.sqrt((K + c) ** 2 - 4 * c * (d / T - K / 2))) / (2 * c)
    assert (row["hand"], row["low"]) == ("passive", 0)
    assert row["high"] == pytest.approx(r * T, rel=1e-5)
    assert row["certified"]
