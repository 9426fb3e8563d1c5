"""What goes into the wave channel and does not come out is stored or dissipated in parts that can be named."""

import math

import numpy as np
import pytest

from wavesweep.simulation.hardware import Effects
from wavesweep.simulation.march import simulate

T = 1e-3


def first_order(u, cutoff_hz):
    """Low-pass and its power complement ``h``, and the energy (J) stored after each sample, by the trapezoidal rule.

    A lossless three-port: with the integrator ``x' = x + 2c·h`` behind ``y = x + c·h``, ``h = u - y``, the power that
    is neither in ``y`` nor in ``h`` is ``u² - y² - h² = 2yh = (x'² - x²)/2c`` exactly.
    """
    c, x = math.tan(math.pi * cutoff_hz * T), 0.0
    low, high, stored = (np.empty(len(u)) for _ in range(3))
    for k, sample in enumerate(u.tolist()):
        high[k] = (sample - x) / (1 + c)
        low[k] = x + c * high[k]
        x += 2 * c * high[k]
        stored[k] = T * x * x / (4 * c)
    return low, high, stored


def total(wave):
    """Energy (J) that a wave of the fast rate has carried after each tick."""
    return T * np.cumsum(wave**2) / 2


@pytest.fixture
def push():
    """A hand that trembles against the wall and pulls away from it: 75 frames."""
    k = np.arange(1500)
    return np.sin(k / 90.0) + 0.3 * np.random.default_rng(8).standard_normal(1500)


EXPERIMENTS = [
    Effects(),
    Effects(wall=0.001, resolution=5e-5, max_force=1.5, friction=0.05, jitter=0.2, seed=3),
]


@pytest.mark.parametrize("kind", ["pmw", "pmw-lm"])
@pytest.mark.parametrize("options", EXPERIMENTS, ids=["linear", "hardware"])
def test_storage_and_dissipation_make_up_what_is_kept(values, push, kind, options):
    """Storage in filters and delay, dissipation in filters, and what sampling and adding up the waves leave out."""
    loop = values(kind, K_VE=150.0, Kp=10.0, **{"lp2.order": 1})
    simulation = simulate(loop, push, options)
    seen, energy = simulation.signals, simulation.energy
    low, high, stored = first_order(seen["u_m"], 10.0)
    held = np.repeat(low[::20], 20)
    np.testing.assert_allclose(held, seen["u_s"], atol=1e-13)
    kept = stored + total(high) + total(low) - total(held)  # LP1 and the sampler
    parts = seen["v_s"] ** 2
    if kind == "pmw-lm":
        np.testing.assert_allclose(seen["u_h"], high, atol=1e-13)  # what LP1 dissipates is what HP hands on
        kept -= total(high)
        low, high, stored = first_order(seen["v_l"], 20.0)
        np.testing.assert_allclose(seen["v_2"][1:], low[:-1], atol=1e-13)
        kept += stored + total(high) + T * low**2 / 2  # LP2 and the tick of delay behind it
        parts = parts + seen["v_2"] ** 2
    kept -= T * np.cumsum(seen["v_m"] ** 2 - parts) / 2  # the sum of the waves and Kp
    ends = slice(19, None, 20)  # a slow wave is booked at its event for the whole frame
    scale = total(seen["u_m"])[-1]
    np.testing.assert_allclose(energy.channel[ends], kept[ends], atol=1e-13 * scale)
    assert np.abs(kept[ends]).max() > 1e-3 * scale
