"""The table [design] is read with all mistakes at once, and written as a spec could give it."""

import tomllib

import pytest
from support.drawn import ARM, WALL

from wavesweep.errors import SpecError, UsageError
from wavesweep.spec import load

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


def test_the_design_is_part_of_the_request_only_if_it_is_asked_for():
    spec, plain = load(LOOP | {"design": DESIGN}), load(LOOP)
    assert spec.sha256 == plain.sha256
    asked = spec.as_designed()
    assert asked.sha256 != plain.sha256
    again = load(asked.tables()).as_designed()
    assert (again.sha256, again.design) == (asked.sha256, asked.design)
    with pytest.raises(UsageError, match=r"expected the tables \[design.vary\] and \[design.wish\], found none"):
        plain.as_designed()


MISTAKES = [
    ({"wish": {"z_widt": {}}}, "design.wish.z_widt: expected one of z_width, felt", "did you mean `z_width`?"),
    ({"wish": {"z_width": {"at_most": 3}}}, "design.wish.z_width.at_most: expected one of at_least, B_VE", ""),
    ({"wish": {"z_width": {"B_VE": []}}}, "design.wish.z_width.B_VE: expected a list of numbers, found an empty list", ""),
    ({"wish": {"transparency": {"band_hz": [3, 1]}}}, "expected the lowest frequency first", ""),
    (
        {"wish": {"transparency": {"band_hz": [1, 501]}}},
        "design.wish.transparency.band_hz: expected numbers <= 500 (half of rates.fast_hz), found 501",
        "",
    ),
    ({"wish": {"felt": {}}}, "expected at most two wishes without a bound, found 3: transparency, channel, felt", ""),
    ({"vary": {"bb": [1]}}, "design.vary.bb: expected the name of a numeric key", "did you mean `b`?"),
    ({"vary": {"K_VE": [1]}}, "design.vary.K_VE: expected a number of the device or the controller", ""),
    ({"vary": {"device.mass": [0.1]}}, "design.for_all.device.mass: expected a number that is not varied", ""),
    ({"for_all": {"hand": {"weight": [1]}}}, "design.for_all.hand.weight: expected one of mass, damping, stiffness", ""),
    ({"for_all": {"K_VE": [1]}}, "walls belong to the wishes", ""),
    ({"for_all": {"K_LM/K_VE": [-1]}}, "design.for_all.K_LM/K_VE[0]: expected a number > 0, found -1", ""),
    ({"for_all": {"K_VE/K_LM": [1]}}, "for_all.K_VE/K_LM: expected a ratio of a number that is neither a wall nor whole", ""),
    ({"for_all": {"B_VE/B_LM": [1]}}, "neither a wall nor whole, found environment.B_VE", ""),
    ({"for_all": {"environment.delay/rates.ratio": [0.3]}}, "neither a wall nor whole, found environment.delay", ""),
    ({"for_all": {"B_LM/B_LM": [1]}}, "lead to a number of the spec, found local_model.B_LM to local_model.B_LM", ""),
    ({"for_all": {"B_LM/Kp": [1], "Kp/B_LM": [1]}}, "found local_model.B_LM to controller.Kp to local_model.B_LM", ""),
    ({"for_all": {"B_LM/filters.lp1.passband_hz": [1]}}, "a number that every spec has, found filters.lp1.passband_hz", ""),
    ({"for_all": {"B_LM/controller.kind": [1]}}, "a ratio to a number that every spec has, found controller.kind", ""),
    ({"for_all": {"K_LM": [1], "foo/B_LM": [1]}}, "design.for_all.foo/B_LM: expected the name of a numeric key", ""),
    ({"for_all": {"K_LM": [1]}}, "expected each number once, found local_model.K_LM", ""),
    ({"vary": {"K_LM": [1, 2]}}, "for_all.K_LM/K_VE: expected a number that is not varied, found local_model.K_LM", ""),
    ({"for_all": {"operator.mass": [1]}}, "hand.mass: expected each number once, found operator.mass", ""),
    ({"vary": {"operator.mass": [0, 1]}}, "hand.mass: expected a number that is not varied, found operator.mass", ""),
    ({"vary": {"filters.lp1.cutoff_hz": {"start": 10, "stop": 1200}}}, "500.0 (half of rates.fast_hz), found 1200", ""),
    ({"vary": {"environment.delay": [0, 40]}}, "design.vary.environment.delay: expected a whole number <= 20", ""),
    ({"for_all": {"environment.delay": [0, 21]}}, "design.for_all.environment.delay: expected a whole number <= 20", ""),
    ({"for_all": {"filters.lp1.cutoff_hz/filters.hp.cutoff_hz": [60]}}, "500.0 (half of rates.fast_hz), found 600", ""),
    ({"vary": {"filters.lp1.passband_hz": {"start": 1, "stop": 2}}}, "the order or the cutoff of a filter", ""),
    ({"vary": {"controller.b": [5, 10]}}, "expected each key once, found the key of vary.b again", ""),
    ({"sed": 1}, "design.sed: expected one of vary, wish, for_all, seed", "did you mean `seed`?"),
    ({"seed": -1}, "design.seed: expected a whole number >= 0, found -1", ""),
]  # fmt: skip


@pytest.mark.parametrize(("change", "text", "hint"), MISTAKES)
def test_each_mistake_has_its_text(change, text, hint):
    tables = {name: {**DESIGN[name], **change.get(name, {})} if name != "seed" else 7 for name in DESIGN} | {
        name: value for name, value in change.items() if name not in ("vary", "wish", "for_all")
    }
    with pytest.raises(SpecError) as error:
        load(LOOP | {"design": tables})
    assert text in str(error.value)
    assert hint in str(error.value)


def test_order_and_cutoff_of_a_filter_given_by_its_band_are_not_varied():
    band = {"passband_hz": 8.0, "stopband_hz": 40.0, "passband_db": 1.0, "stopband_db": 20.0}
    with pytest.raises(
        SpecError, match=r"design.vary.filters.lp1.order: expected an axis that fits filters.lp1, given by its band"
    ):
        load(LOOP | {"filters": {"lp1": band}, "design": DESIGN})


def test_nothing_to_vary_and_nothing_wished_for_are_mistakes():
    with pytest.raises(SpecError) as error:
        load(LOOP | {"design": {"seed": 3}})
    assert "design.vary: expected at least one number to vary, found none" in str(error.value)
    assert "design.wish: expected at least one of z_width" in str(error.value)


@pytest.mark.parametrize(
    ("varied", "ratios", "fault"),
    [
        ("Kp", {"filters.lp1.cutoff_hz/b": [0.04], "filters.hp.cutoff_hz/filters.lp1.cutoff_hz": [60]}, ""),
        ("Kp", {"filters.hp.cutoff_hz/filters.lp1.cutoff_hz": [8], "filters.lp1.cutoff_hz/b": [4]}, "half of rates.fast_hz"),
        ("Kp", {"filters.lp1.cutoff_hz/B_VE": [10]}, "half of rates.fast_hz"),
        ("Kp", {"filters.lp1.cutoff_hz/K_VE": [0.05]}, "half of rates.fast_hz"),
        ("Kp", {"B_LM/K_VE": [0.05]}, ""),
        ("b", {"device.damping/Kp": [1]}, ""),
        ("b", {"device.mass/Kp": [1]}, "device.mass/controller.Kp: expected a number > 0, found 0.0 of device.mass"),
    ],
)
def test_numbers_that_ratios_set_stay_in_their_ranges(varied, ratios, fault):
    design = {"vary": {varied: [1, 2]}, "wish": {"z_width": {"B_VE": [1, 100]}}, "for_all": ratios}
    tables = {"controller": {"kind": "pmw-lm", "b": 20.0}, "design": design}
    if fault:
        with pytest.raises(SpecError, match=fault):
            load(tables)
    else:
        assert load(tables).design.ratios


@pytest.mark.parametrize(
    ("design", "mistakes"),
    [
        (
            {"wish": {"transparency": {}}},
            ["wish.transparency: expected one of z_width, felt, free_motion, port, damping_ratio, settling"],
        ),
        ({"wish": {"z_width": {}}}, ["wish.z_width: expected a loop with a wall in [ports], found none"]),
        ({"wish": {"port": {"walls": [1]}}}, ["wish.port: expected a loop with a wall in [ports], found none"]),
        ({"for_all": {"hand": {"mass": [0]}}}, ["for_all.hand: expected numbers of the drawing, in which the hand is a block"]),
        ({"for_all": {"kp/kd": [1, 2]}}, ["for_all.kp/kd: expected a ratio to a number that every spec has"]),
        ({"vary": {"half": {"start": 5.0, "stop": 10.0}}}, ["vary.half: expected a list of choices, since"]),
        ({"for_all": {"half": [5.0, 10.0]}}, ["for_all.half: expected a whole number, or one that"]),
        ({"vary": {"q": [1]}}, ["vary.q: expected the name of a numeric key, found an unknown one"]),
        ({"vary": {"block.arm.mas": [1]}}, ["vary.block.arm.mas: expected the name of a numeric key, found an unknown one"]),
    ],
)
def test_a_drawn_loop_has_its_own_mistakes(design, mistakes):
    asked = {"vary": {"kp": {"start": 1, "stop": 2}}, "wish": {"settling": {}}} | design
    text = ARM.replace("every = 20", 'every = "2*half - 1"').replace("kp = 240.0", "kp = 240.0\nhalf = 10.5")
    with pytest.raises(SpecError) as refused:
        load(tomllib.loads(text) | {"design": asked})
    said = str(refused.value).splitlines()
    assert len(said) == len(mistakes)
    for line, start in zip(said, mistakes, strict=True):
        assert line.startswith(f"design.{start}")


def test_the_numbers_of_a_drawn_wall_belong_to_the_wishes():
    asked = {"vary": {"K": {"start": 1, "stop": 2}}, "wish": {"z_width": {}}, "for_all": {"B": [0, 1]}}
    with pytest.raises(SpecError) as refused:
        load(tomllib.loads(WALL) | {"design": asked})
    assert [mistake.key for mistake in refused.value.mistakes] == ["design.vary.K", "design.for_all.B"]


def test_a_drawn_design_is_the_same_from_its_tables():
    asked = {"vary": {"block.arm.mass": [0.1, 0.2], "kp": {"start": 1, "stop": 2}}, "wish": {"settling": {"at_most": 1.0}}}
    spec = load(
        tomllib.loads(ARM) | {"design": asked | {"for_all": {"block.net.steps": {"start": 0, "stop": 3}}}}
    ).as_designed()
    assert load(spec.tables()).as_designed().sha256 == spec.sha256
    assert spec.design.for_all[0].values == (0, 3)
    assert spec.values["block.arm.mass"] == 0.2
