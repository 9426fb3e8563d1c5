"""The specs of designs that a search found."""

from wavesweep.seeking.best import text_of
from wavesweep.spec import load

SPEC = {
    "controller": {"kind": "pmw"},
    "design": {
        "vary": {"b": {"start": 5.0, "stop": 80.0}},
        "wish": {"z_width": {}},
        "for_all": {"device.mass": [0.08, 0.125], "hand": {"stiffness": [0.0, 1000.0]}},
    },
}


def test_what_sets_the_worst_is_swept_if_it_lies_between_the_listed_values():
    row = {"b": 18.0, "z_width": 844.2, "z_width_scenario": "device.mass=0.1025, operator.stiffness=1000"}
    text = text_of(load(SPEC), row, 20000.0)
    assert '"device.mass" = [0.08, 0.1025, 0.125]' in text
    assert '"operator.stiffness" = [0.0, 1000.0]' in text
