"""Questions that the stress put to the library's face: no crash, no warning, no missing number."""

import numpy as np
import pytest
from stress.specs import FAMILIES
from support.specs import nested

import wavesweep

pytestmark = pytest.mark.slow


def loop(family, seed):
    """The compiled loop of that number."""
    return wavesweep.compile(nested(FAMILIES[family](np.random.default_rng(seed))))


def test_long_frames_of_direct_coupling_have_a_worst_case_at_every_frequency():
    """81 ticks, beyond the size of the dense way, at several frequencies in one call."""
    found = loop("wild", 0).response([1e-2, 1.0, 100.0])
    assert np.isfinite(found["worst_gain"]).all()


def test_the_radius_of_an_unstable_tick_overflows_to_infinity():
    """The ideal coupling's tick grows a thousandfold, and counts 157 times."""
    radius = loop("wild", 84).spectral_radius(K_VE=[0.0, 1.0, 1e9])
    assert radius[-1] == np.inf
    assert np.isfinite(radius[0])


@pytest.mark.parametrize("family", ["wild", "any_number"])
def test_questions_are_answered_whatever_the_numbers(family):
    for seed in range(100, 104):
        asked = loop(family, seed)
        assert np.isfinite(asked.stable_intervals(B_VE=[0.0, 1e4])["residual"]).all()
        assert not np.isnan(asked.spectral_radius(K_VE=[0.0, 1e9])).any()
        response = asked.response(np.array([1e-5, 1e-2]) * asked.spec.tick_hz)
        assert np.isfinite(response.loc[response["stable"] == 1, "admittance_re"]).all()
