"""The static limit and the stiffness felt, against 50 digits, laws of the model, and each other."""

import numpy as np
import pytest
from support import exact
from support.specs import KINDS, nested, random_values, values_of

import wavesweep
from wavesweep.analysis.response import felt, felt_map, prepare, static_response
from wavesweep.diagram import draw


def static(values):
    """Static admittance and impedance of the loop."""
    return static_response(prepare(draw(values), values["environment.K_VE"], values["environment.B_VE"]))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("changes", [{}, {"Kp": 20.0}, {"stiffness": 120.0}, {"Kp": 20.0, "stiffness": 120.0, "delay": 7}])
def test_the_limit_is_that_of_50_digits(kind, changes):
    """At a nanohertz the real parts are the limit's to 18 digits."""
    values = values_of(kind, **changes)
    wanted = [float(part.real) for part in exact.response(values, 1e-9, exact.frame(values))]
    assert static(values) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pmw", "pmw-lm"])
@pytest.mark.parametrize("seed", range(10))
def test_random_loops_hold_at_50_digits(kind, seed):
    values = random_values(seed, kind)
    with np.errstate(all="raise"):
        admittance, impedance = static(values)
    wanted = [part.real for part in exact.response(values, 1e-9, exact.frame(values))]
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


def test_a_device_that_nothing_holds_has_no_admittance_and_feels_nothing():
    for values in (values_of("dc-slow", K_VE=0.0), values_of("pmw-lm", hp_order=0)):
        admittance, impedance = static(values)
        assert np.isnan(admittance)
        assert impedance == 0


@pytest.mark.parametrize("seed", range(12))
def test_what_is_felt_is_a_moebius_map_of_the_wall(seed):
    """Found at rest without any wall; walls agree with the limits of their own responses, whatever their damping."""
    values = random_values(seed)
    coefficients = felt_map(draw(values))
    for K, B in ((3.0, 0.0), (321.0, 4.0), (20000.0, 1.0)):
        changed = values | {"environment.K_VE": K, "environment.B_VE": B}
        assert felt(coefficients, K) == pytest.approx(static(changed)[1], rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("changes", [{}, {"Kp": 20.0}, {"stiffness": 120.0}, {"hp_order": 0}, {"delay": 7, "stiffness": 120.0}])
def test_the_map_is_that_of_limits(kind, changes):
    """With and without a spring in the hand, position feedback, a wall that is reached, and a drift that is read."""
    values = values_of(kind, **changes)
    for K in (0.5, 50.0, 5000.0):
        limit = static(values | {"environment.K_VE": K, "environment.B_VE": 2.0})[1]
        assert felt(felt_map(draw(values)), K) == pytest.approx(limit, rel=1e-9)


def test_a_batch_of_loops_has_a_map_each():
    b = np.array([5.0, 20.0, 80.0])
    together = felt_map(draw(values_of("pmw", b=b)), b.shape)
    alone = [felt_map(draw(values_of("pmw", b=float(each)))) for each in b]
    assert together == pytest.approx(np.transpose(alone), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("batch", [(1,), (4,)])
def test_loops_that_differ_in_nothing_have_the_same_map(batch):
    diagram = draw(values_of("pmw", Kp=20.0))
    assert np.array_equal(felt_map(diagram, batch), np.repeat(felt_map(diagram)[:, None], batch[0], axis=1))


@pytest.mark.parametrize("kind", KINDS)
def test_a_response_at_0_hz_is_the_limit_with_an_error(kind):
    values = values_of(kind, Kp=20.0)
    rows = wavesweep.compile(nested(values)).response([1.0, 0.0])
    assert rows["impedance_re"][1] == static(values)[1]
    assert rows["impedance_error"][1] < 1e-6
    assert rows["worst_gain"][1] > rows["admittance_abs"][1] * (1 - 1e-9)
    alone = wavesweep.compile(nested(values)).response([0.0])
    assert alone["impedance_re"][0] == rows["impedance_re"][1]
