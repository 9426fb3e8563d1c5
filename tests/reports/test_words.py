"""The question of a report and what refutes values beyond the ends, in words."""

import re

import pytest

import wavesweep
from wavesweep.program.analyses.claims import PUSHES
from wavesweep.program.tables.interval_table import intervals
from wavesweep.reports.sentences import counterexamples, question

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
