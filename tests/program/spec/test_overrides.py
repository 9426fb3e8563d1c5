"""`--set` replaces what the spec gives before anything is checked, and says its own mistakes."""

import tomllib

import pytest

from wavesweep.program.spec import SYMBOLS, load

LOOP = {"controller": {"kind": "pmw"}}


@pytest.mark.parametrize(
    ("override", "path", "value"),
    [
        ("controller.b=40", "controller.b", 40.0),
        (" controller.b = 40 ", "controller.b", 40.0),
        ("controller.kind=pmw-lm", "controller.kind", "pmw-lm"),
        ('controller.kind="dc"', "controller.kind", "dc"),
        ("device.velocity='difference'", "device.velocity", "difference"),
        ("rates.ratio=1_0", "rates.ratio", 10),
        ("rates.slow_hz=25", "rates.ratio", 40),
        ("filters.lp1.order=6", "filters.lp1.order", 6),
        ("filters.lp1={ order = 3, cutoff_hz = 5 }", "filters.lp1.cutoff_hz", 5.0),
        ('"device"."mass"=2', "device.mass", 2.0),
        *((f"{symbol}=3.5", path, 3.5) for symbol, path in SYMBOLS.items()),
    ],
)
def test_a_key_is_replaced(override, path, value):
    assert load(LOOP, [override]).values[path] == value


def test_the_last_of_several_counts_and_what_it_replaces_is_not_checked():
    assert load(LOOP | {"device": {"mass": "heavy"}}, ["device.mass=2", "device.mass=3"]).values["device.mass"] == 3.0


@pytest.mark.parametrize(
    ("given", "override", "ratio"), [({"slow_hz": 50}, "rates.ratio=10", 10), ({"ratio": 10}, "rates.slow_hz=50", 20)]
)
def test_ratio_and_slow_rate_displace_each_other(given, override, ratio):
    assert load(LOOP | {"rates": given}, [override]).values["rates.ratio"] == ratio


@pytest.mark.parametrize(
    ("given", "overrides", "ratio"),
    [
        ({"slow_hz": 50}, ["rates.ratio=17", "rates.slow_hz="], 17),
        ({"ratio": 10}, ["rates.slow_hz=25", "rates.ratio="], 40),
    ],
)
def test_the_order_of_overrides_of_ratio_and_slow_rate_does_not_matter(given, overrides, ratio):
    for some in (overrides, overrides[::-1]):
        assert load(LOOP | {"rates": given}, some).values["rates.ratio"] == ratio


@pytest.mark.parametrize("name", ["device.mass", '"device.mass"'])
def test_axes_are_replaced_in_their_turn(name):
    sweep = {"b": [1, 2], "device.mass": {"start": 1, "stop": 2, "num": 2}, "Kp": [0]}
    spec = load(LOOP | {"sweep": sweep}, [f"sweep.{name}.num=3", "sweep.b=[5]", "sweep.along=B_VE", "sweep.K_LM=[1]"])
    axes = [(axis.name, axis.values) for axis in spec.sweep]
    assert axes == [("b", (5.0,)), ("device.mass", (1.0, 1.5, 2.0)), ("Kp", (0.0,)), ("K_LM", (1.0,))]
    assert spec.along == "B_VE"


def test_an_override_without_a_value_leaves_the_key_out():
    tables = {"controller": {"kind": "pmw", "b": 40.0}, "sweep": {"b": [20, 30], "device.mass": [0.1, 0.2]}}
    spec = load(tables, ["b=", "sweep.device.mass="])
    assert spec.values["controller.b"] == 25.0
    assert [axis.name for axis in spec.sweep] == ["b"]


NAMES = """
rates.tick_hz = 100
numbers.contact = { value = 6.0, unit = "N*s/m" }
type.watch.numbers.g = 2.0
type.watch.block.k = { type = "gain", k = "g" }
type.watch.wire = { "k.u" = "seen" }
type.watch.ports = { inputs = ["seen"], outputs = { told = "k.y" } }
block.x = { type = "mass", mass = 0.1, damping = "contact" }
block.one = { type = "watch" }
wire = { "one.seen" = "-100*x.x", "x.f" = "one.told" }
"""


@pytest.mark.parametrize(
    ("text", "written", "override", "axes"),
    [
        (None, {"controller.b": [3]}, "b=[5, 6]", {"controller.b": (5, 6)}),
        (None, {"b": {"start": 3, "stop": 4}}, "controller.b.stop=9", {"b": (3, 9)}),
        (
            None,
            {"b": [1], "rates.slow_hz": {"start": 20, "stop": 50}},
            "rates.ratio=[4, 5]",
            {"b": (1,), "rates.ratio": (4, 5)},
        ),
        (None, {"rates.ratio": [4, 5]}, "rates.slow_hz=[20, 50]", {"rates.slow_hz": (20, 50)}),
        (None, {"rates.ratio": [4, 5], "controller.b": [3]}, "b=", {"rates.ratio": (4, 5)}),
        (None, {"environment.delay": [0, 1], "B_VE": [1]}, "B_VE=[2, 3]", {"environment.delay": (0, 1), "B_VE": (2, 3)}),
        (NAMES, {"numbers.contact": [3]}, "contact=[5, 6]", {"numbers.contact": (5, 6)}),
        (NAMES, {"contact": {"start": 3, "stop": 4}}, "numbers.contact.start=2", {"contact": (2, 4)}),
        (NAMES, {"one_g": [1]}, "numbers.one_g=[2, 3]", {"one_g": (2, 3)}),
        (NAMES, {"contact": [1], "numbers.contact": [2]}, "contact=[5, 6]", {"contact": (5, 6)}),
        (NAMES, {"contact": [1]}, "numbers.one_g=[2, 3]", {"contact": (1,), "numbers.one_g": (2, 3)}),
    ],
)
@pytest.mark.whole
@pytest.mark.parametrize("table", ["sweep", "for_all"])
def test_a_number_of_a_table_is_replaced_by_any_of_its_names(table, text, written, override, axes):
    """It keeps the name that the table has; the other key of the slow rate is left out."""
    if table == "for_all" and "slow_hz" in f"{written}{override}":
        pytest.skip("[for_all] has ratios alone")
    spec = load((tomllib.loads(text) if text else LOOP) | {table: written}, [f"{table}.{override}"])
    read = spec.sweep if table == "sweep" else spec.for_all.axes
    assert {axis.name: axis.values or (axis.start, axis.stop) for axis in read} == axes


def test_a_number_of_a_class_is_replaced_by_any_of_its_names():
    loop = tomllib.loads(NAMES)
    for name in ("one_g", "numbers.one_g", "block.one.g"):
        assert load(loop, ["block.one.g=7", f"{name}=3", "contact=6000 g/s"]).values["numbers.one_g"] == 3.0
