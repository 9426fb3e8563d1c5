"""No row of any kind of table is certified without its values, and no bound is smaller than the error that it is of."""

from dataclasses import replace

import numpy as np
import pytest

import wavesweep
from wavesweep.margins.broken_loops import broken_at, cuts_of
from wavesweep.margins.lifted_margins import END_ERROR, margins_of
from wavesweep.margins.table import margins
from wavesweep.program.spec import load
from wavesweep.program.tables import kinds
from wavesweep.program.tables.table import Table

HARD = [  # drifts, ranges in which nothing is stable, a requirement, frames and messages at random
    {"rates": {"ratio": 5}, "device": {"velocity": "difference"}, "controller": {"kind": "pmw", "b": 3.0}},
    {"controller": {"kind": "pmw-lm"}, "operator": {"stiffness": 30.0}, "environment": {"integration": "explicit"}},
    {"rates": {"ratio": 1}, "controller": {"kind": "dc-slow"}, "sweep": {"require": {"radius": 0.99}}},
    {
        "device": {"mass": 0.19, "damping": 0.4, "velocity": "difference"},
        "environment": {"integration": "explicit", "delay": 1},
        "controller": {"kind": "dc-slow"},
        "for_all": {"rates.ratio": {"values": [16, 33], "varying": True, "shares": [1, 1]}},
    },
]


def kept(name, columns):
    """Hold the rows of a table against the law: a claim has its values, and words of doubt and flags agree."""
    kind, columns = kinds()[name], {key: np.asarray(column) for key, column in dict(columns).items()}
    if "certified" in columns:
        sure = columns["certified"].astype(bool)
        if "doubt" in columns:
            assert ((columns["doubt"] == "") == sure).all()
        if "intervals" in columns:
            sure &= columns["intervals"] > 0
            assert (columns["low"] <= columns["high"])[sure].all()
            assert (columns["open_places"][sure] == 0).all()
        for value in kind.vouched:
            assert not np.isnan(columns[value][sure]).any(), value
    for error in (key for key in columns if key.endswith("_error")):
        value = error.removesuffix("_error")
        found = columns[value if value in columns else f"{value}_abs"]
        assert (np.isnan(found) == np.isnan(columns[error])).all()
        assert not (columns[error][columns["doubt"] == ""] > 1e-6).any()
    if "bound" in columns:
        assert (columns["bound"][columns["certified"].astype(bool)] <= 1e-6).all()


def test_every_kind_of_table_that_certifies_says_of_which_values():
    certifying = {name for name, kind in kinds().items() if any(field.name == "certified" for field in kind.fields)}
    assert certifying  # the columns of a design follow from its wishes
    assert all(kinds()[name].vouched or "intervals" in kinds()[name].names for name in certifying)


def test_a_row_that_is_certified_without_its_value_is_in_doubt():
    columns = {"value": np.array([np.nan, 2.0]), "certified": np.ones(2, bool), "doubt": np.array(["", ""], object)}
    found = Table.of("margins", columns, {}).columns
    assert found["certified"].tolist() == [False, True]
    assert found["doubt"].tolist() == ["search", ""]


@pytest.mark.slow
@pytest.mark.parametrize("spec", HARD)
def test_tables_of_hard_loops_keep_the_law(spec):
    along = {"K_VE": {"start": 0, "stop": 3000}, "B_VE": [0.0, 1.0]}
    kept("zwidth", wavesweep.zwidth(spec | {"sweep": spec.get("sweep", {}) | along}))
    kept("bode", wavesweep.bode(spec | {"bode": {"frequency_hz": [0.0, 1.0, 50.0, 100.0]}}))
    if "for_all" not in spec:
        kept("why", wavesweep.compile(spec).sensitivity("K_VE", (0, 3000)))
    for cut in cuts_of(load(spec))[:3]:
        try:
            kept("margins", margins(load(spec), cut).columns)
        except wavesweep.UsageError:  # a loop that is not stable has none
            continue


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dc-slow", "pmw"])
def test_bounds_of_margins_hold_the_difference_of_two_ways(kind):
    """Crossings of the gain 1 of a signal that is made once, and intervals along its angle, share no formula."""
    spec, met = (
        load({"rates": {"ratio": 4}, "controller": {"kind": kind, "Kp": 5.0}, "environment": {"K_VE": 60.0, "delay": 4}}),
        0,
    )
    for cut in cuts_of(spec):
        loop = broken_at(spec, cut)
        if not loop.cut:
            continue
        phase, other = (
            next(each for each in margins_of(way)[0] if each.name == "phase") for way in (loop, replace(loop, cut=None))
        )
        if phase.limited and not (phase.doubt or other.doubt):
            bound = phase.bound + max(other.bound, END_ERROR)
            assert abs(phase.value - other.value) <= 2 * bound * phase.value, cut
            met += 1
    assert met >= 2
