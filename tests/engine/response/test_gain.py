"""Worst-case gain, against singular values of the lifted system formed tick by tick."""

import numpy as np
import pytest
from support.responses import loop_of
from support.specs import KINDS, nested, random_values, values_of

import wavesweep
from wavesweep.engine._response import gain as gain_module
from wavesweep.engine._response.gain import gain_of


def gain(values, frequency_hz):
    return gain_of(loop_of(values))(frequency_hz)[0]


def dense(values, frequency_hz):
    """LAPACK's largest singular value of python-control's matrix; that of `dc` is of one tick."""
    values = values | ({"rates.ratio": 1, "environment.delay": 0} if values["controller.kind"] == "dc" else {})
    whole = wavesweep.compile(nested(values)).to_control()
    angle = 2 * np.pi * np.asarray(frequency_hz) * values["rates.ratio"] / values["rates.fast_hz"]
    return np.array([np.linalg.svd(whole(np.exp(1j * a), squeeze=False), compute_uv=False)[0] for a in angle])


@pytest.mark.sample(5)
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(8))
def test_random_loops_have_the_dense_gain(kind, seed):
    """Every ratio up to 50, inside and beyond half the slow rate."""
    values = random_values(seed, kind)
    frequency = np.random.default_rng(seed).uniform(0.001, 0.49, 5) * values["rates.fast_hz"]
    np.testing.assert_allclose(gain(values, frequency), dense(values, frequency), rtol=1e-9)


@pytest.mark.sample(3)
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ratio", [32, 33, 100, 200])
def test_long_frames_have_the_dense_gain(kind, ratio):
    """On either side of the size at which the dense way is left for Lanczos' process, and far beyond."""
    values = values_of(kind, ratio=ratio, K_VE=50.0, Kp=20.0, delay=ratio // 3)
    frequency = np.array([0.3, 1.7, 2.49, 8.0, 61.0]) * 20 / ratio
    np.testing.assert_allclose(gain(values, frequency), dense(values, frequency), rtol=1e-9)


def test_the_process_of_long_frames_finds_the_singular_value_of_short_ones(monkeypatch):
    """At several frequencies of two loops at once."""
    values = values_of("pmw", ratio=5, K_VE=np.array([50.0, 80.0]), delay=1)
    frequency = np.array([0.3, 8.0, 61.0])
    right = gain(values, frequency)
    monkeypatch.setattr(gain_module, "DENSE_TICKS", 4)
    np.testing.assert_allclose(gain(values, frequency), right, rtol=1e-9)
    assert right.shape == (2, 3)


@pytest.mark.parametrize("kind", ["pmw", "pmw-lm"])
@pytest.mark.parametrize("stiffness", [0.0, 100.0])
def test_a_loop_that_may_drift_has_no_worst_case_at_multiples_of_the_slow_rate(kind, stiffness):
    found = gain(values_of(kind, stiffness=stiffness), [49.0, 50.0, 100.0, 101.0])
    assert np.isnan(found).tolist() == [False, True, True, False]
