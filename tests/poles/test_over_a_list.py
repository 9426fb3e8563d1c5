"""The root locus of a number that [sweep] lists goes through its range."""

import wavesweep
from wavesweep.poles.table import axis_over

WAVES = {"controller": {"kind": "pmw"}}
TWENTY = {"controller": {"kind": "pmw", "b": 20.0}}


def test_a_list_is_a_range_of_the_locus_and_one_value_is_none():
    values = axis_over(wavesweep.load(WAVES | {"sweep": {"b": [10.0, 20.0, 80.0]}}), "b").values
    assert (len(values), values[0], values[-1]) == (300, 10.0, 80.0)
    factors = axis_over(
        wavesweep.load(WAVES | {"sweep": {"b": {"start": 1, "stop": 100, "num": 3, "scale": "log"}}}), "b"
    ).values
    assert (len(factors), round(factors[1] / factors[0], 9)) == (300, round(factors[-1] / factors[-2], 9))
    single = axis_over(wavesweep.load(TWENTY | {"sweep": {"b": [20.0]}}), "b").values
    assert single == axis_over(wavesweep.load(TWENTY), "b").values
    ratios = axis_over(wavesweep.load(WAVES | {"sweep": {"rates.ratio": [2, 5, 9]}}), "rates.ratio").values
    assert list(ratios) in ([2, 5, 9], list(range(2, 10)))


def test_a_slow_rate_is_followed_about_its_own_value():
    """Which the spec has as a ratio."""
    values = axis_over(wavesweep.load(TWENTY | {"rates": {"slow_hz": 50.0}}), "rates.slow_hz").values
    assert min(values) < 50.0 < max(values)
