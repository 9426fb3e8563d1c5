"""The static limit and the stiffness felt, against 50 digits, laws of the model, and each other."""

import numpy as np
import pytest
from support import exact
from support.responses import loop_of
from support.specs import random_values, values_of

import wavesweep
from wavesweep.engine._response.steady import static_response


def static(values):
    """Static admittance and impedance of the loop."""
    return tuple(part.real for part in static_response(loop_of(values))[:2])


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "kind"), [(0, "pmw"), (5, "pmw"), (9, "pmw-lm")])
def test_random_loops_hold_at_50_digits(kind, seed):
    values = random_values(seed, kind)
    with np.errstate(all="raise"):
        admittance, impedance = static(values)
    wanted = [part.real for part in exact.response(values, 1e-9)]
    if not np.isnan(admittance):
        assert admittance == pytest.approx(float(wanted[0]), rel=1e-8)
    assert impedance == pytest.approx(float(wanted[1]), rel=1e-8, abs=1e-9)


def test_position_feedback_makes_the_wall_itself_felt():
    assert static(values_of("pmw-lm", Kp=20.0, K_VE=321.0))[1] == pytest.approx(321.0, rel=1e-11)


def test_waves_are_felt_as_a_spring_in_series():
    """1/K + tau/(2b), tau the filter's group delay and the mean hold delay; aliases vanish with the filter's order."""
    values = values_of("pmw", b=7.0, K_VE=321.0, lp1_order=8, delay=3)
    delay = -(exact.mp.log(exact.filter_response(8, 10.0, exact.mp.mpf("0.001"), False, exact.mp.expj("1e-20"))).imag) / 1e-17
    tau = float(delay) + 19 / 2 * 1e-3 + 3e-3
    assert static(values)[1] == pytest.approx(1 / (1 / 321.0 + tau / 14.0), rel=1e-7)


HEAVY = {  # a soft wave line before a heavy device: a row of the frame at rest loses eight digits
    "rates": {"fast_hz": 10000.0, "ratio": 2},
    "device": {"mass": 10.0, "velocity": "difference"},
    "controller": {"kind": "pmw-lm", "b": 2.0},
    "filters": {
        "lp1": {"order": 4, "cutoff_hz": 9.0},
        "hp": {"order": 4, "cutoff_hz": 2.0},
        "lp2": {"order": 1, "cutoff_hz": 20.0},
    },
}


@pytest.mark.slow
@pytest.mark.whole
@pytest.mark.parametrize(("tables", "K_VE", "wanted"), [(HEAVY, 2000.0, 82.8842235610805)])
def test_a_device_that_is_held_is_not_taken_for_one_that_moves(tables, K_VE, wanted):
    """The stiffness is the impedance at 1e-20 Hz in 80 digits."""
    spec = tables | {"environment": {"K_VE": K_VE}}
    row = wavesweep.compile(spec).response([0.0]).iloc[0]
    assert row.doubt == ""
    assert row.impedance_re == pytest.approx(wanted, rel=1e-12)
    assert row.admittance_re == pytest.approx(1 / wanted, rel=1e-12)
    assert wavesweep.verdict(spec)["felt"]["stiffness"] == pytest.approx(wanted, rel=1e-9)
    (end,) = wavesweep.compile(spec).stable_intervals("K_VE", (0.9 * K_VE, K_VE)).itertuples()
    assert end.felt_high == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize(
    ("spec", "wanted"),
    [
        (  # a hand's spring beside which the wall's share is lost in rounding, and one beside which it has a few digits
            {"controller": {"kind": "dc-lm"}, "operator": {"stiffness": 1.0}, "environment": {"K_VE": 1e-9}},
            1e-9,
        ),
        (
            {
                "controller": {"kind": "dc-slow"}, "rates": {"ratio": 1}, "device": {"mass": 1.3, "damping": 0.001},
                "operator": {"damping": 2.0, "stiffness": 1e5},
                "environment": {"integration": "explicit", "K_VE": 0.05, "B_VE": 2000.0},
            },
            0.05,
        ),
        pytest.param(
            {
                "controller": {"kind": "pmw", "Kp": 1e-6}, "rates": {"ratio": 2},
                "operator": {"damping": 2.0, "stiffness": 1e6},
                "device": {"damping": 1e5, "velocity": "difference"}, "filters": {"lp1": {"order": 2, "cutoff_hz": 490.0}},
                "environment": {"integration": "trapezoidal", "delay": 2, "K_VE": 1e-15, "B_VE": 0.0},
            },
            1e-15,
            marks=pytest.mark.xfail(strict=True, reason="a share of 1e-15 N/m beside springs of 1e6 N/m passes for none"),
        ),
        (
            {
                "controller": {"kind": "pmw", "Kp": 20.0}, "rates": {"slow_hz": 60.0}, "operator": {"stiffness": 1.0},
                "environment": {"K_VE": 1e-10},
            },
            1e-10,
        ),
    ],
)  # fmt: skip
def test_a_small_share_of_the_force_is_bounded_or_missing(spec, wanted):
    row = wavesweep.compile(spec).response([0.0]).iloc[0]
    missing = np.isnan(row.impedance_re) and np.isnan(row.impedance_error)
    assert missing or abs(row.impedance_re / wanted - 1) <= row.impedance_error
    assert row.doubt == "rounding" or row.impedance_error < 1e-6


def test_a_force_that_vanishes_up_to_rounding_is_zero_and_a_small_one_is_not():
    """A wall of 1e-9 N/m on a device that a spring of 1 N/m holds, and no wall at all."""
    spec = {"controller": {"kind": "dc"}, "operator": {"stiffness": 1.0, "damping": 5.0}}
    some, none = (
        wavesweep.compile(spec | {"environment": {"K_VE": K, "B_VE": 0.1}}).response([0.0]).iloc[0] for K in (1e-9, 0.0)
    )
    assert some.impedance_re == pytest.approx(1e-9, rel=max(some.impedance_error, 1e-12))
    assert (none.impedance_re, none.doubt) == (0.0, "")
