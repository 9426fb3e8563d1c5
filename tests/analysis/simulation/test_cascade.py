import cmath
import math

import numpy as np
import pytest

from wavesweep.analysis.simulation.cascade import advance, at_rest, butterworth, output


def response(sections, z):
    """The cascade at z: Re(r·q) makes a section with a complex pole the mean of two conjugate ones."""
    total = 1.0
    for p, g, r, d in sections:
        total *= d + (r * g / (z - p) + r.conjugate() * g / (z - p.conjugate())) / 2
    return total


@pytest.mark.parametrize("passes", ["low", "high"])
@pytest.mark.parametrize(("order", "cutoff_hz"), [(1, 10.0), (2, 20.0), (5, 3.0), (6, 400.0), (10, 1.0), (12, 10.0)])
def test_the_response_is_butterworths_at_the_warped_frequency(passes, order, cutoff_hz):
    """`1/Π(s - p)` at ``s = j·tan(πf/f_s)/tan(πf_c/f_s)``, or at its inverse for a high-pass."""
    sections = butterworth(passes, order, cutoff_hz, 1000.0)
    for frequency in np.array([0.1, 0.5, 1.0, 1.7, 8.0]) * cutoff_hz:
        if frequency >= 500.0:
            continue
        s = 1j * math.tan(math.pi * frequency / 1000.0) / math.tan(math.pi * cutoff_hz / 1000.0)
        s = 1 / s if passes == "high" else s
        analogue = 1.0
        for k in range(order):
            analogue /= s - cmath.exp(1j * math.pi * (2 * k + order + 1) / (2 * order))
        found = response(sections, cmath.exp(2j * math.pi * frequency / 1000.0))
        assert abs(found - analogue) < 1e-12  # of the pass band's 1; a direct form is off by 10 at order 10, 1 Hz


def test_the_marched_cascade_agrees_with_scipys_sections():
    """The same samples through scipy's direct-form sections, at an order that those can do."""
    signal = pytest.importorskip("scipy.signal")
    samples = np.random.default_rng(1).standard_normal(400)
    sections = butterworth("low", 5, 30.0, 1000.0)
    state, found = at_rest(sections), []
    for u in samples.tolist():
        peeked = output(sections, state, u)
        state, y = advance(sections, state, u)
        assert y == peeked
        found.append(y)
    expected = signal.sosfilt(signal.butter(5, 30.0, output="sos", fs=1000.0), samples)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_order_0_is_no_filter():
    assert advance(butterworth("low", 0, 10.0, 1000.0), (), 0.7) == ((), 0.7)
