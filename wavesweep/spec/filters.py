"""A Butterworth filter from its band edges: the lowest order that meets them, and its -3 dB frequency."""

from __future__ import annotations

import math


def butterworth_order(
    passband_hz: float, stopband_hz: float, passband_db: float, stopband_db: float, fast_hz: float
) -> tuple[float, float]:
    """Return order and cutoff (Hz) of the least digital Butterworth filter that meets the edges.

    This is `scipy.signal.buttord`. With the edges prewarped, `W = tan(pi*f/fast_hz)`, and `G = 10^(dB/10)`, the order
    is the least whole number not below `log((G_stop - 1)/(G_pass - 1)) / (2 log r)`, where `r > 1` is the ratio of the
    edges; the cutoff then gives exactly `passband_db` at the edge of the passband. Low-pass where the passband lies
    below the stopband, high-pass otherwise. The order is infinite, and the cutoff the edge of the passband, where
    doubles cannot tell the edges apart, or an edge or `passband_db` from zero.

    Accuracy: the order is SciPy's; the cutoff agrees to a few units in the last place.
    """
    passband = math.tan(math.pi * (2 * passband_hz / fast_hz) / 2)
    stopband = math.tan(math.pi * (2 * stopband_hz / fast_hz) / 2)
    lowpass = passband_hz < stopband_hz
    if 0.0 in (passband, stopband):
        return math.inf, passband_hz
    ratio = stopband / passband if lowpass else passband / stopband
    loss = 10 ** (0.1 * passband_db) - 1.0
    attenuation = 10 ** (0.1 * stopband_db) - 1.0
    if loss == 0.0 or math.log10(ratio) == 0.0:
        return math.inf, passband_hz
    order = max(1, math.ceil(math.log10(attenuation / loss) / (2 * math.log10(ratio))))
    prototype = loss ** (-1.0 / (2.0 * order))
    natural = prototype * passband if lowpass else passband / prototype
    return order, math.atan(natural) * 2.0 / math.pi * fast_hz / 2
