"""Stable intervals of the wall's stiffness for a device that is held, whichever hand of a box it is held by."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.intervals import stable_intervals
from wavesweep.analysis.passivity.hand import HandBox, cut_with_hands
from wavesweep.analysis.passivity.worst_hand import worst_hands

ROUNDS = 12
PROBES = np.array([1e-9, 0.02, 0.15, 0.4, 0.65, 0.9, 0.98, 1 - 1e-9])  # shares of an interval that hands are tried at
NOBODY = (float("nan"),) * 3
SAME = 1e-8  # a damping ratio this little below 0 is rounding


@dataclass(frozen=True, slots=True, eq=False)
class HeldIntervals:
    """Intervals of K_VE (N/m), stable for every hand that was found to matter.

    low, high: `(intervals,)`. low_hand, high_hand: `(intervals, 3)`, the hand (kg, N*s/m, N/m) that sets that end, NaN
    where the range ends it. hands: `(n, 3)`, all that were closed in. each: the intervals of each of these are proved.
    settled: the last search found no hand that the intervals do not hold for. method: what that is worth.
    """

    low: np.ndarray
    high: np.ndarray
    low_hand: np.ndarray
    high_hand: np.ndarray
    hands: np.ndarray
    each: bool
    settled: bool
    method: str = "intervals of each hand proved; hands searched for at 8 stiffnesses of every interval, without proof"


def box_intervals(values, span, box: HandBox) -> HeldIntervals:
    """Intervals of K_VE within `span` (low, high) that are stable for every hand of the box.

    values: flat keys, numbers. The exact intervals of a few hands are intersected; then the worst hand is looked for at
    the ends of what is left and between, by damping ratio, and closed in where it is unstable; and again, until none is
    found.
    """
    hands, left, each = _corners_and_middle(box), [Piece(*map(float, span))], True
    fresh, settled = hands, False
    for _ in range(ROUNDS):
        for hand, (pieces, proved) in zip(fresh, _per_hand(values, span, fresh), strict=True):
            left, each = _intersected(left, pieces, hand), each and proved
        fresh = _unstable_hands(values, box, left) if left else fresh[:0]
        settled = not len(fresh)
        if settled:
            break
        hands = np.concatenate([hands, fresh])
    ends = [np.array([getattr(piece, end) for piece in left]) for end in ("low", "high", "low_hand", "high_hand")]
    return HeldIntervals(*ends[:2], *(end.reshape(-1, 3) for end in ends[2:]), hands, each, settled)


@dataclass(frozen=True, slots=True)
class Piece:
    """An interval and the hands that end it, NOBODY where the range does."""

    low: float
    high: float
    low_hand: tuple[float, ...] = NOBODY
    high_hand: tuple[float, ...] = NOBODY


def _corners_and_middle(box):
    ends = [[0.0, 1.0] if free else [0.0] for free in box.high > box.low]
    corners = box.points(np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 3))
    return np.unique(np.concatenate([corners, box.points(np.full((1, 3), 0.5))]), axis=0)


def _per_hand(values, span, hands):
    """Stable intervals of each hand, as ([(low, high), ...], certified), in order."""
    found = [None] * len(hands)
    for group in (np.flatnonzero(hands[:, 2] > 0), np.flatnonzero(hands[:, 2] == 0)):
        if not group.size:
            continue
        B = np.full((group.size, 1), float(values["environment.B_VE"]))
        cut = cut_with_hands(values, hands[group])
        seen = stable_intervals(cut.at(np.arange(group.size)), "K_VE", span, B)
        for at, hand in enumerate(group):
            rows = np.flatnonzero((seen.column == at) & (seen.index >= 0))
            proved = bool(np.all(seen.certified[seen.column == at]))
            found[hand] = list(zip(seen.low[rows], seen.high[rows], strict=True)), proved
    return found


def _intersected(left, pieces, hand):
    """What both have, each end with the hand that sets it."""
    name = tuple(hand.tolist())
    both = []
    for old in left:
        for low, high in pieces:
            start = (float(low), name) if low > old.low else (old.low, old.low_hand)
            stop = (float(high), name) if high < old.high else (old.high, old.high_hand)
            if start[0] < stop[0]:
                both.append(Piece(start[0], stop[0], start[1], stop[1]))
    return both


def _unstable_hands(values, box, left):
    """Hands with which a probe of one of the pieces is unstable beyond doubt."""
    low, high = (np.array([getattr(piece, end) for piece in left])[:, None] for end in ("low", "high"))
    probes = (low + (high - low) * PROBES).reshape(-1)
    hands, _, damping, _ = worst_hands(values, box, probes, values["environment.B_VE"], "damping")
    return np.unique(hands[damping < -SAME], axis=0)
