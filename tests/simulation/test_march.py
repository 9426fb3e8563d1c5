import math

import numpy as np
import pytest
from support.controllers import compile_loop
from support.march import at_rest, march, numbers_of, random_state, with_numbers

from wavesweep.errors import IllPosedLoopError


def steady_response(values, frequency, settle=6000, measured=4000):
    """Admittance and impedance at one frequency: march, settle, fit the input's frequency and its images."""
    T, ratio = 1.0 / values["rates.fast_hz"], values["rates.ratio"]
    k = np.arange(settle + measured)
    seen = march(values, np.cos(2 * np.pi * frequency * T * k))
    images = 2 * np.pi * (frequency * T + np.arange(ratio) / ratio)
    turns = np.exp(1j * np.outer(k[settle:], images))
    basis = np.hstack([turns.real, -turns.imag, np.ones((measured, 1))])  # the constant is drift

    def component(signal):
        fit = np.linalg.lstsq(basis, signal[settle:], rcond=None)[0]
        return complex(fit[0], fit[ratio])

    x, f_m = component(seen.x), component(seen.f_m)
    return x, f_m / x


# Admittance and impedance of these loops as 40-digit arithmetic on the model's equations gives them, rounded to double.
RESPONSES = {
    "dc": ({}, 11.25, -0.00012574349205258397 - 0.0062851766199421765j, 500.0062507902473 + 70.71528060540187j),
    "dc-slow at one rate": (
        {"ratio": 1, "velocity": "difference"},
        11.25, -2.7343653928230486e-05 - 0.006291066117595517j, 502.4972035837299 + 70.62698593116676j,
    ),
    "dc-lm": (
        {"K_LM": 400.0},
        11.25, 0.0014988013091539907 - 0.011655845169953733j, 514.040690419043 - 3.9272318281568235j,
    ),
    "pmw": ({}, 11.25, -0.0004684625286367296 - 0.0003843810618300799j, -772.5606922480725 + 958.4468657786894j),
    "pmw explicit, a tick late": (
        {"b": 10.0, "environment.integration": "explicit", "environment.delay": 1, "velocity": "difference"},
        11.25, -0.0017207271533584809 - 0.00021437105951514082j, -69.07964681879419 - 17.031513091062074j,
    ),
    "pmw-lm": (
        {"Kp": 20.0},
        11.25, -0.0014802912366873651 - 0.0006476792414664813j, -63.810265190939276 + 159.75604530111897j,
    ),
    "pmw-lm without any delay": (
        {
            "device.mass": 0.0637, "device.damping": 0.1249, "velocity": "difference", "K_VE": 115.513, "B_VE": 3.429,
            "environment.integration": "trapezoidal", "environment.delay": 10, "b": 35.95, "lp1.cutoff_hz": 17.268,
            "hp.order": 3, "hp.cutoff_hz": 10.594, "lp2.order": 3, "lp2.cutoff_hz": 9.104,
            "K_LM": 214.932, "B_LM": 2.089, "local_model.delay": 0,
        },
        11.619, -0.0003304078282543936 - 5.6175429059322105e-05j, -2601.854233063815 + 503.39325609395434j,
    ),
    "pmw-lm with a hand": (
        {
            "rates.fast_hz": 2000.0, "ratio": 5, "device.mass": 0.1156, "device.damping": 0.1516,
            "K_VE": 242.846, "B_VE": 7.514, "environment.integration": "trapezoidal",
            "environment.delay": 2, "b": 57.311, "Kp": 50.477,
            "operator.mass": 0.136, "operator.damping": 1.838, "operator.stiffness": 96.15, "lp1.cutoff_hz": 35.292,
            "hp.cutoff_hz": 142.541, "lp2.order": 1, "lp2.cutoff_hz": 282.257, "K_LM": 52.387, "B_LM": 0.914,
        },
        16.432, -0.0002294815772195922 - 9.350248074650918e-05j, -1146.679295195175 + 1384.101671905243j,
    ),
}  # fmt: skip


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("name", RESPONSES)
def test_a_sine_settles_to_the_exact_response(values, name):
    changes, frequency, admittance, impedance = RESPONSES[name]
    found = steady_response(values(name.split()[0].rstrip(","), **changes), frequency)
    assert found[0] == pytest.approx(admittance, rel=1e-7)
    assert found[1] == pytest.approx(impedance, rel=1e-7)


@pytest.mark.slow
def test_kp_transmits_the_walls_stiffness_at_rest(values):
    """With Kp the admittance of a constant force is 1/K_VE to the digit."""
    seen = march(values("pmw-lm", Kp=20.0), 1.0, ticks=20_000)
    assert seen.x[-1] == pytest.approx(1 / 500.0, rel=1e-9)
    assert seen.x_s[-1] == pytest.approx(seen.x[-1], rel=1e-9)


@pytest.mark.slow
def test_without_kp_the_filter_is_a_spring_in_series(values):
    """``1/K_VE + τ/(2b)``, τ the group delay of LP1 and of the hold; with order 6 almost nothing aliases."""
    seen = march(values("pmw", **{"lp1.order": 6, "environment.delay": 7}), 1.0, ticks=30_000)
    edge = math.tan(math.pi * 10.0 / 1000.0)
    poles = [edge * np.exp(1j * math.pi * (2 * k + 7) / 12) for k in range(6)]
    group = sum((1 / (1 - p) - 1).real for s in poles for p in [(1 + s) / (1 - s)])  # ticks, of the poles
    group += 6 / 2  # and of the zeros at -1
    tau = (group + 19 / 2 + 7) / 1000.0
    assert seen.x[-1] == pytest.approx(1 / 500.0 + tau / 50.0, rel=1e-6)


def test_waves_carry_the_power_at_every_port(values):
    """``u² - v² = 2·F·ẋ`` on the user's side and at the avatar."""
    seen = march(values("pmw-lm", Kp=20.0), np.random.default_rng(3).standard_normal(500))
    np.testing.assert_allclose(seen.u_m**2 - seen.v_m**2, 2 * seen.f_m * seen.v_hat, atol=1e-13)
    np.testing.assert_allclose(seen.u_s**2 - seen.v_s**2, 2 * seen.F_s * seen.x_dot_s, atol=1e-13)


@pytest.mark.parametrize("kind", ["dc", "dc-slow", "dc-lm", "pmw", "pmw-lm"])
@pytest.mark.parametrize("delay", [0, 1, 7, 20])
def test_a_march_goes_on_where_it_stopped(values, kind, delay):
    """Two marches in a row, the cut in the middle of a frame, are the one march to the bit."""
    loop = values(kind, **{"environment.delay": delay, "velocity": "difference"})
    force = np.random.default_rng(4).standard_normal(100)
    whole, first = march(loop, force), march(loop, force, ticks=33)
    second = march(loop, force[33:], state=first.state)
    assert np.array_equal(whole.x, np.concatenate([first.x, second.x]))
    assert np.array_equal(whole.f_m, np.concatenate([first.f_m, second.f_m]))
    assert second.state == whole.state


@pytest.mark.parametrize("delay", [0, 1, 19, 20])
def test_the_slow_force_is_held_from_its_delay_on(values, delay):
    """From rest at 1 mm the first force of `dc-slow` shows at tick `delay`, and lasts a frame."""
    loop = values("dc-slow", **{"environment.delay": delay})
    seen = march(loop, 0.0, ticks=60, state=at_rest(compile_loop(loop), x=1e-3))
    assert np.all(seen.f_m[:delay] == 0.0)
    assert np.all(seen.f_m[delay : delay + 20] == 0.5)
    assert seen.f_m[delay + 20] == seen.F_s[1]


def test_what_a_kind_does_not_have_is_none(values):
    """A direct coupling has no waves, `pmw` no local model, `dc` no slow loop."""
    assert march(values("dc"), 1.0, ticks=40).F_s.shape == (40,)
    slow, waves = march(values("dc-slow"), 1.0, ticks=40), march(values("pmw"), 1.0, ticks=40)
    assert slow.u_m is None
    assert slow.x_s is None
    assert slow.F_s.shape == (2,)
    assert waves.u_h is None
    assert waves.v_2 is None
    assert waves.u_s.shape == (2,)
    assert march(values("pmw-lm"), 1.0, ticks=40).v_2.shape == (40,)


def test_too_few_forces_are_refused(values):
    with pytest.raises(ValueError, match="expected at least 5 forces, one per tick, but found 3"):
        march(values("dc"), np.zeros(3), ticks=5)


def test_a_loop_that_has_no_solution_is_refused(values):
    """No filters, no delay, a local model that answers with the negative of the wave: u_m = -v_m says nothing."""
    bare = {"hp.order": 0, "lp1.order": 0, "lp2.order": 0, "local_model.delay": 0}
    loop = values("pmw-lm", K_VE=0.0, B_VE=0.0, K_LM=0.0, B_LM=0.0, **bare)
    assert np.isfinite(march(loop, 1.0, ticks=20).x).all()
    rigid = {**loop, "local_model.integration": "explicit", "local_model.B_LM": 1e300, "environment.delay": 5}
    with pytest.raises(IllPosedLoopError, match="give the environment or the local model a delay"):
        march(rigid, 1.0, ticks=20)


@pytest.mark.parametrize("kind", ["dc-lm", "pmw-lm"])
def test_free_motions_add_up(values, kind):
    """From any start the motion is linear: the sum of two states moves as the sum of their motions."""
    loop = values(kind, **{"environment.delay": 3})
    compiled = compile_loop(loop)
    first, second = random_state(compiled, 0), random_state(compiled, 1)
    both = with_numbers(first, numbers_of(first) + numbers_of(second))
    one, other, joint = (march(loop, 0.0, ticks=60, state=state) for state in (first, second, both))
    np.testing.assert_allclose(joint.x, one.x + other.x, atol=1e-13)
    np.testing.assert_allclose(numbers_of(joint.state), numbers_of(one.state) + numbers_of(other.state), atol=1e-11)
