"""How far a loop that is broken at one signal is from instability: gain, phase, delay and disk
margins, peak sensitivities."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wavesweep.engine.doubts import Doubt
from wavesweep.engine.drawing import GAIN, path_of
from wavesweep.engine.loop import Loops
from wavesweep.engine.norms import Peak
from wavesweep.program.analyses.interval_jobs import records_of_loop
from wavesweep.program.columns import SPARED

# times more or less gain, up to which a limit is looked for; also the value of a margin and of a
# peak without a limit, as columns.csv and docs/margins.md say
LARGEST_GAIN_FACTOR = 1e6
SPANS = 16.0, 1e3, LARGEST_GAIN_FACTOR  # of the gain; a short span is known better
BESIDE_ZERO = 1e-7  # rad; stands for the angle 0, at which an integrator has no response


@dataclass(frozen=True, slots=True)
class Margin:
    """One margin.

    value: NaN if it is not known. omega: its frequency, rad/s up to half the rate of the frame; NaN
    without a limit. bound: on the error of the value, relative, to first order. doubt: a number of
    `Doubt`. limited: whether there is a limit; otherwise the value is the end of what was looked
    at.
    """

    name: str
    value: float
    omega: float
    bound: float
    doubt: int = Doubt.NONE
    limited: bool = True

    @staticmethod
    def unlimited(name: str, value: float, doubt: int) -> "Margin":
        """A margin without a limit up to that value, if there is no doubt about it."""
        return Margin(name, np.nan if doubt else value, np.nan, 0.0, doubt, limited=bool(doubt))


def stable_around_1(
    loop: Loops, lowest: float | None = None, *, nearer: bool = False
) -> tuple[np.record | None, int]:
    """Return the stable interval around 1 of the factor of a signal, a record of the search, None
    if none is known, and the doubt about the factors that were looked at.

    loop: with a gain at the signal. lowest: of the factors, 1 over the largest one by default.
    nearer: whether one end is enough if the other is farther from 1.
    """
    for largest in SPANS:
        least = 1 / largest if lowest is None else lowest
        records = records_of_loop(loop, path_of(GAIN), (least, largest))
        doubt = int(records["doubt"][0])
        around_1 = records[(records["low"] < 1) & (records["high"] > 1)]
        if not around_1.size:
            return None, doubt
        ends_below = around_1["low"][0] > least or lowest is not None
        if ends_below and around_1["high"][0] < largest:
            break
        if nearer and max(around_1["low"][0], 1 / around_1["high"][0]) > 1 / largest:
            break
    return around_1[0], doubt


def margin_within(name: str, value: float, omega: float, bound: float, doubt: int) -> Margin:
    """Return the margin with a limit, in doubt beyond a bound of SPARED."""
    if doubt == Doubt.NONE and not bound <= SPARED:
        doubt = Doubt.ROUNDING
    return Margin(name, value, omega, float(bound), doubt)


def peak_margin(name: str, peak: Peak, period: float, bound: float) -> Margin:
    """Return the margin of the peak of a squared response.

    Beyond LARGEST_GAIN_FACTOR it has no limit, as next to a drift that it moves.
    """
    doubt = Doubt.NONE if peak.certified[0] else Doubt.SEARCH
    if peak.value[0] >= LARGEST_GAIN_FACTOR**2:
        return Margin.unlimited(name, LARGEST_GAIN_FACTOR, Doubt.NONE)
    size = float(np.sqrt(peak.value[0])) if np.isfinite(peak.value[0]) else np.nan
    return margin_within(name, size, float(peak.theta[0]) / period, bound, doubt)


def disk_margins(disk: float, omega: float, bound: float, doubt: int) -> Iterator[Margin]:
    """Yield the disk margin with its gain and its phase, `(1 + a/2)/(1 - a/2)` and `2
    atan(a/2)`."""
    yield margin_within("disk", disk, omega, bound, doubt)
    gain = (2 + disk) / (2 - disk) if disk < 2 else np.inf
    if gain < LARGEST_GAIN_FACTOR:
        of_gain = bound * 4 * disk / (4 - disk**2)
    else:
        of_gain = 0.0
    yield limited_or_not("disk_gain", gain, omega, of_gain, doubt)
    phase = 2 * np.arctan(disk / 2)
    of_phase = bound * np.sin(phase) / phase
    yield margin_within("disk_phase", float(np.degrees(phase)), omega, of_phase, doubt)


def limited_or_not(name: str, gain: float, omega: float, bound: float, doubt: int) -> Margin:
    """Return the margin of a gain, which has a limit between 1/LARGEST_GAIN_FACTOR and
    LARGEST_GAIN_FACTOR."""
    if 1 / LARGEST_GAIN_FACTOR < gain < LARGEST_GAIN_FACTOR:
        return margin_within(name, gain, omega, bound, doubt)
    return Margin.unlimited(name, LARGEST_GAIN_FACTOR if gain > 1 else 0.0, doubt)
