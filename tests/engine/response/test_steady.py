"""Admittance and impedance, against 50 digits, laws of the model, and the marched loop."""

import numpy as np
import pytest
from support import exact
from support.responses import loop_of
from support.specs import KINDS, random_values, values_of

from wavesweep.engine._response.steady import respond


def response(values, frequency_hz):
    found = respond(loop_of(values), frequency_hz)
    return found.admittance, found.impedance


def slow_multiples(values):
    """1, 3 and M/2 times the slow rate, as far as they are below half the fast one."""
    ratio, fast = values["rates.ratio"], values["rates.fast_hz"]
    return [m * fast / ratio for m in sorted({1, 3, ratio // 2}) if 0 < m <= ratio / 2]


def worst_error(values, frequency_hz, witness):
    """Largest relative error of both answers; of an impedance that vanishes, relative to a thousandth of the wall."""
    floor = 1e-3 * values["environment.K_VE"]
    worst = 0.0
    for f, admittance, impedance in zip(frequency_hz, *response(values, frequency_hz), strict=True):
        wanted = witness(values, f)
        error = abs(admittance - wanted[0]) / abs(wanted[0])
        worst = max(worst, float(error), float(abs(impedance - wanted[1]) / max(abs(wanted[1]), floor)))
    return worst


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_random_frequencies_hold_at_50_digits(kind, seed):
    """From 0.1 Hz to a hundred-thousandth below the fast Nyquist frequency, where a digit more is lost."""
    values = random_values(seed, kind)
    T = 1 / values["rates.fast_hz"]
    inner = np.random.default_rng(seed).uniform(0.001, 0.49, 2) / T
    assert worst_error(values, [0.1, *inner, 0.49999 / T], exact.response) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "kind"), [(0, "dc-slow"), (12, "pmw-lm")])
def test_multiples_of_the_slow_rate_hold_at_50_digits(kind, seed):
    """The formula is 0/0 there with a drift: its limit, the mean of both sides a hundred-billionth away."""
    values = random_values(seed, kind)
    assert worst_error(values, slow_multiples(values), exact.limit) < 1e-9


# A spring in the hand and no position feedback: what stays for ever is a combination of states.
CONSERVED = [("pmw", {}), ("pmw-lm", {"ratio": 3, "hp_order": 4})]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "changes"), CONSERVED)
def test_a_conserved_combination_leaves_the_answer_whole(kind, changes):
    """At 1 mHz, between, and at multiples of the slow rate."""
    values = values_of(kind, stiffness=120.0, **changes)
    multiples = slow_multiples(values)
    assert worst_error(values, [1e-3, 0.7, 33.3, 333.0], exact.response) < 1e-10
    assert worst_error(values, multiples, exact.limit) < 1e-10


@pytest.mark.parametrize("kind", KINDS)
def test_a_batch_of_loops_answers_as_its_members(kind):
    b, K = np.array([20.0, 40.0]), np.array([100.0, 500.0])
    values, frequency = values_of(kind, b=b), np.array([0.5, 7.0, 120.0])
    together = np.array(response(values | {"environment.K_VE": K}, frequency))
    for i in range(2):
        alone = np.array(response(values_of(kind, b=b[i], K_VE=K[i]), frequency))
        np.testing.assert_allclose(together[:, i], alone, rtol=1e-9)
