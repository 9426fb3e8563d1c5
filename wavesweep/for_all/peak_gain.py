"""A proof for messages of any age by a small gain of peaks: what a receiver holds was sent, so its peak
is at most that of what is sent, however late it is.

In the ticks of a loop `x+ = M x`, some of the states, w, are such messages, free up to their peak, and
become what is sent, d. Of each w, and of a unit on each other state, the absolute responses are summed
from each tick of a period on for some periods: of d and x, with the largest of a period, it gives P.
Inputs with peaks u = (w, v) so give d and x with peaks of at most P u, but for three things, each of which
is again an input v of some peak: what the loop differs from M by, at most R x; what a tick is rounded by,
which is a part of R; and what is left of the responses at their end, at most L u. So the loop decays for
messages of any age if there are peaks u > 0 with

    P_d u < w   and   R P_x u + L u < v,

since these bound a run of any length, also of signals that grow by a little in each tick (the small gain of
peaks: M. A. Dahleh, I. J. Diaz-Bobillo, Control of Uncertain Systems, 1995, chapter 7).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.engine.doubles import EPS
from wavesweep.engine.switched import LoopFrames

MOST_TICKS = 20000  # that a response is followed
POWERS = 12  # squarings of a series, after which its terms are gone
ROOM = 1e-9  # of peaks: more than rounding takes


@dataclass(frozen=True, slots=True, eq=False)
class PeakGain:
    """Ticks of a loop `whole` in which states are free, and become what is sent; slots: these
    states, by channel."""

    whole: LoopFrames
    slots: Mapping[int, int]

    def proved(self, low: float, high: float) -> bool:
        """Whether the loop decays for all numbers from low to high, which may be the same."""
        points = self.whole.hull(low, high)
        if points is None:
            return False
        E, dE = points
        M = np.eye(E.shape[-1]) + (E.max(0) + E.min(0)) / 2
        return _decays(M, (E.max(0) - E.min(0)) / 2 + dE.max(0), [*self.slots.values()])


def _decays(M: np.ndarray, R: np.ndarray, slots: Sequence[int]) -> bool:
    """Whether peaks show that all ticks `(ticks, n, n)` within R of M decay."""
    ticks, n, _ = M.shape
    unsent = np.delete(np.arange(n), slots)
    order = [*slots, *unsent]
    M = M[:, order][..., order]
    free = len(slots)
    R = (R[:, order][..., order] + (2 * n + 4) * EPS * np.abs(M)).max(0)
    inputs = np.broadcast_to(np.eye(n), M.shape).copy()
    inputs[..., :free] = M[..., :free]
    M[..., :free] = 0
    responses = np.zeros((n, ticks, n))
    sums = np.zeros((ticks, n, n))
    enough = ticks
    for tick in range(MOST_TICKS):
        place = tick % ticks
        responses = np.tensordot(M[place], responses, 1)
        if tick < ticks:
            responses[:, tick] = inputs[tick]
        sums[place] += np.abs(responses).sum(1)
        if tick + 1 < enough:
            continue
        enough *= 2
        P = sums.max(0) * (1 + 2 * tick * EPS)
        bound = R @ np.concatenate([np.eye(n)[:free], P[free:]])
        bound[:free] += P[:free]
        if np.abs(np.linalg.eigvals(bound)).max(initial=0.0) >= 1:  # it only grows
            return False
        bound[free:] += np.abs(responses).sum(1)[free:]
        peaks = np.ones(n)
        power = bound
        with np.errstate(over="ignore", invalid="ignore"):  # where peaks grow, nothing is proved
            for _ in range(POWERS):
                peaks = peaks + power @ peaks
                power = power @ power
            if (bound @ peaks < (1 - ROOM) * peaks).all():
                return True
    return False
