"""Errors say what, where, found and expected; importing the package costs nothing."""

import pickle
import subprocess
import sys

import pytest

import wavesweep
from wavesweep import errors
from wavesweep.errors import Mistake, SpecError


def test_usage_errors_leave_with_2_and_failures_with_1():
    codes = {name: getattr(errors, name).exit_code for name in dir(errors) if name.endswith("Error")}
    assert codes == {
        "WavesweepError": 1,
        "IllPosedLoopError": 1,
        "UsageError": 2,
        "SpecError": 2,
        "CheckpointError": 2,
    }


@pytest.mark.parametrize(
    ("mistake", "text"),
    [
        (Mistake("a.toml:9:14", "rates.ratio", "X", "Y"), "a.toml:9:14: rates.ratio: expected X, found Y"),
        (Mistake("", "rates.ratio", "X", "Y"), "rates.ratio: expected X, found Y"),
        (Mistake("a.toml:1:1", "", "X", "Y"), "a.toml:1:1: expected X, found Y"),
        (Mistake("", "k", "X", "Y", "key"), "k: expected X, found Y; did you mean `key`?"),
    ],
)
def test_a_mistake_reads_as_one_line(mistake, text):
    assert str(mistake) == text


def test_a_spec_error_lists_its_mistakes_and_survives_a_process_border():
    error = SpecError(Mistake("", key, "X", "Y") for key in "ab")
    assert str(error).splitlines() == ["a: expected X, found Y", "b: expected X, found Y"]
    copy = pickle.loads(pickle.dumps(error))  # noqa: S301 - made on the line
    assert copy.mistakes == error.mistakes


def test_importing_the_package_loads_none_of_its_rooms_nor_any_library():
    code = "import sys; before = set(sys.modules); import wavesweep; print(*(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["wavesweep"]


def test_loading_a_spec_needs_no_numerical_library():
    code = (
        "import sys, wavesweep; wavesweep.load({'controller': {'kind': 'pmw'}});"
        "print(*({'numpy', 'scipy', 'difflib', 'json', 'hashlib', 'click', 'pathlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_names_are_found_when_touched_and_unknown_ones_refused():
    assert wavesweep.load.__module__.startswith("wavesweep.spec")
    assert set(wavesweep.__all__) <= set(dir(wavesweep))
    with pytest.raises(AttributeError, match="no attribute 'loads'"):
        wavesweep.loads  # noqa: B018 - touching the name is the test
