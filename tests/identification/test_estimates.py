"""Estimates of numbers from a residual, against the intervals of linear regression."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import linprog, minimize
from scipy.signal import lfilter
from scipy.stats import norm, t

from wavesweep.identification.estimates import SMOOTH, _autoregression, _readings, estimated
from wavesweep.identification.table import beyond_half_step


@pytest.mark.parametrize("steps", [0.6, 1.0, 3.0])
def test_white_noise_above_the_encoder_s_step_has_the_intervals_of_linear_regression(steps):
    """Rounding is then more white noise. The squared residuals are another estimate of the variance: by 1/sqrt(200) of it, and
    so half as much of the width, it may be off, and the larger is taken."""
    resolution, rows = 1e-6, 400
    slopes = np.stack([np.ones(rows), np.linspace(-1, 1, rows)], axis=1)
    noise = resolution * steps * np.random.default_rng(3).standard_normal(rows)
    positions = resolution * np.round((slopes @ [3.3e-6, 5e-5] + noise) / resolution)
    found = estimated(slopes, positions, resolution)
    numbers, square, *_ = np.linalg.lstsq(slopes, positions)
    variance = square[0] / (rows - 2)
    deviations = np.sqrt(variance * np.diag(np.linalg.inv(slopes.T @ slopes)))
    assert found.step == pytest.approx(numbers, rel=1e-9)
    wider = found.half / (t.ppf(0.975, rows - 2) * deviations)
    assert (wider > 1).all()
    assert (wider < 1 + 3 / np.sqrt(200) / 2).all()
    assert found.noise**2 == pytest.approx(variance - resolution**2 / 12, rel=1e-9)


@pytest.mark.parametrize("beyond", [0, 3])
def test_readings_further_than_half_a_step_from_the_model_are_counted(beyond):
    residual = np.full(100, np.nan)
    residual[10:] = 0.4e-5
    residual[20 : 20 + beyond] = -0.7e-5
    rows = SimpleNamespace(skip=10, used=slice(None), resolution=1e-5)
    assert beyond_half_step(SimpleNamespace(residual=residual, rows=rows)) == beyond


def test_readings_of_an_encoder_alone_bound_numbers_as_all_their_constraints_do():
    rows, resolution = 300, 1e-6
    slopes = np.stack([np.ones(rows), np.linspace(-1, 1, rows)], axis=1)
    positions = resolution * np.round(slopes @ [0.37, 5.3])
    found = estimated(slopes, positions, resolution)
    upper = np.concatenate([slopes, -slopes])
    bounds = np.concatenate([positions, -positions]) / resolution + 0.501  # within a thousandth of a step more
    for number, direction in enumerate(np.eye(2)):
        ends = [way * linprog(way * direction, upper, bounds, bounds=(None, None)).fun * resolution for way in (1, -1)]
        middle, half = (ends[0] + ends[1]) / 2, (ends[1] - ends[0]) / 2
        assert (found.step[number], found.half[number]) == (pytest.approx(middle, rel=1e-4), pytest.approx(half, rel=1e-3))
    assert (found.noise, found.rounded) == (0, True)


@pytest.mark.parametrize("noise", [0.05, 0.3, 20.0])
def test_a_reading_is_as_likely_as_what_is_rounded_to_it(noise):
    residual = np.array([-1.2, -0.4, 0.1, 0.6, 0.9]) * max(noise, 0.6)
    value, score, weight = _readings(residual, 1.0, noise)
    exact = np.log(norm.cdf((residual + 0.5) / noise) - norm.cdf((residual - 0.5) / noise))
    if noise > SMOOTH:  # where rounding is more white noise, but for a constant
        exact, value = exact - exact[2], value - value[2]
    np.testing.assert_allclose(value, exact, rtol=1e-2 if noise > SMOOTH else 1e-9, atol=1e-4)
    near = [_readings(residual + way * 1e-4 * noise, 1.0, noise) for way in (-1, 1)]
    np.testing.assert_allclose((near[0][0] - near[1][0]) / (2e-4 * noise), score, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose((near[1][1] - near[0][1]) / (2e-4 * noise), weight, rtol=1e-4, atol=1e-9)


def test_what_is_found_within_few_steps_is_the_likeliest():
    random = np.random.default_rng(8)
    slopes = np.stack([np.ones(200), np.linspace(-1, 1, 200)], axis=1)
    positions = np.round(slopes @ [0.2, 1.4] + 0.35 * random.standard_normal(200))
    found = estimated(slopes, positions, 1.0)

    def unlikely(numbers):
        return -_readings(positions - slopes @ numbers[:2], 1.0, np.exp(numbers[2]))[0].sum()

    best = minimize(unlikely, [*found.step, np.log(found.noise)], method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-9})
    assert found.step == pytest.approx(best.x[:2], abs=0.03 * found.half.min())
    assert found.noise == pytest.approx(np.exp(best.x[2]), rel=0.06)


def test_past_values_of_a_series_are_those_that_it_was_made_of():
    made = lfilter([0.3], [1, -1.2, 0.5], np.random.default_rng(1).standard_normal((3, 4000)))
    past, power = _autoregression(made)
    np.testing.assert_allclose(past[:, :3], [[1, -1.2, 0.5]] * 3, atol=0.05)
    np.testing.assert_allclose(power, 0.09, rtol=0.08)
    white, _ = _autoregression(np.random.default_rng(2).standard_normal((1, 2000)))
    assert white.shape == (1, 1)
