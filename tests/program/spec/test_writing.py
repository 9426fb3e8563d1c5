"""Specs as TOML text: loading the text gives the same request."""

import tomllib

from support.specs import shipped

from wavesweep.program.spec import load
from wavesweep.program.spec.writing import as_toml


def test_the_text_of_a_spec_is_the_same_request():
    for path in shipped():
        tables = load(path).tables()
        assert tomllib.loads(as_toml(tables)) == as_lists(tables), path


def as_lists(value):
    """The value as TOML has it."""
    if isinstance(value, dict):
        return {name: as_lists(part) for name, part in value.items() if part is not None and part != {}}
    return [as_lists(part) for part in value] if isinstance(value, (list, tuple)) else value


def test_odd_texts_keys_and_numbers_survive():
    tables = {
        "a": {
            "b c": 'quote " and \\ and \x7f and \t',
            "é": [1e-300, 1e22, -0.0, 3],
            "t": True,
            "in": {"x.y": "ü", "n": [[1, 2]]},
        },
        "block": {"one": {"type": "mass", "mass": "m1 + m2"}, "two-2": {"A": [[0.5]], "discrete": False}},
        "wire": {"net.u": "arm.x"},
    }
    assert tomllib.loads(as_toml(tables)) == tables
