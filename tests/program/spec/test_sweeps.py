"""Axes hold what their key can take; the axis of the intervals may be a span, the others have values."""

import pytest

from wavesweep.engine.errors import SpecError
from wavesweep.program.spec import KEYS, SYMBOLS, load, sweep_axes

EDGES = {"passband_hz": 10, "stopband_hz": 40, "passband_db": 1, "stopband_db": 40}


def spec(sweep=None, bode=None, **tables):
    return load({"controller": {"kind": "pmw-lm"}, "sweep": sweep or {}, "bode": bode or {}} | tables)


def test_every_numeric_key_can_be_an_axis():
    for name in (*SYMBOLS, *(key.path for key in KEYS.values() if key.numeric)):
        path = SYMBOLS.get(name, name)
        filters = {path.split(".")[1]: EDGES} if path.endswith(("band_hz", "band_db")) else {}
        if path.startswith("filters.hp.") and filters:
            filters = {"hp": EDGES | {"passband_hz": 40, "stopband_hz": 10}}
        (axis,) = spec({name: [1]}, filters=filters).sweep
        assert (axis.name, axis.path, axis.values, axis.start, axis.stop) == (name, path, (1,), 1, 1)
        assert {type(value) for value in axis.values} == {int if KEYS[path].type == "integer" else float}


def test_spans_have_values_where_num_is_given():
    axes = spec(
        {
            "B_VE": {"start": 0, "stop": 15, "num": 4},
            "b": {"start": 1, "stop": 100, "num": 3, "scale": "log"},
            "Kp": {"start": 5, "stop": 5, "num": 1},
            "rates.ratio": {"start": 10, "stop": 30, "num": 3},
            "K_LM": {"start": 0, "stop": 9},
        }
    ).sweep
    assert [axis.values for axis in axes] == [(0.0, 5.0, 10.0, 15.0), (1.0, 10.0, 100.0), (5.0,), (10, 20, 30), ()]
    assert [(axis.start, axis.stop) for axis in axes] == [(0.0, 15.0), (1.0, 100.0), (5.0, 5.0), (10, 30), (0.0, 9.0)]


def test_frequencies_up_to_half_the_rate_are_allowed_and_the_default_ones_fit_it():
    pmw = {"controller": {"kind": "pmw"}}
    load(pmw | {"bode": {"frequency_hz": [1, 300]}}, ["rates.fast_hz=600"])
    load(pmw | {"rates": {"fast_hz": 60.0, "ratio": 2}})  # whose own default goes up to 50 Hz


def test_the_axis_of_the_intervals_is_set_apart():
    swept = spec({"b": [1], "K_VE": {"start": 0, "stop": 9}, "Kp": [0, 1]})
    along, others = sweep_axes(swept)
    assert (along.name, along.start, along.stop) == ("K_VE", 0.0, 9.0)
    assert [axis.name for axis in others] == ["b", "Kp"]
    assert sweep_axes(swept, "environment.K_VE") == (along, others)


@pytest.mark.parametrize(
    ("sweep", "along", "words"),
    [
        ({"along": "B_VE"}, None, "sweep.B_VE: expected a span to search"),
        ({"B_VE": [3]}, "B_VE", "sweep.B_VE: expected a span to search"),
        ({}, "BVE", 'along: expected the name of a numeric key, found "BVE"; did you mean `B_VE`?'),
        ({}, "controller.kind", 'along: expected the name of a numeric key, found "controller.kind", which takes no number'),
    ],
)
def test_a_sweep_that_cannot_be_computed_is_refused_when_it_is_used(sweep, along, words):
    with pytest.raises(SpecError) as error:
        sweep_axes(spec(sweep), along)
    assert str(error.value).startswith(words)
