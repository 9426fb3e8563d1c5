"""The question of a report, in words."""

import wavesweep
from wavesweep.reports.sentences import question

WALLS = {"K_VE": {"start": 0, "stop": 5000}}


def test_a_single_value_is_a_condition_and_several_are_asked_of_each():
    spec = wavesweep.load({"controller": {"kind": "pmw"}, "sweep": WALLS | {"B_VE": [2.0]}})
    assert question(spec) == "For which K_VE from 0 to 5000 N/m is the loop stable, at B_VE = 2 N*s/m?"
    spec = wavesweep.load({"controller": {"kind": "pmw"}, "sweep": WALLS | {"B_VE": [2.0], "b": [10.0, 20.0]}})
    end = "is the loop stable, at B_VE = 2 N*s/m, for each of b = 10, 20 N*s/m?"
    assert question(spec) == f"For which K_VE from 0 to 5000 N/m {end}"
