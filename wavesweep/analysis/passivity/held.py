"""Stable intervals of the wall's stiffness for a device that is held, whichever hand of a box it is held by."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.intervals import stable_intervals
from wavesweep.analysis.passivity.hand import HandBox, cut_with_hands, worst_hands
from wavesweep.analysis.passivity.hand_proof import WORK, prove

ROUNDS = 16
MARGIN = 1e-3  # of an interval, at either end: what is proved leaves it out, where the loop is about to be unstable
PROBES = np.array([1e-9, 0.02, 0.15, 0.4, 0.65, 0.9, 0.98, 1 - 1e-9])  # shares of an interval that hands are tried at
NOBODY = (float("nan"),) * 3
SAME = 1e-8  # a damping ratio this little below 0 is rounding


@dataclass(frozen=True, slots=True, eq=False)
class HeldIntervals:
    """Intervals of K_VE (N/m), stable for every hand that was found to matter.

    low, high: `(intervals,)`. low_hand, high_hand: `(intervals, 3)`, the hand (kg, N*s/m, N/m) that sets that end, NaN
    where the range ends it. hands: `(n, 3)`, all that were closed in. each: the intervals of each of these are proved.
    settled: proved for every hand of the box but within MARGIN of an interval's ends, and there the last search found no
    hand that it does not hold for. What is not settled is the outcome of a search alone. method: the same in a sentence.
    """

    low: np.ndarray
    high: np.ndarray
    low_hand: np.ndarray
    high_hand: np.ndarray
    hands: np.ndarray
    each: bool
    settled: bool
    method: str = "settled: every hand proved but for a thousandth of the interval at its ends; else 8 stiffnesses searched"


def box_intervals(values, span, box: HandBox) -> HeldIntervals:
    """Intervals of K_VE within `span` (low, high) that are stable for every hand of the box.

    values: flat keys, numbers. The exact intervals of a few hands are intersected; then the worst hand is looked for at
    the ends of what is left and between, by damping ratio, and closed in where it is unstable; and again, until none is
    found. Then the box is cut into pieces until each is proved or holds a hand that breaks an interval, which is closed
    in as well (`hand_proof`); and where the pieces had to be smallest, the search begins once more.
    """
    hands, left, each = _corners_and_middle(box), [Piece(*map(float, span))], True
    fresh, known, proved, settled, work = hands, hands[:0], [], False, WORK
    for _ in range(ROUNDS):
        for hand, (pieces, sure) in zip(fresh, _per_hand(values, span, fresh), strict=True):
            left, each = _intersected(left, pieces, hand), each and sure
        fresh = _unstable_hands(values, box, left, known) if left else fresh[:0]
        if not len(fresh):
            bare = [piece for piece in left if not _within(piece.inner(MARGIN), proved)]
            settled = not bare and (bool(left) or each)
            if not bare or work <= 0:
                break
            more, fresh, known, work = _proved(values, box, bare, work)
            proved += more
        hands = np.concatenate([hands, fresh])
    ends = [np.array([getattr(piece, end) for piece in left]) for end in ("low", "high", "low_hand", "high_hand")]
    return HeldIntervals(*ends[:2], *(end.reshape(-1, 3) for end in ends[2:]), hands, each, settled)


def _proved(values, box, pieces, work):
    """Intervals within these proved for every hand, hands that are not stable, hands to look closer at, and work left."""
    found, proofs = [], []
    for piece in pieces:
        interval = piece.inner(0.9 * MARGIN)  # so that it stands when the ends give way a little
        proofs.append(prove(values, box, interval, work))
        work -= proofs[-1].work
        if not proofs[-1].holds:
            break
        found.append(interval)
    unstable, hardest = (np.concatenate([getattr(proof, name) for proof in proofs]) for name in ("unstable", "hardest"))
    spent = not proofs[-1].holds and not len(unstable)
    return found, unstable, np.concatenate([unstable, hardest]), 0 if spent else work


def _within(interval, others):
    return any(low <= interval[0] and interval[1] <= high for low, high in others)


@dataclass(frozen=True, slots=True)
class Piece:
    """An interval and the hands that end it, NOBODY where the range does."""

    low: float
    high: float
    low_hand: tuple[float, ...] = NOBODY
    high_hand: tuple[float, ...] = NOBODY

    def inner(self, share) -> tuple[float, float]:
        """It without so much of it at either end."""
        aside = share * (self.high - self.low)
        return self.low + aside, self.high - aside


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


def _unstable_hands(values, box, left, known):
    """Hands with which a probe of one of the pieces is unstable beyond doubt."""
    low, high = (np.array([getattr(piece, end) for piece in left])[:, None] for end in ("low", "high"))
    probes = (low + (high - low) * PROBES).reshape(-1)
    hands, _, damping, _ = worst_hands(values, box, probes, values["environment.B_VE"], "damping", known)
    return np.unique(hands[damping < -SAME], axis=0)
