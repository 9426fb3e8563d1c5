"""Forces of the hand, one number per fast tick."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.engine.arguments import real_numbers
from wavesweep.engine.errors import UsageError
from wavesweep.simulation.keys import MOST_COUNTED, first_tick


@dataclass(frozen=True)
class Tone:
    """A section of the record with a settled sine: ticks `first` up to, but without, `last`."""

    frequency_hz: float
    first: int
    last: int


@dataclass(frozen=True)
class Input:
    """Hand force (N) per fast tick, shape ``(ticks,)``, read-only, and the sections for
    estimating the response."""

    force: np.ndarray
    tones: tuple[Tone, ...] = ()

    def __post_init__(self) -> None:
        """Make the record read-only."""
        self.force.flags.writeable = False


def sine(
    fast_hz: float,
    frequency_hz: float,
    amplitude: float = 1.0,
    seconds: float = 4.0,
    settle: float = 2.0,
) -> Input:
    """Return ``amplitude·sin(2π·f·t)``, measured after `settle` seconds over as many whole periods
    as fit, if one does.

    Errors: `UsageError` for a frequency out of range.
    """
    settled = _ticks(fast_hz, settle)
    ticks = _ticks(fast_hz, seconds)
    _check(fast_hz, frequency_hz)
    periods = max(
        0, int((ticks - settled) * frequency_hz / fast_hz + 1e-9)
    )  # a last period is whole in spite of rounding
    force = amplitude * np.sin(2 * np.pi * frequency_hz / fast_hz * np.arange(ticks))
    tone = Tone(
        frequency_hz, settled, settled + (round(periods * fast_hz / frequency_hz) if periods else 0)
    )
    return Input(force, (tone,) if periods else ())


def stepped_sine(
    fast_hz: float,
    frequencies_hz: Sequence[float],
    amplitude: float = 1.0,
    settle: float = 2.0,
    periods: int = 5,
    least: float = 1.0,
    longest: float = np.inf,
) -> Input:
    """Return one sine after the other without a jump in phase, as a measured sine sweep does.

    Parameters: `frequencies_hz` above 0 and below half the fast rate, `amplitude` (N), `settle`
    seconds before each measurement, which then takes `periods` (at least 1) whole periods and at
    least `least` seconds of them. There is no force after `longest` seconds, and no section that ends
    later.

    Errors: `UsageError` for a frequency out of range.
    """
    phases = []  # rad, of the ticks of each section
    tones = []
    first = 0  # tick of the section
    phase = 0.0  # rad, at that tick
    end = _ticks(fast_hz, min(longest, MOST_COUNTED / fast_hz))
    for frequency in map(float, frequencies_hz):
        _check(fast_hz, frequency)
        measured_periods = max(periods, int(np.ceil(least * frequency)))
        measured_ticks = round(min(measured_periods / frequency * fast_hz, MOST_COUNTED))
        settled = first + _ticks(fast_hz, settle)
        last = settled + measured_ticks
        phase_of_tick = 2 * np.pi * frequency / fast_hz
        phases.append(phase + phase_of_tick * np.arange(min(last, end) - first))
        if last > end:
            break
        phase += phase_of_tick * (last - first)
        tones.append(Tone(frequency, settled, last))
        first = last
    force = amplitude * np.sin(np.concatenate(phases)) if phases else np.zeros(0)
    return Input(force, tuple(tones))


def chirp(
    fast_hz: float,
    start_hz: float = 0.1,
    stop_hz: float = 50.0,
    amplitude: float = 1.0,
    seconds: float = 20.0,
) -> Input:
    """Return a sine whose frequency rises logarithmically from `start_hz` to `stop_hz` (both
    above 0)."""
    if start_hz <= 0 or stop_hz <= 0:
        raise UsageError(
            f"chirp: expected two frequencies above 0 Hz, found {start_hz} and {stop_hz}"
        )
    t = np.arange(_ticks(fast_hz, seconds)) / fast_hz
    octaves = np.log(stop_hz / start_hz) / seconds if len(t) else 0.0
    turns = start_hz * (np.expm1(octaves * t) / octaves if octaves else t)
    return Input(amplitude * np.sin(2 * np.pi * turns))


def pulse(
    fast_hz: float,
    amplitude: float = 1.0,
    seconds: float = 2.0,
    at: float = 0.1,
    width: float = 0.05,
) -> Input:
    """Return a force that lasts from `at` seconds for `width` seconds, from the first tick at or
    after its beginning on."""
    force = np.zeros(_ticks(fast_hz, seconds))
    first = _ticks(fast_hz, at)
    force[first : _ticks(fast_hz, at + width)] = amplitude
    return Input(force)


def noise(fast_hz: float, amplitude: float = 1.0, seconds: float = 10.0, seed: int = 0) -> Input:
    """Return white noise of standard deviation `amplitude`, the same for the same `seed`."""
    return Input(amplitude * np.random.default_rng(seed).standard_normal(_ticks(fast_hz, seconds)))


def given(force) -> Input:
    """Return a record of force (N) per tick as an input. Errors: `UsageError` if it is not a
    vector of finite numbers."""
    numbers = real_numbers(force)
    if numbers is None:
        raise UsageError(
            f"force: expected a row of finite numbers, one per fast tick, found {force!r:.60}"
        )
    force = numbers.astype(float)
    if force.ndim != 1 or not np.isfinite(force).all():
        if force.ndim != 1:
            problem = f"shape {force.shape}"
        else:
            problem = "some that are not finite"
        raise UsageError(
            f"force: expected a row of finite numbers, one per fast tick, found {problem}"
        )
    return Input(force)


def lasting(record: Input, ticks: int) -> Input:
    """Return the record cut off at `ticks`, or extended by zeros; a tone that is cut off is not
    measured."""
    force = np.zeros(ticks)
    force[: len(record.force)] = record.force[:ticks]
    return Input(force, tuple(tone for tone in record.tones if tone.last <= ticks))


def _check(fast_hz: float, frequency_hz: float) -> None:
    """Reject a frequency that the fast rate cannot represent."""
    if not 0.0 < frequency_hz < fast_hz / 2:
        raise UsageError(
            f"frequency: expected above 0 and below {fast_hz / 2} Hz, found {frequency_hz} Hz"
        )


def _ticks(fast_hz: float, seconds: float) -> int:
    if not 0.0 <= seconds < np.inf:
        raise UsageError(f"duration: expected 0 s or more, found {seconds} s")
    return first_tick(seconds, fast_hz)
