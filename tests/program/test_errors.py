"""Errors say what, where, found and expected."""

import pickle

import wavesweep
from wavesweep.engine import errors
from wavesweep.engine.errors import Mistake, SpecError


def test_usage_errors_leave_with_2_and_failures_with_1():
    codes = {name: getattr(errors, name).exit_code for name in dir(errors) if name.endswith("Error")}
    assert codes == {
        "WavesweepError": 1,
        "IllPosedLoopError": 1,
        "UsageError": 2,
        "SpecError": 2,
    }
    assert wavesweep.CheckpointError.exit_code == 2


def test_a_spec_error_lists_its_mistakes_and_survives_a_process_border():
    error = SpecError(Mistake("", key, "X", "Y") for key in "ab")
    assert str(error).splitlines() == ["a: expected X, found Y", "b: expected X, found Y"]
    copy = pickle.loads(pickle.dumps(error))  # noqa: S301 - made on the line
    assert copy.mistakes == error.mistakes
