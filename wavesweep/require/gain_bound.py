"""The bounds on gains as values, and the words of requirements. Specs have it, so that it does
not load numpy."""

from __future__ import annotations

from typing import Any, NamedTuple

from wavesweep.engine.errors import UsageError

OVERSHOOT, STEP_SETTLING, RMS = "overshoot", "step_settling", "rms"
FACTOR_GAIN, FACTOR_PHASE = "gain", "phase_deg"
BAND = "sweep.require.step_settling.within"
WITHIN = 0.02  # of its end, to which a step settles where nothing else is said


class Measure(NamedTuple):
    """A value of a response in time.

    unit: "s" of a time, which no number that changes the time of a frame may bound. most: its
    largest level. of_step: whether it is a share of the end of a step, which then is not 0. found:
    what is at most the level. words: of a requirement. title, description: of a wish.
    """

    unit: str
    most: float
    of_step: bool
    found: str
    words: str
    title: str
    description: str


MEASURES = {
    OVERSHOOT: Measure(
        "1",
        1e3,
        True,
        "a step overshoots its final value by at most this share of it",
        "an overshoot of at most {at_most:.15g} of a step of {from_} in {to}",
        "overshoot of a step",
        "overshoot of a step, as a share of its final value, for the worst tick of a frame in which it comes",
    ),
    STEP_SETTLING: Measure(
        "s",
        1e6,
        True,
        "a step is within 2 %, or `within`, of its final value, and stays, from a tick within this time on",
        "a step of {from_} within {band} of its end in {to} after {at_most:.15g} s",
        "settling time of a step",
        "time of the first tick from which on an output stays within 2 %, or another share, of the final value of its step; "
        "settling is that of the slowest mode",
    ),
    RMS: Measure(
        "of to over from",
        1e12,
        False,
        "white noise of a root mean square of 1, new in every tick, comes out with at most this: the H2 norm, also beside "
        "chances of [for_all]",
        "a root mean square of at most {at_most:.15g} in {to} under white noise of 1 in {from_}",
        "output under white noise",
        "root mean square of the output under white noise of a root mean square of 1, new in every tick: the H2 norm",
    ),
}


Wished = tuple[str, float, dict[str, Any]]
"""The name of a wish for what is required, its bound and its options."""


def distance(drawing: Any, signal: str, text: str) -> float:
    """The number of a text like `0.5 mm` in the unit of an output of [ports].

    Errors: UsageError for another signal or unit, or a number that is not above 0.
    """
    from wavesweep.program.reading.units import number_in

    unit = next((unit for name, _, unit in drawing.outputs if name == signal), "")
    value = number_in(text, unit) if unit else None
    if value is not None and value > 0:
        return value
    expected = f"a share, or a value > 0 in {unit}"
    if not unit:
        expected = f"a share where {signal} is no output of [ports] with a unit"
    raise UsageError(f"{BAND}: expected {expected}, found {text}")


class GainBound(NamedTuple):
    """What a gain has to be below: the names of an input and an output, the level, and a
    band."""

    source: str
    signal: str
    at_most: float
    band_hz: tuple[float, float] | None = None

    word = "gain"
    wish = "", 0.0, {}  # there is none of a gain alone


class PeakBound(NamedTuple):
    """What the gain of sines at their own frequency has to be below, of those below half of the
    rate at which the input is read."""

    source: str
    signal: str
    at_most: float

    word = "peak"
    band_hz = None  # it is of all that the input's rate can show

    @property
    def wish(self) -> Wished:
        """The wish for it."""
        return "peak", self.at_most, {"from": self.source, "to": self.signal}


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

    @property
    def word(self) -> str:
        """What sets an end that it sets."""
        return f"{'disk' if self.centre else 'Ms'} at {self.cut}"

    @property
    def wish(self) -> Wished:
        """The wish for it."""
        options = {"cut": self.cut}
        return ("disk", 1 / self.at_most, options) if self.centre else ("Ms", self.at_most, options)


class FactorBound(NamedTuple):
    """With which factors of the signal at a cut a loop has to be stable.

    margin: FACTOR_GAIN, from 1/size to size; or FACTOR_PHASE, a phase of up to `size` deg either way.
    """

    cut: str
    margin: str
    size: float

    band_hz = None  # it is of all frequencies

    @property
    def word(self) -> str:
        """What sets an end that it sets."""
        return f"{'gain' if self.margin == FACTOR_GAIN else 'phase'} at {self.cut}"

    @property
    def wish(self) -> Wished:
        """The wish for it."""
        return "gain" if self.margin == FACTOR_GAIN else "phase_deg", self.size, {"cut": self.cut}


class TimeBound(NamedTuple):
    """What a value of the response in time from an input to an output may be at most.

    measure: which value, one of MEASURES. within: the share of its end to which a step settles; a text like `0.5 mm` is
    how far it may be from its end after a step of 1, see `distance`.
    """

    measure: str
    source: str
    signal: str
    at_most: float
    within: float | str = WITHIN

    band_hz = None  # it is of all frequencies

    @property
    def word(self) -> str:
        """What sets an end that it sets."""
        return self.measure

    @property
    def wish(self) -> Wished:
        """The wish for it."""
        options: dict[str, Any] = {"from": self.source, "to": self.signal}
        if self.measure == STEP_SETTLING:
            options["within"] = self.within
        return self.measure, self.at_most, options

    @property
    def is_time(self) -> bool:
        """Whether the value is a time (s)."""
        return MEASURES[self.measure].unit == "s"
