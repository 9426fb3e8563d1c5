"""Where the gain from an input to an output stays below a level at all frequencies, along any
number of a loop.

`frame_gain` says what the gain is and how a panel of the number is judged, `sines` that of a sine.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import solve
from wavesweep.engine.intervals import SHARE_OF_SPAN, Intervals
from wavesweep.engine.loop import Loops
from wavesweep.require.between import needed, typical_between
from wavesweep.require.disc_panels import Accuracy, Domain, along_panels
from wavesweep.require.frame_gain import BoundedGain, Sine
from wavesweep.require.gain_bound import GainBound, PeakBound
from wavesweep.require.maps import over_frame

# Of an end, and of a NEAR_ZERO-th of the span: two eigenvalues meet there, which rounding moves by
# its root.
END_EXACTNESS = 1e-8
# Of the span, and of a pole that is 1 at its low end from 1: see `Accuracy`.
BESIDE_POLE = 1e-6
SLOW_MODE = 1e-7
AT_REST_ANGLE = 1e-9  # of the level, how near the gain at rest is to it if it is the level itself


def along_gain(
    loops: Loops,
    along: str,
    domain: Domain,
    route: tuple[str, str],
    wanted: GainBound | PeakBound,
    stable: Intervals,
) -> Intervals:
    """All intervals of a number in which the gain of loops stays below a level, within those in
    which they may be stable.

    route: the input and the signal. The omegas of ends are those at which the gain is largest, with
    a minus: no mode is on the circle there. A gain at rest that is the level at all values is taken
    as it, and its neighbourhood decides. Accuracy: ends to END_EXACTNESS. Errors: UsageError if the
    signal moves without end, and for a band or a loop that the gain cannot be had of.
    """
    first = np.nanmin(stable.low, initial=np.inf)
    if domain.span[0] < first == 0 < domain.span[1]:  # as is that of an integrator
        domain = domain._replace(span=(0.0, domain.span[1]))
    elif domain.span[0] < np.nanmax(stable.high, initial=-np.inf) == 0 <= domain.span[1]:
        domain = domain._replace(span=(domain.span[0], 0.0), from_above=True)
    span = domain.span
    period = domain.period
    size = period.size
    drift, port, number, p = typical_between(loops, along, span, size, route, wanted.word)
    ticks = port.kind.size
    about = loops, along, route, wanted.at_most, drift, needed(port.maps), np.arange(ticks)
    read = np.flatnonzero(reads(port))
    of_sines = isinstance(wanted, PeakBound) and ticks > 1
    if of_sines:
        kind: type[BoundedGain] = Sine
        domain = domain._replace(period=period / ticks)
        arc = np.tile([0.0, np.pi / between_reads(read, ticks)], (size, 1))
    else:
        kind = BoundedGain
        arc = _arc(wanted, ticks, period)
    gain = kind(*about, np.arange(size), stable, arc, at_rest=False)

    few = max(1, 1_000_000 // ticks**2)  # frames at a time
    off = np.concatenate(
        [
            gain.off_at_rest(number[first : first + few], p[first : first + few])
            for first in range(0, p.size, few)
        ]
    )
    is_level = (off <= AT_REST_ANGLE * gain.level).reshape(size, -1).all(-1)
    at_rest = is_level & (gain.arc[:, 0] == 0)
    judges = []
    if (~at_rest).any():
        columns = np.flatnonzero(~at_rest)
        judges.append(replace(gain, columns=columns, read=gain.read if of_sines else read))
    if at_rest.any():
        columns = np.flatnonzero(at_rest)
        judges.append(kind(*about, columns, stable, gain.arc, at_rest=True))

    begun = begun_at_low_end(gain, span[::-1] if domain.from_above else span)
    ends = Accuracy(END_EXACTNESS, 64.0, END_EXACTNESS, begun, slow=True)
    finite_columns = np.ones(size, bool)
    intervals = along_panels(judges, finite_columns, domain, ends)
    intervals = replace(intervals, low_omega=-intervals.low_omega, high_omega=-intervals.high_omega)
    return attached(intervals, stable, SHARE_OF_SPAN * domain.width)


def reads(port: Any) -> np.ndarray:
    """Whether the input is read in each tick of a frame."""
    return np.array([any((x != 0).any() for x in port.maps[kind][1::2]) for kind in port.kind])


def between_reads(read: np.ndarray, ticks: int) -> int:
    """The ticks from one of the ticks of a frame in which an input is read to the next; of several
    distances what they have in common."""
    if not read.size:
        return ticks
    return int(np.gcd.reduce(np.append(read - read[0], ticks)))


def about_reads(
    loops: Loops, along: str, span: tuple[float, float], route: tuple[str, str], word: str
) -> tuple[int, float, float | None]:
    """Return the ticks from read to read of an input, the rate (Hz) of these, and the gain at rest
    in the energy of all ticks; None if that depends on the number. Arguments: see `along_gain`."""
    _, port, _, p = typical_between(loops, along, span, 1, route, word)
    ticks = port.kind.size
    E, G, O, T = (
        matrix.value for matrix in over_frame(port, needed(port.maps), p.shape, np.arange(ticks))
    )
    read = reads(port)
    apart = between_reads(np.flatnonzero(read), ticks)
    constant = (read / max(1.0, read.sum()) ** 0.5)[:, None]
    at_rest = np.linalg.norm((T - O @ solve(E, G)) @ constant, axis=(-2, -1))
    fixed = np.ptp(at_rest) <= AT_REST_ANGLE * at_rest.max()
    return apart, port.rate / apart, float(at_rest.min()) if fixed else None


def begun_at_low_end(gain, span):
    """From which share of the span on an interval that begins at its low end is proved, see
    `Accuracy`, of each column."""
    size = gain.columns.size
    low_end = np.full(size, span[0] + BESIDE_POLE * (span[1] - span[0]))
    poles = np.linalg.eigvals(gain.changes(np.arange(size), low_end))
    with np.errstate(divide="ignore"):
        begun = BESIDE_POLE * np.minimum(1.0, SLOW_MODE / np.abs(poles).min(-1))
    return np.maximum(begun, END_EXACTNESS)


def _arc(wanted: GainBound, ticks: int, period: np.ndarray) -> np.ndarray:
    """The angles of the ends of the band, `(columns, 2)`; ticks: of a frame; period: of it, s."""
    if wanted.band_hz is None:
        return np.tile([0.0, np.pi], (period.size, 1))
    arc = 2 * np.pi * np.outer(period, wanted.band_hz)
    beyond = arc[:, 1] > np.pi * (1 + 1e-9)
    if beyond.any():
        half_rate = 0.5 / period[beyond].max()
        rate_of = "frames, beyond which they fold" if ticks > 1 else "ticks"
        raise UsageError(
            f"sweep.require.gain.band_hz: expected frequencies up to {half_rate:g} Hz, half the "
            f"rate of the {rate_of}, found {wanted.band_hz[1]:g}"
        )
    return np.minimum(arc, np.pi)


def attached(
    intervals: Intervals, stable: Intervals, nothing: float, exactness: float = END_EXACTNESS
) -> Intervals:
    """Intervals whose ends that are as near to those of stability as ends are exact are these."""
    same_column = intervals.column[:, None] == stable.column
    ends = {}
    for side in ("low", "high"):
        end = getattr(intervals, side)[:, None]
        stable_end = getattr(stable, side)
        exact = exactness * (np.abs(stable_end) + nothing)
        near = (np.abs(end - stable_end) <= exact) & same_column
        nearest = near.argmax(-1)
        for name in (side, f"{side}_omega", f"{side}_cause"):
            ends[name] = np.where(
                near.any(-1), getattr(stable, name)[nearest], getattr(intervals, name)
            )
    return replace(intervals, **ends)
