"""The table [design] is read with all mistakes at once, and written as a spec could give it."""

import tomllib

import pytest
from support.drawn import ARM

from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.spec import load

LOOP = {"controller": {"kind": "pmw-lm"}}
DESIGN = {
    "vary": {
        "b": {"start": 5, "stop": 200, "scale": "log"},
        "filters.lp1.order": [1, 2, 3],
        "filters.lp2.order": {"start": 0, "stop": 2},
    },
    "wish": {
        "z_width": {"at_least": 1000, "B_VE": [0, 1]},
        "transparency": {"band_hz": [0.1, 10], "walls": [100, 300]},
        "channel": {},
    },
    "seed": 7,
}  # fmt: skip


@pytest.mark.asks("passive")
def test_a_design_is_read_whole():
    design = load(LOOP | {"design": DESIGN}).design
    assert [(axis.path, axis.values, axis.scale) for axis in design.vary] == [
        ("controller.b", (), "log"),
        ("filters.lp1.order", (1, 2, 3), None),
        ("filters.lp2.order", (0, 1, 2), None),
    ]
    assert [(wish.name, wish.bound) for wish in design.wishes] == [
        ("z_width", 1000.0),
        ("transparency", None),
        ("channel", None),
    ]
    assert design.wishes[1].options == {"band_hz": (0.1, 10.0), "walls": (100.0, 300.0)}
    assert design.settings == {"seed": 7, "population": 96, "generations": 80}


@pytest.mark.asks("passive")
def test_the_design_is_part_of_the_request_only_if_it_is_asked_for():
    spec, plain = load(LOOP | {"design": DESIGN}), load(LOOP)
    assert spec.sha256 == plain.sha256
    asked = spec.asking("design")
    assert asked.sha256 != plain.sha256
    again = load(asked.tables()).asking("design")
    assert (again.sha256, again.design) == (asked.sha256, asked.design)
    with pytest.raises(UsageError, match=r"expected the tables \[design.vary\] and \[design.wish\], found none"):
        plain.asking("design")


@pytest.mark.asks("passive")
def test_the_old_table_of_what_designs_hold_for_is_refused_with_what_to_write():
    held = {"device.mass": [0.08, 0.125], "hand": {"damping": [0, 5]}}
    with pytest.raises(SpecError, match=r'design.for_all: expected .* in \[for_all\].*"operator.damping" = \[0, 5\]'):
        load(LOOP | {"design": DESIGN | {"for_all": held}})


def test_a_drawn_design_is_the_same_from_its_tables():
    asked = {"vary": {"block.arm.mass": [0.1, 0.2], "kp": {"start": 1, "stop": 2}}, "wish": {"settling": {"at_most": 1.0}}}
    spec = load(tomllib.loads(ARM) | {"design": asked}).asking("design")
    assert load(spec.tables()).asking("design").sha256 == spec.sha256
    assert spec.values["block.arm.mass"] == 0.2
