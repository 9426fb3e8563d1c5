"""Errors say what, where, found and expected."""

import pickle

from wavesweep.engine.errors import Mistake, SpecError


def test_a_spec_error_lists_its_mistakes_and_survives_a_process_border():
    error = SpecError(Mistake("", key, "X", "Y") for key in "ab")
    assert str(error).splitlines() == ["a: expected X, found Y", "b: expected X, found Y"]
    copy = pickle.loads(pickle.dumps(error))  # noqa: S301 - made on the line
    assert copy.mistakes == error.mistakes
