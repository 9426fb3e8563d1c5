"""Stable intervals of the wall's stiffness for every hand of a box: intersected over the hands that matter, then proved."""

from dataclasses import dataclass

import numpy as np

from wavesweep.passive.enclosure import excluded
from wavesweep.passive.hand import HandBox, with_hands, worst_hands
from wavesweep.passive.hand_frame import NUMBER, HandLoop, frame_over, hand_loop
from wavesweep.passive.held_loop import HAND, HeldLoop

ROUNDS = 16
MARGIN = 1e-3  # of an interval, left out of the proof at either end, where the loop is about to be unstable
PROBES = np.array([1e-9, 0.02, 0.15, 0.4, 0.65, 0.9, 0.98, 1 - 1e-9])  # shares of an interval at which hands are tried
NO_HAND = (float("nan"),) * 3
SAME = 1e-8  # a damping ratio that is below 0 by less is rounding


@dataclass(frozen=True, slots=True, eq=False)
class BoxIntervals:
    """Intervals of a number, such as K_VE (N/m), that are stable for every hand that was found to matter.

    low, high: `(intervals,)`. low_hand, high_hand: `(intervals, 3)`, the hand (kg, N*s/m, N/m) that sets that end, NaN
    if the range ends it. hands: `(n, 3)`, all hands whose intervals were intersected. each: whether the intervals of each
    of them are proved. settled: whether stability is proved for every hand of the box, except within MARGIN of the ends,
    where every hand tried in the last search was stable. If not, the intervals rest on a search alone. method: the same
    in a sentence.
    """

    low: np.ndarray
    high: np.ndarray
    low_hand: np.ndarray
    high_hand: np.ndarray
    hands: np.ndarray
    each: bool
    settled: bool
    method: str = "settled: every hand proved but for a thousandth of the interval at its ends; else 8 stiffnesses searched"


def box_intervals(loop: HeldLoop, stable, path: str, span, box: HandBox) -> BoxIntervals:
    """Intervals of the number `path` within `span` (low, high) that are stable for every hand of the box.

    loop: a single one. stable: gives, of a batch of such loops, the stable intervals of each along the number within `span`, as
    ([(low, high), ...], certified). The intervals of a few hands are intersected. Then the hand with the least damping
    ratio is searched for at the ends of these intervals and between them; if it is unstable, its own intervals are
    intersected as well, and the search is repeated until it finds no such hand. Then the box is cut into pieces until each
    is proved or contains a hand that is unstable in an interval, which is treated in the same way (`prove`). The search
    begins once more from the hands whose neighbourhood had to be cut finest. Along a number that is no scalar gain of the
    ticks, nothing is proved.
    """
    hands, left, each = _corners_and_middle(box), [Piece(*map(float, span))], True
    fresh, known, proved, settled, work = hands, hands[:0], [], False, WORK
    for _ in range(ROUNDS):
        for hand, (pieces, sure) in zip(fresh, _per_hand(loop, stable, fresh), strict=True):
            left, each = _intersected(left, pieces, hand), each and sure
        fresh = _unstable_hands(loop, path, box, left, known) if left else fresh[:0]
        if not len(fresh):
            bare = [piece for piece in left if not _within(piece.inner(MARGIN), proved)]
            settled = not bare and (bool(left) or each)
            if not bare or work <= 0:
                break
            more, fresh, known, work = _proved(loop, path, box, bare, work)
            proved += more
        hands = np.concatenate([hands, fresh])
    ends = [np.array([getattr(piece, end) for piece in left]) for end in ("low", "high", "low_hand", "high_hand")]
    return BoxIntervals(*ends[:2], *(end.reshape(-1, 3) for end in ends[2:]), hands, each, settled)


def _proved(loop, path, box, pieces, work):
    """Intervals within these proved for every hand, hands that are not stable, hands to look closer at, and work left."""
    found, proofs = [], []
    for piece in pieces:
        interval = piece.inner(0.9 * MARGIN)  # so that it stands when the ends give way a little
        proofs.append(prove(loop, path, box, interval, work))
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
    """An interval and the hands that set its ends, NO_HAND if the range does."""

    low: float
    high: float
    low_hand: tuple[float, ...] = NO_HAND
    high_hand: tuple[float, ...] = NO_HAND

    def inner(self, share) -> tuple[float, float]:
        """The interval without this share of it at either end."""
        aside = share * (self.high - self.low)
        return self.low + aside, self.high - aside


def _corners_and_middle(box):
    ends = [[0.0, 1.0] if free else [0.0] for free in box.high > box.low]
    corners = box.points(np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 3))
    return np.unique(np.concatenate([corners, box.points(np.full((1, 3), 0.5))]), axis=0)


def _per_hand(loop, stable, hands):
    """Stable intervals of each hand, as ([(low, high), ...], certified), in order."""
    found = [None] * len(hands)
    for group in (np.flatnonzero(hands[:, 2] > 0), np.flatnonzero(hands[:, 2] == 0)):
        for hand, each in zip(group, stable(with_hands(loop, hands[group])) if group.size else (), strict=True):
            found[hand] = each
    return found


def _intersected(left, pieces, hand):
    """The intersection, each end with the hand that sets it."""
    name = tuple(hand.tolist())
    both = []
    for old in left:
        for low, high in pieces:
            start = (float(low), name) if low > old.low else (old.low, old.low_hand)
            stop = (float(high), name) if high < old.high else (old.high, old.high_hand)
            if start[0] < stop[0]:
                both.append(Piece(start[0], stop[0], start[1], stop[1]))
    return both


def _unstable_hands(loop, path, box, left, known):
    """Hands with which a probe of one of the pieces is unstable beyond doubt."""
    low, high = (np.array([getattr(piece, end) for piece in left])[:, None] for end in ("low", "high"))
    probes = (low + (high - low) * PROBES).reshape(-1)
    hands, _, damping = worst_hands(loop, box, path, probes, "damping", known)
    return np.unique(hands[damping < -SAME], axis=0)


WORK = 400_000  # pieces to judge, times the cost of a piece in a loop of its order: some seconds
CHUNK = 512  # pieces judged together
UNSTABLE = 1e-9  # beyond 1, of a spectral radius
SOFTEST = 1e-6  # of the stiffest spring: without position feedback, softer springs are left out, but not the stiffness 0
TOLD = 8  # hands to start the next search from, for either end of the interval and for all of it


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """The outcome for an interval.

    holds: whether it is proved for every hand. unstable: hands `(n, 3)` (kg, N*s/m, N/m) that are unstable at some wall.
    hardest: hands `(n, 3)` whose neighbourhood was cut finest. work: pieces judged, times the cost of each.
    """

    holds: bool
    unstable: np.ndarray
    hardest: np.ndarray
    work: int


NOTHING = np.zeros((0, 3))


def prove(loop: HeldLoop, path: str, box: HandBox, walls: tuple[float, float], work: int = WORK) -> Proof:
    """Try to prove stability for every hand of the box and every value of the number `path` in `walls`.

    loop: a single one. A piece is proved if no matrix of its enclosure has an eigenvalue on or outside the unit
    circle (`excluded`). If it is not proved, it is halved across the parameter that adds most to its bound, until `work`
    is spent. A piece whose middle is unstable ends the proof.
    Accuracy: every hand of the box is covered, with one exception. If waves feed no position back and the range of the
    stiffness begins at 0, springs softer than SOFTEST of the stiffest are left out, since they hold the scene ever more
    loosely; the stiffness 0 is proved by itself. The bound leaves room for rounding.
    """
    proofs = []
    for part in _parts(loop.with_hand(), box):
        whole = hand_loop(loop, path, part)
        left = work - sum(proof.work for proof in proofs)
        proofs.append(_prove(whole, part, walls, left) if whole else Proof(False, NOTHING, NOTHING, 0))
        if not proofs[-1].holds:
            break
    hands = (np.concatenate([getattr(proof, name) for proof in proofs]) for name in ("unstable", "hardest"))
    return Proof(all(proof.holds for proof in proofs), *hands, sum(proof.work for proof in proofs))


def _parts(loop, box):
    """The box, or its hands with a spring and those without, if these drift in different ways."""
    low, high = box.stiffness
    if low > 0 or high == 0:
        return [box]
    drifts = [loop.changed({HAND[2]: stiffness}).drift() for stiffness in (0.0, high)]
    if not any(each.moved or each.folded or each.unread for each in drifts):
        return [box]
    return [HandBox(box.mass, box.damping, (SOFTEST * high, high)), HandBox(box.mass, box.damping, (0.0, 0.0))]


def _prove(loop: HandLoop, box: HandBox, walls, work) -> Proof:
    ends = [loop.points(np.append(end, wall)) for end, wall in zip((box.low, box.high), walls, strict=True)]
    low, high = np.minimum(*ends)[None], np.maximum(*ends)[None]
    last, done, cost = low, 0, round(loop.order**1.5)
    if not loop.is_regular(walls):
        return Proof(False, NOTHING, NOTHING, 0)
    while len(low) and done + len(low) * cost <= work:
        done += len(low) * cost
        found = [_judged(loop, low[i : i + CHUNK], high[i : i + CHUNK]) for i in range(0, len(low), CHUNK)]
        radius, proved, split = (np.concatenate(parts) for parts in zip(*found, strict=True))
        worst = np.argsort(-radius, kind="stable")
        if radius[worst[0]] > 1 + UNSTABLE:
            worst = worst[:TOLD][radius[worst[:TOLD]] > 1 + UNSTABLE]
            return Proof(False, _hands(loop, box, (low[worst] + high[worst]) / 2), NOTHING, done)
        ends = (low[worst, NUMBER] == low[:, NUMBER].min(), high[worst, NUMBER] == high[:, NUMBER].max(), slice(None))
        worst = np.concatenate([worst[end][:TOLD] for end in ends])
        last = (low[worst] + high[worst]) / 2
        low, high = _halved(low[~proved], high[~proved], split[~proved])
    return Proof(not len(low), NOTHING, _hands(loop, box, last), done)


def _hands(loop, box, points):
    return np.clip(loop.hands_and_numbers(points)[0], box.low, box.high)


def _judged(loop, low, high):
    """Spectral radius in the middle, whether the piece is proved, and the parameter to cut it across."""
    with np.errstate(all="ignore"):  # a piece that overflows is not proved
        frame, modes = frame_over(loop, low, high)
        proved, split = excluded(frame)
        bounded = np.isfinite(frame.rest).all((-1, -2))
        split = np.where(bounded, split, np.argmax(np.abs(high - low) / (np.abs(high) + np.abs(low)), axis=-1))
    return np.where(np.isfinite(modes).all(-1), np.abs(1 + modes).max(-1), np.inf), proved, split


def _halved(low, high, split):
    """Both halves of every piece, equal in the logarithm if it spans more than a factor of four."""
    at = np.arange(len(low))
    a, b = low[at, split], high[at, split]
    wide = np.where(a > 0, np.sqrt(np.maximum(a * b, 0)), b / 16)
    first, second = high.copy(), low.copy()
    first[at, split] = second[at, split] = np.where((a >= 0) & (b > 4 * a), wide, (a + b) / 2)
    return np.concatenate([low, second]), np.concatenate([first, high])
