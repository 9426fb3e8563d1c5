"""Butterworth filters, against scipy's sections and 50 digits."""

import numpy as np
import pytest
import scipy.signal
from support import exact

from wavesweep.engine._loops.filters import butterworth


def response(block, z):
    """`C (z - 1 - E)^-1 B + D` at each z."""
    n = len(block.states)
    state = [np.linalg.solve((point - 1) * np.eye(n) - block.E, block.B + 0j) for point in z]
    return np.array([(block.C @ s + block.D)[0, 0] for s in state])


@pytest.mark.parametrize("order", [0, 1, 2, 5, 12])
@pytest.mark.parametrize("highpass", [False, True])
@pytest.mark.parametrize("cutoff_hz", [20.0, 480.0])
def test_the_response_is_that_of_scipy(order, highpass, cutoff_hz):
    """scipy's own sections keep 10 digits of the passband at order 12 and 2 % of the rate."""
    frequency = np.array([0.3, 0.9, 1.0, 1.2, 3.0]) * cutoff_hz
    frequency = frequency[frequency < 499]
    found = response(butterworth("f", order, cutoff_hz, 1e-3, highpass), np.exp(2j * np.pi * frequency / 1000))
    if order == 0:
        assert np.array_equal(found, np.ones(frequency.size))
        return
    sections = scipy.signal.butter(order, cutoff_hz, "high" if highpass else "low", fs=1000, output="sos")
    wanted = scipy.signal.sosfreqz(sections, frequency, fs=1000)[1]
    assert np.all(np.abs(found - wanted) <= 1e-9 * np.abs(wanted))


@pytest.mark.parametrize(("order", "cutoff_hz", "highpass"), [
    (10, 1.0, False), (12, 1.0, False), (12, 10.0, False), (9, 1.0, True), (12, 1.0, True),
    (12, 499.0, False), (11, 499.0, True),
])  # fmt: skip
def test_the_extremes_keep_13_digits(order, cutoff_hz, highpass):
    """10th order, 1 Hz at 1 kHz, at a tenth of the cutoff: direct-form sections are wrong by a factor of 12 there.

    At 499 Hz the cutoff's distance from half the rate, 1 Hz, is known to 500 ulp only: two digits less.
    """
    good_to = 1e-11 if cutoff_hz > 250 else 1e-13
    block = butterworth("f", order, cutoff_hz, 1e-3, highpass)
    for factor in (0.1, 0.999, 1.001) if cutoff_hz > 250 else (0.1, 1.0, 7.0):
        z = exact.mp.expjpi(2 * exact.mp.mpf(factor) * cutoff_hz / 1000)
        wanted = exact.filter_response(order, cutoff_hz, exact.mp.mpf(1) / 1000, highpass, z)
        w = complex(z - 1)  # what a double keeps of z near 1 is not what it keeps of z - 1
        n = len(block.states)
        found = (block.C @ np.linalg.solve(w * np.eye(n) - block.E, block.B + 0j) + block.D)[0, 0]
        assert abs(found - wanted) <= good_to * max(abs(wanted), 1e-3)


@pytest.mark.parametrize("beside", [1e-2, 1e-5, 1e-8])
def test_a_cutoff_next_to_half_the_rate_says_what_it_has_lost(beside):
    block = butterworth("f", 2, np.array([20.0, 500 - beside]), 1e-3, highpass=True)
    tangent = exact.mp.tan(exact.mp.pi * exact.mp.mpf(500 - beside) / 1000)
    lost = abs(float(exact.mp.mpf(float(np.tan(np.pi * ((500 - beside) * 1e-3)))) / tangent - 1))
    assert block.condition[0] == 1.0
    assert lost <= 4 * np.finfo(float).eps * block.condition[1]
    np.testing.assert_allclose(block.terms[1], block.condition[:, None, None] * np.abs(block.B))
