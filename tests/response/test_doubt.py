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


@pytest.mark.sample(5)
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("stiffness", [0.0, 100.0])
@pytest.mark.parametrize("local", [0.0, 500.0])
@pytest.mark.parametrize("ratio", [20, 40])
def test_without_a_wall_there_is_an_answer(kind, stiffness, local, ratio):
    """Nothing is read, nothing is held: the device alone, or what the local model adds to it."""
    rows = table(kind, [1.0, 1000 / ratio, 2000 / ratio], K_VE=0.0, B_VE=0.0, stiffness=stiffness, K_LM=local, ratio=ratio)
    assert np.isfinite(rows["admittance_abs"]).all()
    if kind in ("dc", "dc-slow"):  # P of the held device: x(k+1) = x + ..., a free mass-damper or on its spring
        s = 2j * np.pi * rows["frequency_hz"].to_numpy()
        np.testing.assert_allclose(rows["admittance_abs"], np.abs(1 / (0.1 * s**2 + 1.5 * s + stiffness)), rtol=0.05)
        assert (rows["impedance_abs"] == 0).all()


def test_an_unstable_loop_is_said_to_have_no_steady_response():
    rows = table("dc-slow", [1.0, 10.0], K_VE=5000.0)
    assert (~rows["stable"]).all()
    assert rows["doubt"].tolist() == ["unstable", "unstable"]


def test_a_frame_that_overflows_has_no_number_and_says_so():
    rows = table("pmw-lm", [1.0], ratio=1000, delay=500, K_LM=1e9, **{"local_model.integration": "explicit"})
    assert rows["doubt"].tolist() == ["overflow"]
    assert rows[["admittance_abs", "impedance_abs", "admittance_error"]].isna().all(axis=None)


def test_a_resonance_that_nothing_damps_is_not_known():
    """The device's own frequency, no wall, no damping: infinite, or whatever rounding makes of it."""
    rows = table("dc-slow", [np.sqrt(1000.0) / 2 / np.pi], damping=0.0, stiffness=100.0, K_VE=0.0, B_VE=0.0)
    assert rows["doubt"][0] in ("rounding", "unstable")
    assert not rows["admittance_error"][0] < 1e-6


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


@pytest.mark.sample(1)
@pytest.mark.parametrize("order", [5, 6, 12])
def test_a_filter_that_turns_by_half_circles_in_a_frame_makes_no_algebraic_loop(order):
    """Its poles lie on the imaginary axis, and two ticks take digits of its frame; the wall's delay is a whole frame."""
    filters = {"lp1": {"order": order, "cutoff_hz": 250.0}}
    tables = {"controller": {"kind": "pmw"}, "rates": {"ratio": 2}, "environment": {"delay": 2}, "filters": filters}
    loop = wavesweep.compile(tables)
    near = wavesweep.compile(tables | {"filters": {"lp1": {"order": order, "cutoff_hz": 250.0000001}}})
    found, expected = (each.response([1.0, 10.0]) for each in (loop, near))
    known = found["admittance_re"].notna()
    assert (known | (found["doubt"] != "")).all()
    np.testing.assert_allclose(found["admittance_re"][known], expected["admittance_re"][known], rtol=1e-6)
    assert loop.spectral_radius() == pytest.approx(near.spectral_radius(), rel=1e-6)
    assert loop.passivity()["port_margin"][0] == pytest.approx(near.passivity()["port_margin"][0], rel=1e-6)
