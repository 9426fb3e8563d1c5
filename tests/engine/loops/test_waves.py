"""The ends of the wave line carry the model's equations and the waves' power."""

import numpy as np
import pytest
from support.specs import INTEGRATIONS, random_values

from wavesweep.engine._loops.blocks import defined
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine.loop import Loops
from wavesweep.haptics.controller_page import loop_drawing


def random_row(seed, n):
    return np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["pmw", "pmw-lm"])
def test_the_encoder_conserves_power(seed, kind):
    """`f_m v_hat = u_m^2/2 - v_m^2/2`, whatever the state and the held signals are."""
    values = random_values(seed, kind)
    drawn = Loops(loop_drawing(values), values).read.drawn()
    ticks = Ticks.of(drawn, ("encoder.force", "encoder.v", "encoder.out", "encoder.in"))
    fast = ticks.maps[ticks.kind[0]]
    x, w = random_row(seed, len(fast.states)), random_row(seed + 99, len(fast.inputs))
    f_m, v_hat, u, v = fast.C @ x + fast.D @ w
    assert f_m * v_hat == pytest.approx(u * u / 2 - v * v / 2, abs=1e-12 * (u * u + v * v))


@pytest.mark.parametrize("integration", INTEGRATIONS)
def test_the_avatar_conserves_power_and_integrates_as_the_model_says(integration):
    """`F_s x_dot = u_s^2/2 - v_s^2/2`; the recursion of the table, marched beside the block."""
    b, T_s = 7.0, 0.02
    block = defined("avatar", "avatar", T_s, b=b, integration=integration)
    state, x_before, speed_before = np.zeros(1), 0.0, 0.0
    for u, F in zip(random_row(1, 30), random_row(2, 30), strict=True):
        x_dot, x, x_tilde, v = block.C @ state + block.D @ [u, F]
        state = state + block.E @ state + block.B @ [u, F]
        assert F * x_dot == pytest.approx(u * u / 2 - v * v / 2, abs=1e-14)
        assert x_dot == pytest.approx((np.sqrt(2 * b) * u - F) / b, abs=1e-14)
        mean = (x_dot + speed_before) / 2 if integration == "trapezoidal" else x_dot
        assert x == pytest.approx(x_before + T_s * mean, abs=1e-14)
        assert x_tilde == pytest.approx(x_before if integration == "explicit" else x, abs=1e-14)
        x_before, speed_before = x, x_dot


@pytest.mark.parametrize("integration", INTEGRATIONS)
@pytest.mark.parametrize(("K", "B"), [(500.0, 0.0), (500.0, 3.0), (0.0, 3.0), (0.0, 0.0)])
def test_the_local_model_solves_its_own_step(integration, K, B):
    """The recursion of the model, `F_l = K_LM x~ + B_LM x_dot`, solved for x_dot in each tick."""
    b, T = 7.0, 1e-3
    block = defined("local_model", "local", T, b=b, K=K, B=B, integration=integration)
    share = {"explicit": 0.0, "implicit": T, "trapezoidal": T / 2}[integration]
    state, x, before = np.zeros(1), 0.0, 0.0
    for u in random_row(3, 60):
        v = (block.C @ state + block.D @ [u])[0]
        state = state + block.E @ state + block.B @ [u]
        rest = x + (T / 2 * before if integration == "trapezoidal" else 0.0)
        x_dot = (np.sqrt(2 * b) * u - K * rest) / (b + B + K * share)
        force = K * (rest + share * x_dot) + B * x_dot
        assert v == pytest.approx(u - np.sqrt(2 / b) * force, abs=1e-12)
        assert force * x_dot == pytest.approx(u * u / 2 - v * v / 2, abs=1e-12)
        x, before = x + T * ((x_dot + before) / 2 if integration == "trapezoidal" else x_dot), x_dot
