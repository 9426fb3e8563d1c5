"""Loops in which something stays for ever, or that conserve energy: what is said of them, and what the advice leads to."""

import pytest

import wavesweep
from wavesweep.program.analyses.own_design import own_design, own_lines
from wavesweep.program.spec import load
from wavesweep.program.tables import kind_named
from wavesweep.program.tables.interval_table import intervals

FREE = {  # two masses without friction, held together by a sampled spring and damper alone
    "rates": {"tick_hz": 1000.0},
    "numbers": {"K": 14.7642, "B": 8.17328, "m": 0.13624, "d": 0.0},
    "block": {
        "one": {"type": "mass", "mass": "m", "damping": "d"},
        "two": {"type": "mass", "mass": 0.193482, "damping": 0.0},
        "held": {"type": "hold", "every": 2},
    },
    "wire": {
        "held.u": "K*one.x - K*two.x + B*one.v - B*two.v",
        "one.f": "-held.y",
        "two.f": "held.y",
    },
    "sweep": {"along": "K", "K": {"start": 0, "stop": 20000}},
}
SWING = {  # a symplectic integrator: it conserves, and all its eigenvalues are on the unit circle
    "rates": {"tick_hz": 100},
    "numbers": {"k": 50.0},
    "block": {"v": {"type": "integrator", "method": "explicit"}, "x": {"type": "integrator", "method": "implicit"}},
    "wire": {"v.u": "-k*x.y", "x.u": "v.y"},
    "sweep": {"along": "k", "k": {"start": 1, "stop": 1000}},
}


def summary(tables, hands=None):
    table = intervals(load(tables), hands=hands, jobs=1)
    kind = kind_named(table.kind)
    tally = kind.tally(table)
    for block in table.blocks():
        tally.add(block)
    return [text for text, _ in kind.lines(tally.numbers(table.facts))]


def test_masses_that_nothing_holds_keep_a_speed_and_every_answer_says_so():
    (row,) = wavesweep.stability_region(FREE).itertuples()
    assert (row.certified, row.intervals) == (True, 0)
    said = "a mode of two velocity, one velocity stays as it is, as nothing opposes it; "
    said += "with a little that does (friction, of masses) the other modes decide"
    assert said in " ".join(" ".join(summary(FREE)).split())  # which folds long sentences
    lines = list(own_lines(load(FREE), own_design(load(FREE))))
    assert lines[1].strip() == said


def test_a_little_friction_shows_the_modes_beside():
    """Their relative motion ends at K = 2 B/T for a hold of T = 2 ms, as of any mass under a sampled spring and damper."""
    (row,) = wavesweep.stability_region(FREE | {"numbers": FREE["numbers"] | {"d": 1e-9}}).itertuples()
    assert row.certified
    assert row.high == pytest.approx(2 * FREE["numbers"]["B"] / 2e-3, rel=1e-6)


def test_only_loops_that_conserve_are_told_of_bounded_and_the_advice_leads_somewhere():
    said = " ".join(" ".join(summary(SWING)).split())  # which folds long sentences
    assert "[sweep] require = { bounded = true } finds where nothing grows" in said
    bounded = SWING | {"sweep": SWING["sweep"] | {"require": {"bounded": True}}}
    (row,) = wavesweep.stability_region(bounded).itertuples()
    assert row.certified
    for tables in (FREE, bounded):
        assert not any("bounded = true" in line for line in summary(tables))
