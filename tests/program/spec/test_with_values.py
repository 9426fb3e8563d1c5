"""A spec with other values is resolved and checked as one that was loaded so."""

from decimal import Decimal

import pytest

from wavesweep.engine.errors import SpecError
from wavesweep.program.spec import load

EDGES = {"passband_hz": 10, "stopband_hz": 40, "passband_db": 1, "stopband_db": 40}
BASE = {"controller": {"kind": "pmw-lm"}, "filters": {"lp2": EDGES}, "sweep": {"b": [1, 2]}}


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"controller.b": 40},
        {"rates.ratio": 7, "environment.delay": 7},
        {"rates.slow_hz": 25},
        {"rates.fast_hz": 500.0},
        {"filters.lp1.order": 6, "filters.lp1.cutoff_hz": 3},
        {"filters.lp2.passband_hz": 12},
        {"controller.kind": "dc", "environment.integration": "explicit"},
    ],
)
def test_changing_is_loading_with_the_change(changes):
    overrides = [f"{path}={value}" for path, value in changes.items()]
    assert load(BASE).with_values(changes).sha256 == load(BASE, overrides).sha256


@pytest.mark.parametrize(("ratio", "slow_hz"), [(1, 1000), (3, 1000 / 3), (7, 1000 / 7), (1000, 1)])
def test_ratio_and_slow_rate_say_the_same(ratio, slow_hz):
    one = load(BASE).with_values({"rates.slow_hz": slow_hz})
    other = one.with_values({"rates.slow_hz": 500}).with_values({"rates.ratio": ratio})
    assert one.values["rates.ratio"] == other.values["rates.ratio"] == ratio


@pytest.mark.parametrize(
    ("ratio", "slow_hz"), [(1, "50"), (3, "111.1"), (49, "0.7"), (93, "47.3"), (123, "0.1"), (999, "1e-7")]
)
def test_rates_that_divide_as_decimals_divide_as_doubles(ratio, slow_hz):
    rates = {"fast_hz": float(Decimal(slow_hz) * ratio), "slow_hz": float(slow_hz)}
    filters = {name: {"order": 0} for name in ("lp1", "hp", "lp2")}
    assert load(BASE | {"rates": rates, "filters": filters}).values["rates.ratio"] == ratio


@pytest.mark.parametrize("slow_hz", [30.0123456, 999.9, 0.5, 1e-60, 50 * (1 + 1e-14)])
def test_a_slow_rate_that_does_not_divide_the_fast_one_is_refused(slow_hz):
    with pytest.raises(SpecError, match=r"rates\.slow_hz: expected rates\.fast_hz = 1000\.0 divided by"):
        load(BASE).with_values({"rates.slow_hz": slow_hz})


def test_a_slow_rate_follows_the_fast_one():
    spec = load(BASE | {"rates": {"slow_hz": 50}})
    assert spec.with_values({"rates.fast_hz": 2000}).values["rates.ratio"] == 40
    assert spec.with_values({"rates.fast_hz": 1010}).values["rates.ratio"] == 20.2
    with pytest.raises(SpecError, match="divided by a whole number"):
        spec.with_values({"rates.fast_hz": 1010.123456})


def test_mistakes_come_all_at_once():
    changes = {"rates.ratio": 10, "rates.slow_hz": 100, "b": -1, "device.mas": 1, "filters.lp2.order": 3}
    with pytest.raises(SpecError) as error:
        load(BASE).with_values(changes)
    wrong = {"device.mas", "controller.b", "rates.slow_hz", "filters.lp2"}
    assert {mistake.key for mistake in error.value.mistakes} == wrong
