"""The table of keys agrees with itself; every key takes its own default and nothing beyond its range."""

import math

import pytest

from wavesweep.engine._keys.checking import Rejected, check, nearest, show
from wavesweep.program.reading.keys import KEYS, SYMBOLS, VALUE_PATHS, find_key
from wavesweep.program.reading.tables import study_keys

NUMERIC = [key for key in KEYS.values() if key.numeric]


@pytest.mark.parametrize("key", [*KEYS.values(), *study_keys().values()], ids=lambda key: key.path)
def test_every_key_says_what_it_is(key):
    assert key.description
    assert key.type in ("number", "integer", "string", "boolean", "list")
    assert bool(key.unit) == key.numeric or key.type == "list"
    assert key.unit.isascii()


@pytest.mark.parametrize("path", VALUE_PATHS)
def test_defaults_pass_their_own_check(path):
    key = KEYS[path]
    if key.default is None:
        assert path == "controller.kind"
    else:
        checked = check(key, key.default)
        assert checked == key.default
        assert type(checked) is {"number": float, "integer": int, "string": str}[key.type]


@pytest.mark.parametrize("key", NUMERIC, ids=lambda key: key.path)
def test_ranges_end_where_they_say(key):
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
    with pytest.raises(Rejected, match=r"expected a whole number >= 1, found 20.5"):
        check(KEYS["rates.ratio"], 20.5)


def test_negative_zero_is_zero():
    assert math.copysign(1.0, check(KEYS["environment.K_VE"], -0.0)) == 1.0


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


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("kind", "controller.kind"),
        ("k_ve", "environment.K_VE"),
        ("device.mas", "device.mass"),
        ("device.K_VE", "environment.K_VE"),
        ("zzz", ""),
        ("x" * 10**6, ""),
        ("", ""),
    ],
)
def test_the_nearest_known_key_is_found_or_none(name, meant):
    assert nearest(name, KEYS) == meant
