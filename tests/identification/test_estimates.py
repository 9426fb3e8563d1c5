"""Estimates of numbers from a residual, against the intervals of linear regression."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t

from wavesweep.identification.estimates import estimated
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
