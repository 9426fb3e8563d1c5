"""Where the response in time from an input to an output is as required, along any number of a loop.

`enclosed` says what is asked of a response and how it is bounded on a panel of the number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import Bounded, solve
from wavesweep.engine.intervals import SHARE_OF_SPAN, Intervals
from wavesweep.engine.loop import Loops
from wavesweep.engine.response import Port
from wavesweep.require.between import Between, by_panel, needed, of_panels, typical_between
from wavesweep.require.disc_panels import BAD, GOOD, LOST, OPEN, Accuracy, Domain, along_panels
from wavesweep.require.enclosed import BAND, ROWS_OF_BLOCK, Enclosed, mean_square, step
from wavesweep.require.gain_bound import MEASURES, RMS, STEP_SETTLING, TimeBound, distance
from wavesweep.require.gain_intervals import END_EXACTNESS, attached, begun_at_low_end, reads
from wavesweep.require.maps import over_frame, squares_over_frame

MOST_TICKS = 1000  # of a frame
WHOLE_TICKS = 1e-9  # of a time, by which it is no other number of ticks
BESIDE_END = 0.5  # of what ends are exact to, next to an end of stability
NO_END = 1e-9  # of the terms of the end of a step, which is 0 if it is less


def enclosed_value(
    measure: str,
    maps: Sequence[Bounded],
    port: Port,
    level: float | None = None,
    *,
    band: float = BAND,
    of_signal: bool = False,
    proved: bool = True,
) -> Enclosed:
    """What is known of a value of responses, one of MEASURES; maps: `maps_of` a port, by panels and points.

    level: about which it is asked, None if the value is. band, proved: see `step`; of_signal: whether the band is
    of the signal after a step of 1, and no share of its end. A time that is asked
    about is the level times how far the response is from its end after that, over the band: so it does
    not jump where one more sample leaves the band.
    """
    if measure == RMS:
        square = mean_square(maps, port.kind.size)
        return Enclosed(np.sqrt(square.low), np.sqrt(square.high))
    of_step = partial(step, maps, read=np.flatnonzero(reads(port)), proved=proved)
    if measure == STEP_SETTLING:
        scale = None
        if of_signal:
            scale, band = band / BAND, BAND
        if level is None:
            value, unit = of_step(settling=True, band=band, scale=scale), 1 / port.rate
        else:
            after = level * port.rate - 1
            value = of_step(band, settling=True, after=after, scale=scale)
            unit = level / band
        return value._replace(low=value.low * unit, high=value.high * unit)
    return of_step(level)


def maps_of(
    measure: str, port: Port, kept: np.ndarray, batch: tuple[int, ...], read: np.ndarray
) -> tuple[Bounded, ...]:
    """What a value of a response is computed from: `squares_over_frame` under noise, else `over_frame`."""
    if measure == RMS:
        return squares_over_frame(port, kept, batch)
    return over_frame(port, kept, batch, read)


def refuse_long_frame(ticks: int, key: str) -> None:
    """Raise UsageError for a frame of more than MOST_TICKS ticks, under the key of a table."""
    if ticks > MOST_TICKS:
        expected = f"a frame of at most {MOST_TICKS} ticks, such as that of rates that divide"
        raise UsageError(f"{key}: expected {expected}, found one of {ticks}")


def along_time(
    loops: Loops,
    along: str,
    domain: Domain,
    route: tuple[str, str],
    wanted: TimeBound,
    stable: Intervals,
) -> Intervals:
    """All intervals of a number in which a value of the response is at most its level, within those
    in which the loops may be stable.

    The arguments are those of `along_gain`. The omegas of ends are 0, with a minus: no mode is on
    the circle there. Accuracy: ends to END_EXACTNESS; a value that comes to rest too slowly, not by one real mode alone, is in
    doubt. Errors: UsageError if the signal moves without end, for a step that ends at 0, and for a
    frame of more than MOST_TICKS.
    """
    measure = wanted.measure
    of_signal = isinstance(wanted.within, str)
    if of_signal:
        band = distance(loops.drawing, wanted.signal, wanted.within)
        wanted = wanted._replace(within=band)
    span = domain.span
    size = domain.period.size
    drift, port, number, p = typical_between(loops, along, span, size, route, measure)
    refuse_long_frame(port.kind.size, f"sweep.require.{measure}")
    level = wanted.at_most * (1 + WHOLE_TICKS * wanted.is_time)
    columns = np.arange(size)
    about = loops, along, route, level, drift, needed(port.maps), np.flatnonzero(reads(port))
    ends = Accuracy(END_EXACTNESS, 8.0, END_EXACTNESS, np.full(size, END_EXACTNESS), slow=True)

    # Next to an end of stability discs have loops that grow: there nothing is looked for.
    low = stable.low + BESIDE_END * ends.of(stable.low, domain.width) * (stable.low > span[0])
    high = stable.high - BESIDE_END * ends.of(stable.high, domain.width) * (stable.high < span[1])
    inner = replace(stable, low=low, high=high)
    judge = InTime(*about, columns, inner, wanted, of_signal, port, np.zeros(size))
    if MEASURES[measure].of_step and not of_signal and judge.ends_at_zero(number, p):
        found = f"one from {wanted.source} to {wanted.signal}; rms bounds what comes of it"
        expected = "a step that ends at another value than 0"
        raise UsageError(f"sweep.require.{measure}: expected {expected}, found {found}")
    ends = ends._replace(begun=begun_at_low_end(judge, span))
    intervals = along_panels([judge], np.ones(size, bool), domain, ends)
    intervals = replace(intervals, low_omega=-intervals.low_omega, high_omega=-intervals.high_omega)
    return attached(intervals, stable, SHARE_OF_SPAN * domain.width)


@dataclass(frozen=True, slots=True, eq=False)
class InTime(Between):
    """A value of the response of loops, which has to be at most the level; of_signal: see `enclosed_value`; port: of
    some of them; looked_at: so many outputs of each column."""

    wanted: TimeBound
    of_signal: bool
    port: Port
    looked_at: np.ndarray
    forms: ClassVar[None] = None

    @property
    def order(self) -> int:
        """Of square matrices as large as those of a panel."""
        states = self.kept.size
        if self.wanted.measure == RMS:
            return states
        return int(np.sqrt((states + self.port.kind.size) * (states + self.read.size)))

    def _value(self, maps: Sequence[Bounded]) -> Enclosed:
        """What is known of the value, about its level."""
        wanted = self.wanted
        how: Any = {"band": wanted.within, "of_signal": self.of_signal}
        return enclosed_value(wanted.measure, maps, self.port, self.level, **how)

    def over_frame(self, port: Port, size: int) -> tuple[Bounded, ...]:
        return maps_of(self.wanted.measure, port, self.kept, (size,), self.read)

    def ends_at_zero(self, column: np.ndarray, p: np.ndarray) -> bool:
        """Whether the response to a constant input ends at 0, at all of some values."""
        maps = self.maps(column, p)
        E, G, O, T = (matrix for matrix, _ in maps)
        ones = np.ones((self.read.size, 1))
        through = T @ ones
        shown = O @ solve(-E, G @ ones)
        size = np.abs(through) + np.abs(shown)
        total = np.abs((through + shown).mean((-1, -2)))
        return bool((total <= NO_END * size.max((-1, -2))).all())

    def labelled(
        self, column: np.ndarray, low: np.ndarray, high: np.ndarray, bounds: list[np.ndarray]
    ) -> np.ndarray:
        """GOOD of panels all over which the value is at most the level, BAD of those all over which
        it is above it, LOST of those given up, OPEN of the others."""
        port, shape, known = self._about(column, low, high, bounds)
        maps = by_panel(self.over_frame(port, known.size * shape[1]), shape)
        for matrix, size in maps:
            known &= np.isfinite(matrix).all((1, 2, 3)) & np.isfinite(size).all((1, 2, 3))
        label = np.full(column.size, OPEN)
        rows = max(ROWS_OF_BLOCK, port.kind.size)
        # So that points x outputs x (inputs + states) of a block of frames stay below 2e6.
        at_once = max(1, 2_000_000 // (shape[1] * rows * (self.read.size + self.kept.size)))
        known_panels = np.flatnonzero(known)
        for first in range(0, known_panels.size, at_once):
            at = known_panels[first : first + at_once]
            # Outputs of a column, on all points of all its panels; some 18 s.
            spent = self.looked_at[column[at]] > 2e8
            label[at[spent]] = LOST
            at = at[~spent]
            if not at.size:
                continue
            value = self._value(of_panels(maps, at))
            np.add.at(self.looked_at, column[at], value.looked_at)
            label[at] = np.where(value.slow, LOST, OPEN)
            label[at[value.high <= self.level]] = GOOD
            label[at[value.low > self.level]] = BAD
        return label

    def worst_at(self, column: int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """The point z = 1, less 1, and by how much the value is beyond the level, of it, if that is
        known."""
        maps = self.maps(np.full(p.size, np.searchsorted(self.columns, column)), p)
        maps = by_panel(maps, (p.size, 1))
        value = self._value(maps)
        # What bounds later samples may be far above them, once one is beyond the level.
        seen = np.isfinite(value.high) | (value.low > self.level)
        of_seen = np.where(seen, value.low, np.nan)
        size = np.where(value.high <= self.level, value.high, of_seen)
        return np.zeros(p.size), size / self.level - 1
