"""The table of keys agrees with itself; every key takes its own default and nothing beyond its range."""

import math

import pytest

from wavesweep.engine._keys.checking import Rejected, check, show
from wavesweep.program.reading.keys import KEYS, SYMBOLS, VALUE_PATHS, find_key
from wavesweep.program.reading.tables import study_keys


def test_every_key_says_what_it_is_and_takes_its_own_default():
    for key in (*KEYS.values(), *study_keys().values()):
        assert key.description
        assert key.type in ("number", "integer", "string", "boolean", "list")
        assert bool(key.unit) == key.numeric or key.type == "list"
        if key.type == "string" and key.choices and key.path != "controller.kind":
            assert set(key.meanings) == set(key.choices)
    for key in map(KEYS.get, VALUE_PATHS):
        if key.path != "controller.kind":  # which has none
            checked = check(key, key.default)
            assert checked == key.default
            assert type(checked) is {"number": float, "integer": int, "string": str}[key.type]


def test_ranges_end_where_they_say():
    for key in KEYS.values():
        if not key.numeric:
            continue
        if key.choices:
            inside, outside = key.choices, (-1, 2, 0.5)
        else:
            step = 1 if key.type == "integer" else 1e-9
            inside = [key.low + step if key.above_low else key.low]
            outside = [key.low if key.above_low else key.low - step, -1e300]
            if key.high is not None:
                inside, outside = [*inside, key.high], [*outside, math.nextafter(key.high, math.inf), key.high + 1]
        for value in inside:
            assert check(key, value) == value
        for value in outside:
            with pytest.raises(Rejected):
                check(key, value)


def test_whole_numbers_and_floats_stand_for_each_other_where_nothing_is_lost():
    assert type(check(KEYS["device.mass"], 3)) is float
    assert type(check(KEYS["rates.ratio"], 20.0)) is int
    assert math.copysign(1.0, check(KEYS["environment.K_VE"], -0.0)) == 1.0
    with pytest.raises(Rejected, match=r"expected a whole number >= 1, found 20.5"):
        check(KEYS["rates.ratio"], 20.5)


@pytest.mark.parametrize(
    ("value", "text"),
    [("a\nb", r'"a\nb"'), ("x" * 10**5, '"' + "x" * 56 + "..."), ({}, "a table"), ([], "an empty list"), (1.5, "1.5")],
)
def test_whatever_was_found_is_shown_on_one_short_line(value, text):
    assert show(value) == text


def test_symbols_and_paths_find_keys():
    assert {find_key(symbol).path for symbol in SYMBOLS} == set(SYMBOLS.values())
    assert find_key("device.mass") is KEYS["device.mass"]
    assert find_key("frequency_hz") is None
