"""The table [design] is read with all mistakes at once, and written as a spec could give it."""

import tomllib

import pytest
from support.drawn import ARM

from wavesweep.engine.errors import UsageError
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
    "for_all": {"device.mass": [0.08, 0.125], "K_LM/K_VE": [0.5, 2], "hand": {"mass": [0, 0.3], "stiffness": [0, 1000]}},
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
    assert design.ratios == (("local_model.K_LM", "environment.K_VE", (0.5, 2.0)),)
    assert design.hand == {"mass": (0.0, 0.3), "stiffness": (0.0, 1000.0)}
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


@pytest.mark.parametrize(
    ("varied", "ratios"),
    [
        ("Kp", {"filters.lp1.cutoff_hz/b": [0.04], "filters.hp.cutoff_hz/filters.lp1.cutoff_hz": [60]}),
        ("Kp", {"B_LM/K_VE": [0.05]}),
        ("b", {"device.damping/Kp": [1]}),
    ],
)
def test_numbers_that_ratios_set_may_go_to_the_ends_of_their_ranges(varied, ratios):
    design = {"vary": {varied: [1, 2]}, "wish": {"z_width": {"B_VE": [1, 100]}}, "for_all": ratios}
    assert load({"controller": {"kind": "pmw-lm", "b": 20.0}, "design": design}).design.ratios


def test_a_drawn_design_is_the_same_from_its_tables():
    asked = {"vary": {"block.arm.mass": [0.1, 0.2], "kp": {"start": 1, "stop": 2}}, "wish": {"settling": {"at_most": 1.0}}}
    spec = load(tomllib.loads(ARM) | {"design": asked | {"for_all": {"block.net.steps": {"start": 0, "stop": 3}}}}).asking(
        "design"
    )
    assert load(spec.tables()).asking("design").sha256 == spec.sha256
    assert spec.design.for_all[0].values == (0, 3)
    assert spec.values["block.arm.mass"] == 0.2
