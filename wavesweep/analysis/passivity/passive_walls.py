"""The stiffnesses of the wall with which the loop is passive, for held forces or for every passive hand."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity.any_hand import damping_needed
from wavesweep.analysis.passivity.port import port_margin
from wavesweep.diagram import WALL

POINTS = 33  # stiffnesses of the first look
CUTS = 15  # points of one round of refinement
TINY = 1e-300  # stands in for a zero that would take a state out of the loop
FINEST = 1e-10  # of the range, where an end is placed


@dataclass(frozen=True, slots=True, eq=False)
class PassiveWalls:
    """Intervals of K_VE (N/m), `(intervals,)` each.

    low, high: the passive side of each end. method: every stiffness that was looked at is proved passive or not; that
    nothing else lies between two neighbours of the same kind is not proved.
    """

    low: np.ndarray
    high: np.ndarray
    method: str = "each stiffness looked at is proved; 33 of the range are looked at, and the ends refined"


def port_passive_walls(values, span, path: str = "environment.K_VE") -> PassiveWalls:
    """Stiffnesses within `span` (low, high) with which the hand's port is passive for held forces (`port_margin`).

    path: another number to look along, in place of K_VE.
    """
    return _intervals(lambda p: port_margin(dict(values) | {path: _away_from_zero(path, p)}).passive, span)


def any_hand_walls(values, span, hand_damping: float = 0.0, path: str = "environment.K_VE") -> PassiveWalls | None:
    """Stiffnesses within `span` stable with every passive hand of at least `hand_damping` (N*s/m).

    None where `damping_needed` is. The guarantee is for continuous hands of any mass and stiffness, nonlinear ones and
    ones that change included. path: another number to look along, in place of K_VE.
    """
    if values["device.velocity"] != "difference":
        return None

    def passive(p):
        at = dict(values) | {path: _away_from_zero(path, p)}
        return damping_needed(at).suffices(at["device.damping"] + hand_damping)

    return _intervals(passive, span)


def _away_from_zero(path, p):
    """A batch must not have a zero that takes a branch of the drawing out of some of its loops."""
    return p if path in WALL else np.where(p == 0, TINY, p)


def _intervals(passive, span) -> PassiveWalls:
    """Runs of stiffnesses that pass, their ends refined all together by multisection."""
    low, high = map(float, span)
    # evenly in the square root: the interesting end is the soft one, and 0 belongs to the range
    points = low + (high - low) * np.linspace(0, 1, POINTS) ** 2
    good = passive(points)
    change = np.flatnonzero(good[1:] != good[:-1])
    inside, outside = (np.where(good[change] == kind, points[change], points[change + 1]) for kind in (True, False))
    while change.size and np.abs(inside - outside).max() > FINEST * (high - low):
        between = inside[:, None] + (outside - inside)[:, None] * np.arange(1, CUTS + 1) / (CUTS + 1)
        passed = passive(between.reshape(-1)).reshape(between.shape)
        count = np.where(passed.all(-1), CUTS, passed.argmin(-1))
        marks = np.concatenate([inside[:, None], between, outside[:, None]], axis=-1)
        inside, outside = (np.take_along_axis(marks, count[:, None] + step, -1)[:, 0] for step in (0, 1))
    rising = good[change + 1]
    lows = np.concatenate([points[:1][good[:1]], inside[rising]])
    highs = np.concatenate([inside[~rising], points[-1:][good[-1:]]])
    return PassiveWalls(lows, highs)
