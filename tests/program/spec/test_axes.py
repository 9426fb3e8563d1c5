"""Spaced numbers are numpy's; an axis may have one value, and a name that is none has a nearest one."""

import math

import numpy as np
import pytest

from wavesweep.engine._keys.checking import nearest
from wavesweep.engine.errors import SpecError
from wavesweep.program.reading.axes import linear, logarithmic
from wavesweep.program.reading.keys import KEYS
from wavesweep.program.spec import load


@pytest.mark.parametrize(
    ("start", "stop", "num"), [(0.0, 15.0, 151), (5.0, 5.0, 1), (0.0, 1.7e308, 7), (3.7e-5, 0.21, 83), (2e5, 1e9, 499)]
)
def test_spaced_numbers_are_those_of_numpy_with_exact_ends(start, stop, num):
    assert list(linear(start, stop, num)) == np.linspace(start, stop, num).tolist()
    if start > 0:
        values = logarithmic(start, stop, num)
        assert (values[0], values[-1], len(values)) == (start, stop, num)
        # A power magnifies the last place of its exponent by log(10) times the exponent.
        places = 4 * math.log(10) * max(1, abs(math.log10(start)), abs(math.log10(stop)))
        np.testing.assert_allclose(values, np.geomspace(start, stop, num), rtol=places * np.finfo(float).eps, atol=0)


def test_an_axis_of_one_value_begins_and_ends_there(write):
    (axis,) = load(write('[controller]\nkind = "pmw"\n[sweep]\nb = { start = 1, stop = 1, num = 1 }\n')).sweep
    assert axis.values == (1.0,)
    with pytest.raises(SpecError, match=r"sweep\.b\.stop: expected a number > start = 1\.0, found 1"):
        load(write('[controller]\nkind = "pmw"\n[sweep]\nb = { start = 1, stop = 1, num = 2 }\n'))


@pytest.mark.parametrize(
    ("name", "known", "meant"),
    [
        ("hz", ["wire.hz", "hx"], "wire.hz"),
        ("KP", ["KP2", "kp"], "kp"),
        ("rate.hz", ["bench.hz", "rates.hz"], "rates.hz"),
        ("mass", ["every"], ""),
        ("kind", KEYS, "controller.kind"),
        ("device.mas", KEYS, "device.mass"),
        ("x" * 10**6, KEYS, ""),
        ("", KEYS, ""),
    ],
)
def test_the_nearest_name_is_the_same_one_elsewhere_or_in_other_case_before_the_closest(name, known, meant):
    assert nearest(name, known) == meant
