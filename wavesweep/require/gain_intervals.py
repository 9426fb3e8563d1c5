"""Where the gain from an input to an output stays below a level at all frequencies, along any number of a loop.

`frame_gain` says what the gain is and how a panel of the number is judged, `long_gain` the same for frames of many ticks, and
`maps` has the map that shows the gain at the frequency itself.
"""

from dataclasses import replace

import numpy as np

from wavesweep.engine.blocks import OUTPUT
from wavesweep.engine.errors import UsageError
from wavesweep.engine.intervals import NEAR_ZERO, Intervals
from wavesweep.engine.loop import Loops
from wavesweep.engine.norms import reached, read
from wavesweep.require.disc_panels import Accuracy, along_panels
from wavesweep.require.frame_gain import BoundedGain, Sine, loops_between
from wavesweep.require.gain_bound import BASE_BAND, GainBound
from wavesweep.require.long_gain import LongGain

TYPICAL = (0.53, 0.37, 0.71, 0.13, 0.91)  # of the span, where the gain at rest is looked at
EXACT = 1e-8  # of an end, and of a NEAR_ZERO-th of the span: two eigenvalues meet there, which rounding moves by its root
BESIDE, SLOW = 1e-6, 1e-7  # of the span, and of a pole that is 1 at its low end from 1: see `Accuracy`
MANY = 24  # ticks of a frame, beyond which its inputs are eliminated
AT_REST = 1e-9  # of the level, how near the gain at rest is to it if it is the level itself


def along_gain(
    loops: Loops, along: str, span, period, bounds, resolved, route, wanted: GainBound, stable: Intervals
) -> Intervals:
    """All intervals of a number in which the gain of loops stays below a level, within those in which they may be stable.

    route: the input and the signal. period: of the frame, s, `(columns,)`. The next: see `along_panels`. The omegas of ends are
    those at which the gain is largest, with a minus: no mode is on the circle there. A gain at rest that is the level at all
    values is taken as it, and its neighbourhood decides. Accuracy: ends to EXACT.
    Errors: UsageError if the signal moves without end, and for a band or a loop that the gain cannot be had of.
    """
    drift = loops.changed({along: np.array(span)}).drift(watched=route[1:])
    values, size = span[0] + (span[1] - span[0]) * np.array(TYPICAL), period.size
    number, p = np.repeat(np.arange(size), values.size), np.tile(values, size)
    port, _ = loops_between(loops, along, drift, route, number, p)
    if port.outputs > 1:
        output = route[1].removeprefix(OUTPUT)
        raise UsageError(f"sweep.require.gain.to: expected an output that comes to rest, found {output}, which drifts")
    ticks = port.kind.size
    on = wanted.measure == BASE_BAND and ticks > 1
    step = period / ticks if on else period
    in_general = Sine if on else BoundedGain
    kind = LongGain if ticks > MANY and not on else in_general
    about = loops, along, route, wanted.at_most, drift, _needed(port.maps), ticks
    gain = kind(*about, np.arange(size), stable, _arc(wanted, ticks, step), at_rest=False)
    off = gain.off_at_rest(number, p)
    at_rest = (off <= AT_REST * gain.level).reshape(size, -1).all(-1) & (gain.arc[:, 0] == 0)
    judges = []
    if (~at_rest).any():
        judges.append(replace(gain, columns=np.flatnonzero(~at_rest)))
    if at_rest.any():
        judges.append(in_general(*about, np.flatnonzero(at_rest), stable, gain.arc, at_rest=True))
    poles = np.linalg.eigvals(gain.changes(np.arange(size), np.full(size, span[0] + BESIDE * (span[1] - span[0]))))
    with np.errstate(divide="ignore"):
        near = BESIDE * np.minimum(1.0, SLOW / np.abs(poles).min(-1))
    ends = Accuracy(EXACT, 64.0, EXACT, np.maximum(near, EXACT), slow=True)
    intervals = along_panels(judges, np.ones(size, bool), span, step, bounds, resolved, ends)
    return _attached(
        replace(intervals, low_omega=-intervals.low_omega, high_omega=-intervals.high_omega),
        stable,
        NEAR_ZERO * (span[1] - span[0]),
    )


def _needed(maps):
    """The states that the input reaches and the signal depends on."""
    needed = np.flatnonzero(read(maps) & reached(maps))
    return needed if needed.size else np.arange(1)


def _arc(wanted, ticks, step):
    """The angles of the ends of the band, `(columns, 2)`; ticks: of a frame; step: of the map, s."""
    if wanted.band_hz is None:
        return np.tile([0.0, np.pi], (step.size, 1))
    arc = 2 * np.pi * np.outer(step, wanted.band_hz)
    if (beyond := arc[:, 1] > np.pi * (1 + 1e-9)).any():
        of = "frames" if ticks > 1 and wanted.measure != BASE_BAND else "ticks"
        folding = f', beyond which they fold (measure = "{BASE_BAND}" has each frequency by itself)' if of == "frames" else ""
        raise UsageError(
            f"sweep.require.gain.band_hz: expected frequencies up to {0.5 / step[beyond].max():g} Hz, half the rate of the {of}"
            f"{folding}, found {wanted.band_hz[1]:g}"
        )
    return np.minimum(arc, np.pi)


def _attached(found, stable, nothing):
    """Intervals whose ends that are as near to those of stability as ends are exact are these."""
    ends = {}
    for side in ("low", "high"):
        end, stable_end = getattr(found, side)[:, None], getattr(stable, side)
        near = (np.abs(end - stable_end) <= EXACT * (np.abs(stable_end) + nothing)) & (found.column[:, None] == stable.column)
        at, is_near = near.argmax(-1), near.any(-1)
        for name in (side, f"{side}_omega"):
            ends[name] = np.where(is_near, getattr(stable, name)[at], getattr(found, name))
    return replace(found, **ends)
