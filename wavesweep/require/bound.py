"""Where eigenvalues have to be, as [sweep] requires in place of the unit circle, and what a gain
has to be below."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.intervals import Intervals
from wavesweep.engine.poles import GONE
from wavesweep.program.number_words import rounded_down, rounded_up
from wavesweep.program.reading.keys import ALL_MODES, TIMES_OF_MODES
from wavesweep.require.damped import Damped
from wavesweep.require.discs import RequiredCircle
from wavesweep.require.gain_bound import (
    MEASURES,
    WITHIN,
    CutBound,
    FactorBound,
    GainBound,
    PeakBound,
    TimeBound,
)

IMAGES = 3  # turns per frame up to which the mode at an end is looked for
LEAST_RADIUS = 1e-6  # of a radius: what is left of a smaller one's eigenvalues is rounding
DISCS = "discs about the frame's eigenvalues against {}, on panels halved down to the ends"
GAIN = "the gain by its symplectic pencil, whose eigenvalues are shown to be off the unit circle on panels of the number"
IN_TIME = "responses in time, frame by frame, on panels of the number: what is seen, and bounds on all that follows"
BOUNDED = "of a loop that conserves energy, [sweep] require = { bounded = true } finds where nothing grows"


@dataclass(frozen=True, slots=True)
class Bound:
    """Bounds on the eigenvalues of a drawing's frame: their size `radius`, per frame or, before
    `over`, per clock of the spec, the `times` (s) by their names in TIMES_OF_MODES, and how it is
    `damped`, None if that is not required; or that a loop which conserves is `bounded`. gains: what gains stay below, those at
    cuts among them.

    The protocol is that of `engine._search.question`.
    """

    radius: float = 1.0
    times: tuple[tuple[str, float], ...] = ()
    damped: Damped | None = None
    bounded: bool = False
    gains: tuple[GainBound | PeakBound | CutBound | FactorBound | TimeBound, ...] = ()

    @property
    def of_modes(self) -> "Bound | None":
        """The bounds on eigenvalues alone; None if there are none."""
        modes = replace(self, gains=())
        return modes if modes != Bound() else None

    @property
    def cost(self) -> float:
        """Seconds per slice by discs and for a gain; 0 of bounds on the size alone."""
        # Seconds per slice, measured: of a damping ratio, or of loops that conserve; of a gain, or
        # of factors.
        return 0.6 * bool(self.damped or self.bounded) + 1.0 * len(self.gains)

    @property
    def set_by(self) -> list[str]:
        """The words of what sets ends that no mode sets, one of each bound on a gain."""
        return [gain.word for gain in self.gains]

    @property
    def on_radius(self) -> "Bound | None":
        """The bounds on the size alone; None if there are none."""
        undamped = replace(self, damped=None)
        if undamped == Bound(bounded=self.bounded, gains=self.gains):
            return None
        return undamped

    @property
    def on_circle(self) -> bool:
        """Whether a mode that meets its bound is on a circle."""
        return not self.damped

    def over(self, frames: float) -> "Bound":
        """The same per frame, of which so many are what the radius is per."""
        damped = self.damped
        if damped:
            damped = damped._replace(clocks=damped.clocks / frames)
        return replace(self, radius=self.radius ** (1 / frames), damped=damped)

    def radius_of(self, period: np.ndarray) -> np.ndarray:
        """The radius of loops with these periods of a frame, in s.

        A mode z of a frame of T seconds is z^n after n frames. Its size is at most exp(-c) at the
        end of every frame from t on if `|z| <= exp(-c T/t)`, c being the time constants of such a t.
        It is of each mode by itself: several together, as those that nearly meet, may grow before they
        decay.
        """
        frame = np.asarray(period, float)
        longest = frame.max(initial=0.0)
        radii = [np.broadcast_to(self.radius, frame.shape)]
        requirements = [("radius", self.radius, "one nearer to 1")]
        for key, time in self.times:
            constants = TIMES_OF_MODES[key].constants
            radii.append(np.exp(-constants * frame / time))
            least = rounded_up(-constants * longest / np.log(LEAST_RADIUS), 3)
            requirements.append((key, time, f"at least {least} s"))
        for (key, value, expected), radius in zip(requirements, radii, strict=True):
            if (radius < LEAST_RADIUS).any():
                remedy = f"where a frame takes {longest:.3g} s"
                raise UsageError(
                    f"sweep.require.{key}: expected {expected} {remedy}, found {value:g}"
                )
        return np.minimum.reduce(radii)

    def logarithms(self, period: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """The logarithms of eigenvalues of that frequency (rad/s) that are just as large as they
        may be, `(..., 2)`."""
        ratio = self.damped.ratio if self.damped else 0.0
        gone = self.damped.gone(period) if self.damped else GONE
        theta = omega * period
        sizes = [np.log(self.radius_of(period))]
        for line in range(-IMAGES, IMAGES + 1):
            spiral = -np.abs(theta + 2 * np.pi * line) * ratio / np.sqrt(1 - ratio**2)
            sizes.append(np.maximum(spiral, np.log(gone)))
        return np.stack(sizes, -1) + 1j * theta[..., None]

    def intervals(self, frames: Any, span: tuple[float, float]) -> Intervals:
        """The intervals in which every mode has the damping ratio, or is bounded in a loop that
        conserves."""
        from wavesweep.require.by_discs import along_by_discs
        from wavesweep.require.disc_panels import Domain

        if self.bounded:
            place = RequiredCircle()
        else:
            place = self.damped.spiral(frames.period, frames.ticks)
        domain = Domain(span, frames.period, frames.bounds, frames.resolved)
        lines = not self.bounded and frames.ticks > 1
        return along_by_discs(frames, domain, place, lines=lines)

    def within_gain(
        self, gain: Any, frames: Any, span: tuple[float, float], stable: Intervals
    ) -> Intervals:
        """The intervals in which one of the gains is small enough, looked for where the loops may
        be stable."""
        from wavesweep.program.analyses.signals import routed
        from wavesweep.require.at_cut import seen_at_cut
        from wavesweep.require.disc_panels import Domain
        from wavesweep.require.factors import along_factors
        from wavesweep.require.gain_intervals import along_gain
        from wavesweep.require.time_intervals import along_time

        loops = frames.loops
        along = frames.along
        domain = Domain(span, frames.period, frames.bounds, frames.resolved)
        if isinstance(gain, FactorBound):
            return along_factors(loops, along, domain, gain, stable)
        if isinstance(gain, CutBound):
            seen, route, level = seen_at_cut(loops, gain)
            return along_gain(seen, along, domain, route, level, stable)
        in_time = isinstance(gain, TimeBound)
        drawing, route = routed(
            loops.drawing, gain.source, gain.signal, f"sweep.require.{gain.word}"
        )
        find = along_time if in_time else along_gain
        return find(loops._replace(drawing=drawing), along, domain, route, gain, stable)

    def notices(
        self, loops: Any, along: str, name: str, span: tuple[float, float]
    ) -> Iterator[str]:
        """Yield what is to be known of a gain or a peak from an input that is not read in every
        tick; name: of the number with the path `along`."""
        from wavesweep.program.analyses.signals import routed
        from wavesweep.require.gain_intervals import about_reads

        for gain in self.gains:
            if not isinstance(gain, GainBound | PeakBound):
                continue
            path = f"sweep.require.{gain.word}"
            drawing, route = routed(loops.drawing, gain.source, gain.signal, path)
            about = loops._replace(drawing=drawing), along, span, route, gain.word
            apart, hz, at_rest = about_reads(*about)
            once = f"{gain.source} is read once in {apart} ticks"
            if apart > 1 and isinstance(gain, PeakBound):
                yield f"peak: {once}, at {hz:.6g} Hz: of sines of f up to {hz / 2:.6g} Hz, as which {hz:.6g} Hz - f and + f are read"
            elif apart > 1 and at_rest and at_rest > gain.at_most:
                yield f"gain: {once}: at least {rounded_down(at_rest, 5)} whatever {name} is; peak has that of sines"

    def nearest(self, loops: Any, path: str, span: tuple[float, float]) -> dict[str, Any]:
        """See `nearest_to_all`."""
        from wavesweep.require.nearest import nearest_to_all

        return nearest_to_all(self, loops, path, span)

    def beyond(self, delta: np.ndarray, turns: np.ndarray, period: float) -> np.ndarray:
        """By how much eigenvalues less 1 of a loop miss what is required of modes, in the
        logarithm.

        turns: what their modes turn in a frame (rad), by their lines in the spectrum.
        """
        if self.bounded:
            return RequiredCircle().beyond(delta)
        with np.errstate(divide="ignore"):
            beyond_radius = np.log(np.abs(1 + delta)) - np.log(self.radius_of(period))
        if not self.damped:
            return beyond_radius
        spiral = self.damped.spiral(np.array([period]), 1).told(turns[None, :, None])
        return np.maximum(beyond_radius, spiral.beyond(delta[None])[0])

    def method(self, on_circle: str) -> str:
        """How the intervals are found, in a line; on_circle: how those of the unit circle are."""
        ways = []
        if self.bounded:
            ways.append(DISCS.format("each other and the unit circle"))
        elif self.damped:
            ways.append(DISCS.format("the spiral of the damping ratio"))
        if self.on_radius:
            ways.append(
                f"{on_circle}; of frames over the required radius, whose unit circle is its circle"
            )
        if self.gains and not ways:
            ways.append(on_circle)
        if not all(map(_in_time, self.gains)):
            ways.append(GAIN)
        if any(map(_in_time, self.gains)):
            ways.append(IN_TIME)
        return "; and ".join(ways)

    def refuse_rates(self, name: str) -> None:
        """Raise UsageError for a time to settle or the band of a gain, along a number that
        changes the time of a frame."""
        refused, expected = "", ""
        times = [name for name, _ in self.times]
        times += [
            gain.measure for gain in self.gains if isinstance(gain, TimeBound) and gain.is_time
        ]
        if times:
            refused, expected = times[0], "expected radius in its place"
        elif self.damped and self.damped.slower_than:
            refused, expected = "slower_than", "expected all modes"
        elif any(gain.band_hz for gain in self.gains):
            refused, expected = "band_hz", "expected a gain at all frequencies"
        if refused:
            instead = (
                f"or list its values in [sweep] ({name} = [...]) and look along another number"
            )
            raise UsageError(
                f"{name} changes the time of a frame: {expected}, found {refused}; {instead}"
            )


def along_at_random(ports: Any, span: tuple[float, float], at_most: float) -> Intervals:
    """See `at_random.along_at_random`."""
    from wavesweep.require import at_random

    return at_random.along_at_random(ports, span, at_most)


def root_mean_square(ports: Any) -> tuple[float, float]:
    """What the root mean square of loops at random is at least and at most; ports: `RandomPorts`."""
    from wavesweep.require.at_random import AtRandom

    known = AtRandom.of(ports, 1.0).about(np.zeros(1))
    return float(known.low[0]), float(known.high[0])


def root_mean_square_in_time(loops: Any, ends: Mapping[str, str]) -> float:
    """The root mean square of the output of one stable loop under white noise; NaN if it is not known."""
    from wavesweep.require.wish import measured

    value, _ = measured("rms", loops, 1, proved=False, **ends)
    return float(value[0])


def _in_time(gain: GainBound | PeakBound | CutBound | FactorBound | TimeBound) -> bool:
    """Whether it bounds a response in time."""
    return isinstance(gain, TimeBound)


def _modes_in_words(written: Mapping[str, object], clock: str) -> str:
    """Where all modes have to be, and how fast to decay; empty if nothing says so."""
    words = {
        "radius": f"within {{:.15g}} per {clock}",
        **{name: f"down to {time.share} in {{:.15g}} s" for name, time in TIMES_OF_MODES.items()},
        "bounded": "on the unit circle",
    }
    texts = (text.format(written[name]) for name, text in words.items() if name in written)
    return " and ".join(texts)


def words_of(written: Mapping[str, object], clock: str) -> str:
    """What is required, in words; written: see `Require.written`. clock: what a radius is per."""
    modes = _modes_in_words(written, clock)
    damped = ""
    if "damping_ratio" in written:
        requirement = Damped(
            written["damping_ratio"],
            written.get("modes", ALL_MODES),
            written.get("slower_than", 0.0),
        )
        damped = requirement.words()
    gain = written.get("gain")
    peak = written.get("peak")
    margins = written.get("margins", [])
    said = [
        f"every mode {modes}" if modes else "",
        damped or ("" if modes else "stability"),
        gain
        and f"a gain of at most {gain['at_most']:.15g} from {gain['from']} to {gain['to']}{_band(gain)}",
        peak
        and f"a peak of at most {peak['at_most']:.15g} from {peak['from']} to {peak['to']}, "
        "sine by sine up to half the rate of the input",
        *map(_at_cut, [margins] if isinstance(margins, Mapping) else margins),
        *(
            measure.words.format(
                **written[name],
                from_=written[name]["from"],
                band=_within(written[name].get("within", WITHIN)),
            )
            for name, measure in MEASURES.items()
            if name in written
        ),
    ]
    return " and ".join(filter(None, said))


def _within(band: float | str) -> str:
    """A share in per cent, or a value with its unit."""
    return band if isinstance(band, str) else f"{100 * band:.15g} %"


def _at_cut(margins: dict[str, float | str]) -> str:
    """The margins at a cut in words."""
    said = {
        "Ms": "Ms of at most {:.15g}",
        "disk": "a disk margin of at least {:.15g}",
        "gain": "a gain margin of at least {:.15g}, up and down,",
        "phase_deg": "a phase margin of at least {:.15g} deg",
    }
    words = " and ".join(
        text.format(margins[name]) for name, text in said.items() if name in margins
    )
    return f"{words} at {margins['cut']}"


def _band(gain: dict[str, Any]) -> str:
    """The band of a gain in words, and of what it is."""
    band = " between {:.15g} and {:.15g} Hz".format(*gain["band_hz"]) if "band_hz" in gain else ""
    return f"{band} in the energy of all ticks"
