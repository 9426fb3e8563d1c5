"""Orders and cutoffs from band edges are SciPy's, and meet the edges."""

import math
import random

import pytest
from scipy import signal

from wavesweep.spec.filters import butterworth_order

RANDOM = random.Random(11)  # noqa: S311 - a fixed sample, no secret


def _edges():
    fast_hz = RANDOM.choice([100.0, 1000.0, 8000.0])
    one, other = sorted(RANDOM.uniform(0.001, 0.499) * fast_hz for _ in range(2))
    losses = sorted(10 ** RANDOM.uniform(-3, 2.2) for _ in range(2))
    return (*RANDOM.choice([(one, other), (other, one)]), *losses, fast_hz)


CASES = [_edges() for _ in range(200)] + [(10.0, 40.0, 1.0, 40.0, 1000.0), (10.0, 499.999, 3.0, 3.1, 1000.0)]


@pytest.mark.parametrize("case", CASES)
def test_order_and_cutoff_are_those_of_buttord(case):
    order, cutoff_hz = butterworth_order(*case)
    expected = signal.buttord(*case[:4], fs=case[4])
    assert order == expected[0]
    # One power, one tangent and one arctangent, each rounded; the arctangent damps what the tangent magnifies.
    assert cutoff_hz == pytest.approx(float(expected[1]), rel=1e-13)


@pytest.mark.parametrize("case", [case for case in CASES if butterworth_order(*case)[0] <= 12])
def test_the_filter_meets_its_edges(case):
    passband_hz, stopband_hz, passband_db, stopband_db, fast_hz = case
    order, cutoff_hz = butterworth_order(*case)

    def loss(frequency_hz):
        ratio = math.tan(math.pi * frequency_hz / fast_hz) / math.tan(math.pi * cutoff_hz / fast_hz)
        power = 2 * order if passband_hz < stopband_hz else -2 * order
        return 10 * math.log10(1 + ratio**power)

    assert loss(passband_hz) == pytest.approx(passband_db, rel=1e-9)
    assert loss(stopband_hz) >= stopband_db * (1 - 1e-9)


@pytest.mark.parametrize(
    "case",
    [
        (10.0, math.nextafter(10.0, 11), 1.0, 40.0, 1e3),
        (10.0, 40.0, 1e-17, 40.0, 1e3),
        (5e-324, 10.0, 1.0, 40.0, 1e3),
        (10.0, 5e-324, 1.0, 40.0, 1e3),
    ],
)
def test_edges_that_no_double_can_tell_apart_need_a_very_high_order(case):
    assert butterworth_order(*case)[0] > 12
