"""The sentence about the wall, the delay and the velocity follows from the loop, and from the keys that were given."""

import pytest
from support.specs import KINDS

from wavesweep import load
from wavesweep.analyses.assumptions import assumed_by, assumes
from wavesweep.tables.intervals import intervals
from wavesweep.tables.passivity import passivity
from wavesweep.tables.responses import responses
from wavesweep.tables.why import why

GIVEN = {"environment": {"integration": "trapezoidal", "delay": 7}, "device": {"velocity": "difference"}}


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_said_of_defaults_if_all_is_given(kind):
    said = assumes(load({"controller": {"kind": kind}, **GIVEN}))
    assert "default" not in said
    assert said.endswith("velocity from differences of position")
    assert ("7 of 20" in said) == (kind != "dc")
    assert ("trapezoidal" in said) == kind.startswith("pmw")


def test_swept_values_are_neither_defaults_nor_single():
    said = assumes(load({"controller": {"kind": "pmw"}}), swept=["environment.delay"])
    assert "delay swept" in said
    assert "kind defaults of environment.integration and device.velocity: engines usually" in said


def test_several_specs_have_a_line_each_unless_they_agree():
    one, two = (load({"controller": {"kind": kind}, **GIVEN}) for kind in ("dc", "pmw"))
    assert assumed_by([one, one]) == assumes(one)
    assert assumed_by([one, two]).splitlines() == [f"{spec.name}: {assumes(spec)}" for spec in (one, two)]


def test_numbers_that_a_preset_does_not_give_are_named_with_every_table():
    spec = load({"controller": {"kind": "pmw"}, "device": {"preset": "touch", "mass": 0.1}, "sweep": {"B_VE": [0.5, 1.0]}})
    said = "the spec takes precedence over the preset touch: device.mass = 0.1 and not 0.045"
    for table in (intervals(spec), responses([spec]), passivity(spec), why(spec)):
        assert said in table.facts["notices"]
