"""The bounds on gains as values, and the words of requirements. Specs have it, so that it does
not load numpy."""

from __future__ import annotations

from typing import NamedTuple

LIFTED, BASE_BAND = "lifted", "base-band"
OVERSHOOT, STEP_SETTLING, PEAK, RMS = "overshoot", "step_settling", "peak_to_peak", "rms"
FACTOR_GAIN, FACTOR_PHASE = "gain", "phase_deg"
IN_TIME = (OVERSHOOT, STEP_SETTLING, PEAK, RMS)


class GainBound(NamedTuple):
    """What a gain has to be below: the names of an input and an output, the level, a band, and
    what the gain is."""

    source: str
    signal: str
    at_most: float
    band_hz: tuple[float, float] | None = None
    measure: str = LIFTED


class CutBound(NamedTuple):
    """What the distance of 1/(1 + L) to a number has to be below, of the loop L that is cut at a
    signal.

    centre: 0 for the peak sensitivity Ms; 1/2 for the disk margin, which is 1 over the largest
    distance.
    """

    cut: str
    at_most: float
    centre: float

    band_hz = None  # it is of all frequencies


class FactorBound(NamedTuple):
    """With which factors of the signal at a cut a loop has to be stable.

    margin: FACTOR_GAIN, from 1/size to size; or FACTOR_PHASE, a phase of up to `size` deg either way.
    """

    cut: str
    margin: str
    size: float

    band_hz = None  # it is of all frequencies


class TimeBound(NamedTuple):
    """What a value of the response in time from an input to an output may be at most.

    measure: which value, one of IN_TIME.
    """

    measure: str
    source: str
    signal: str
    at_most: float

    band_hz = None  # it is of all frequencies
