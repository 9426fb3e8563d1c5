"""Bounds and doubts of response rows, and the loops on which digits or the answer used to be lost."""

import numpy as np
import pytest
from support.specs import KINDS, nested, values_of

import wavesweep


def table(kind, frequency, **changes):
    """The rows of one loop."""
    return wavesweep.compile(nested(values_of(kind, **changes))).response(frequency)


@pytest.mark.parametrize("kind", ["dc", "dc-slow", "pmw", "pmw-lm"])
def test_a_resonance_of_the_open_loop_is_none_of_the_closed_one(kind):
    """An undamped device on a hand's spring, at its own frequency: as its neighbours, and damped by the wall."""
    own = np.sqrt(1000.0) / 2 / np.pi
    rows = table(kind, own * (1 + np.array([-1e-6, -1e-9, 0, 1e-12, 1e-6])), damping=0.0, stiffness=100.0, K_VE=20.0, B_VE=0.5)
    assert rows["admittance_abs"].max() < 1.0001 * rows["admittance_abs"].min()
    assert rows["admittance_error"].max() < 1e-10


def test_an_unstable_loop_is_said_to_have_no_steady_response():
    rows = table("dc-slow", [1.0, 10.0], K_VE=5000.0)
    assert (~rows["stable"]).all()
    assert rows["doubt"].tolist() == ["unstable", "unstable"]


def test_a_frame_that_overflows_has_no_number_and_says_so():
    rows = table("pmw-lm", [1.0], ratio=1000, delay=500, K_LM=1e9, **{"local_model.integration": "explicit"})
    assert rows["doubt"].tolist() == ["overflow"]
    assert rows[["admittance_abs", "impedance_abs", "admittance_error"]].isna().all(axis=None)


@pytest.mark.parametrize("kind", KINDS)
def test_ordinary_rows_are_vouched_for(kind):
    """From 1 mHz to half the fast rate; a bound is small, and the words are those of the list."""
    rows = table(kind, np.geomspace(1e-3, 499, 200), K_VE=100.0, Kp=20.0)
    assert set(rows["doubt"]) == {""}
    assert rows[["admittance_error", "impedance_error", "worst_gain_error"]].max(axis=None) < 1e-7
