"""The damping that a loop needs to be stable with every passive hand, at values of its numbers: a witness of proved ranges."""

from dataclasses import dataclass

import numpy as np

from wavesweep.engine.norms import LiftedMap, damping_peak
from wavesweep.engine.poles import is_stable
from wavesweep.haptics.held_loop import HeldLoop
from wavesweep.passive.over_ranges import reaction, settled

LOWEST = 1e-3  # rad per frame; loops that do not settle are examined from here on


@dataclass(frozen=True, slots=True, eq=False)
class DampingNeeded:
    """Arrays over the batch of the loops.

    damping: d* (N*s/m), of device and hand together; infinite if none is enough. omega: the
    frequency that needs it, rad/s, in [0, pi/T_s]. responsive: whether the controller, its position prescribed, is
    stable; else no damping is enough. certified: whether no frequency needs more, see `damping_peak`.
    """

    damping: np.ndarray
    omega: np.ndarray
    responsive: np.ndarray
    certified: np.ndarray


def damping_needed(loop: HeldLoop) -> DampingNeeded | None:
    """Least damping d* of device and hand with which the loop is stable whatever else, passive, the hand is.

    None if nothing bounds it, see `wavesweep.passive.over_ranges.reaction_maps`, whose map is C in `d* = -T min lambda(He C)`.
    The least eigenvalue is searched for over the whole circle.
    """
    if loop.device is None or loop.reads_velocity:
        return None
    drawn = loop.drawn()
    batch = loop.batch
    ticks, x = reaction(loop, drawn, batch)
    lifted = ticks.lifted()
    responsive = _is_responsive(lifted, x)
    apart = settled(lifted, x)
    chosen = {}
    for name in LiftedMap.__slots__:
        settles = responsive[:, None, None]
        chosen[name] = np.where(settles, getattr(apart, name), getattr(lifted, name))
    lifted = LiftedMap(**chosen)
    M = ticks.kind.size
    period = np.broadcast_to(np.real(drawn.period), batch).reshape(-1)
    peak = damping_peak(ticks, lifted, period, np.where(responsive, 0.0, LOWEST))
    finite = np.isfinite(peak.value)
    needed = np.where((responsive | (M == 1)) & finite, peak.value, np.inf)
    return DampingNeeded(
        needed.reshape(batch),
        (peak.theta / (period * M)).reshape(batch),
        (responsive & finite).reshape(batch),
        (peak.certified & finite).reshape(batch),
    )


def _is_responsive(lifted: LiftedMap, x) -> np.ndarray:
    """Whether the states other than the position x settle, `(loops,)`."""
    rest = np.setdiff1d(np.arange(lifted.E.shape[-1]), x)
    if not rest.size:
        return np.isfinite(lifted.E).all((-1, -2))
    return is_stable(lifted.E[:, rest][..., rest])
