"""The question of a report and what refutes values beyond the ends, in words."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

import wavesweep
from wavesweep.program.analyses.claim_words import fact_of, failed, of_intervals
from wavesweep.program.analyses.claims import AT_REST, PUSHES, STABLE, Claim, Range, Scope, Status, curve_of
from wavesweep.program.tables.interval_table import intervals
from wavesweep.reports.sentences import claims_of_rows, counterexamples, interval_rows, question

WALLS = {"K_VE": {"start": 0, "stop": 5000}}


def test_beyond_an_end_of_the_specs_own_loop_an_eigenvalue_is_outside_of_the_circle():
    spec = wavesweep.load({"controller": {"kind": "dc-slow"}, "sweep": WALLS | {"B_VE": [1.0]}})
    ((_, value, said),) = counterexamples(spec, intervals(spec, jobs=1))
    beyond, excess = float(value.removeprefix("K_VE = ")), float(re.search(r"modulus 1 \+ (\S+):", said)[1])
    assert beyond > 263.137165  # the end of the only interval
    assert wavesweep.compile(spec).spectral_radius(K_VE=beyond, B_VE=1.0) - 1 == pytest.approx(excess, rel=0.01)


def test_the_question_names_chances_contact_and_what_varies():
    frames = {"values": [16, 33], "varying": True}
    asked = "For which K_VE from 0 to 5000 N/m is the loop stable for frames of 16, 33 ticks in any order; and "
    for of_frames, more, said in (
        ({"shares": [9, 1]}, {}, "is the loop stable in mean square for frames of 16 (9 of 10) and 33 ticks at random"),
        ({}, {"contact": True}, f"does every motion come to rest for frames of 16, 33 ticks in any order with {PUSHES}"),
    ):
        for_all = {"rates.ratio": frames | of_frames, **more}
        spec = wavesweep.load({"controller": {"kind": "dc-slow"}, "sweep": WALLS, "for_all": for_all})
        assert question(spec) == f"{asked}{said}?"


def test_intervals_are_called_stable_only_where_there_are_some():
    own = Claim(STABLE, Scope(), Status.CERTIFIED)
    assert "every value in an interval is stable" in of_intervals(own, some=True)
    assert of_intervals(own, some=False) == "Certified: nowhere stable in the range."


def test_what_refutes_all_curves_is_said_of_all_of_them():
    refuted = Claim(AT_REST, Scope(walls=curve_of("amp")), Status.REFUTED, "a motion")
    assert failed(refuted) == "does not come to rest for all curves of slopes from 0 to 1 in the place of amp"


def table_with():
    """Rows of stable intervals along K_VE of which one is of the spec's own loop, one of all of [for_all]."""
    spec = wavesweep.load({"controller": {"kind": "dc-slow"}, "environment": {"K_VE": 100.0}, "sweep": WALLS | {"B_VE": [1.0]}})
    table = intervals(spec, jobs=1)
    masses = Claim(STABLE, Scope((Range("device.mass", 0.08, 0.12),)), Status.PROVED)
    facts = dict(table.facts)
    facts["claims"] = dict(facts["claims"]) | {"for_all": fact_of(masses)}
    twice = {name: np.concatenate([column, column]) for name, column in table.columns.items()}
    columns = twice | {"guarantee": np.array(["spec", "for_all"], object)}
    return spec, SimpleNamespace(columns=columns, facts=facts), masses


def test_what_certified_rows_prove_of_the_own_numbers_answers_the_question():
    spec, table, masses = table_with()
    assert masses in [*claims_of_rows(spec, table)]
    beyond = spec.with_values({"environment.K_VE": 4000.0})
    assert not [*claims_of_rows(beyond, table)]


@pytest.mark.slow
@pytest.mark.asks("require", "margins", "reports")
def test_a_report_has_each_cut_that_is_asked_for_and_says_which_sets_an_end():
    axis = {
        "rates": {"tick_hz": 100},
        "numbers": {"K": 10.0},
        "block": {
            **{name: {"type": "tf", "num": [1], "den": [1, 0]} for name in ("p", "q")},
            **{name: {"type": "gain"} for name in ("c", "d")},
        },
        "wire": {"p.u": "c.y", "c.u": "-K*p.y", "q.u": "d.y", "d.u": "-K*q.y"},
    }
    margins = [{"cut": "c.y", "Ms": 2.0}, {"cut": "d.y", "phase_deg": 70}]
    axis["sweep"] = {"along": "K", "K": {"start": 1, "stop": 250}, "require": {"margins": margins}}
    page = wavesweep.report(axis)
    assert "Margins at c.y" in page
    assert "Margins at d.y" in page
    assert "--cut d.y --out verified-2" in page
    head, (row,) = interval_rows(intervals(wavesweep.load(axis), jobs=1))
    assert row[head.index("upper limit set by")] == "phase at d.y"
