"""The H-infinity norm of lifted loops, by the method for as many ticks as their frame has."""

import numpy as np

from wavesweep.engine._energy.hinf import NORM_TOLERANCE, Peak, hinf_norm
from wavesweep.engine._energy.lifted_map import TickMaps
from wavesweep.engine._energy.long_frames import squared_norm_of_one

# inputs and outputs of a frame, beyond which no matrix of all of them is decomposed
MOST_DENSE_SIGNALS = 64


def squared_norm(ticks: TickMaps) -> Peak:
    """The peak of the square of the H-infinity norm of a lifted map; half of NORM_TOLERANCE is left
    for rounding.

    Frames of many ticks are searched and proved otherwise, one by one; those that this leaves open
    as all others.
    """
    wide = min(
        sum(ticks.maps[kind][3].shape[axis] for kind in ticks.kind.tolist()) for axis in (-2, -1)
    )
    if ticks.kind.size == 1 or wide <= MOST_DENSE_SIGNALS:
        return _by_responses(ticks)
    norms = [
        squared_norm_of_one(ticks.at(slice(loop, loop + 1)), NORM_TOLERANCE)
        for loop in range(ticks.loops)
    ]
    peak = Peak(*(np.array(values) for values in zip(*norms, strict=True)))
    open_ = np.flatnonzero(~peak.certified & np.isfinite(peak.value))
    if open_.size:
        again = _by_responses(ticks.at(open_))
        peak.value[open_] = again.value
        peak.theta[open_] = again.theta
        peak.certified[open_] = again.certified
    return peak


def _by_responses(ticks: TickMaps) -> Peak:
    """The same by the responses at all angles at which a level may be met."""
    lifted = ticks.lifted(measured=False)
    return hinf_norm(
        lambda owner, theta, _: lifted.largest_square(owner, theta),
        lambda owner, square: ticks.loss_pencil(owner, square).angles(),
        ticks.loops,
        lambda _, square: NORM_TOLERANCE * square,
    )
