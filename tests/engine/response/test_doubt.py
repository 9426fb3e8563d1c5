"""Bounds and doubts of response rows, and the loops on which digits or the answer used to be lost."""

import numpy as np
import pandas
import pytest
from support.specs import KINDS, nested, values_of

import wavesweep


def table(kind, frequency, **changes):
    """The rows of one loop."""
    return wavesweep.compile(nested(values_of(kind, **changes))).response(frequency)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("multiple", [50.0, 100.0])
def test_free_space_is_smooth_at_multiples_of_the_slow_rate(kind, multiple):
    """Nothing happens there: the middle is the mean of its neighbours but for the curvature."""
    rows = table(kind, multiple + np.array([-1e-4, -1e-9, 0, 1e-9, 1e-4]), K_VE=0.0, Kp=20.0)
    response = (rows["admittance_re"] + 1j * rows["admittance_im"]).to_numpy()
    middle = (response[0] + response[-1]) / 2
    assert np.max(np.abs(response[1:-1] / middle - 1)) < 1e-8
    assert rows["admittance_error"].max() < 1e-10
    assert (rows["stable"] | (rows["doubt"] == "unstable")).all()


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


@pytest.mark.parametrize("changes", [{}, {"delay": 7}, {"ratio": 2, "delay": 1}])
def test_the_gain_of_a_held_loop_does_not_notice_a_multiple_of_the_slow_rate(changes):
    """Position feedback holds the scene: next to the multiple, however near, the gain is that of the multiple."""
    rate = 1000 / changes.get("ratio", 20)
    rows = table("pmw", rate * (1 + np.array([0, 1e-12, -1e-8])) if rate < 500 else [500.0], Kp=20.0, **changes)
    assert np.ptp(rows["worst_gain"]) <= 1e-11 * rows["worst_gain"].max()
    assert rows["worst_gain_error"].max() < 1e-9


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ratio", [20, 40])
def test_a_row_does_not_depend_on_what_else_is_in_the_table(kind, ratio):
    """A loop alone, and one of seven of which some need the larger system and the longer iteration."""
    stiffness = [0.0, 1e-6, 20.0, 90.0, 100.0, 300.0, 5000.0]
    frequency = [1e-5, 0.3, 1000 / ratio, 1000 / ratio * (1 + 1e-9), 333.3]
    loop = wavesweep.compile(nested(values_of(kind, damping=1e-6, ratio=ratio)))
    together = loop.response(frequency, K_VE=stiffness).drop(columns="K_VE")
    for index, K in enumerate(stiffness):
        alone = loop.response(frequency, K_VE=[K]).drop(columns="K_VE")
        rows = together.iloc[index * len(frequency) : (index + 1) * len(frequency)].reset_index(drop=True)
        said = [name for name in alone if name.endswith(("_error", "_deg"))]
        pandas.testing.assert_frame_equal(alone.drop(columns=said), rows.drop(columns=said), rtol=1e-8)
