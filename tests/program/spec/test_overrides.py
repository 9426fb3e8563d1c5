"""`--set` replaces what the spec gives before anything is checked, and says its own mistakes."""

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
