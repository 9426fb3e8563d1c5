"""A proof that a loop is stable with every hand of a box at every wall of an interval, by cutting both into pieces."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity.exclusion import excluded
from wavesweep.analysis.passivity.hand import HandBox
from wavesweep.analysis.passivity.held_frame import WALL, HeldLoop, frame_over, held_loop

WORK = 400_000  # pieces to look at, times what each costs in a loop of its order: some seconds
CHUNK = 512  # pieces looked at together
UNSTABLE = 1e-9  # beyond 1, of a spectral radius
SOFTEST = 1e-6  # of the stiffest: where no position is fed back, softer springs than that, but none at all, are left out
TOLD = 8  # hands to go on from, of either end of the interval and of all of it


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """holds: every hand is proved. unstable, hardest: hands `(n, 3)` (kg, N*s/m, N/m) that are unstable at some wall, and
    those whose neighbourhood was cut finest. work: pieces looked at, times what each costs."""

    holds: bool
    unstable: np.ndarray
    hardest: np.ndarray
    work: int


NOTHING = np.zeros((0, 3))


def prove(values, box: HandBox, walls: tuple[float, float], work: int = WORK) -> Proof:
    """Try to prove it for K_VE in `walls` (N/m); values: flat keys, numbers.

    A piece is proved where no matrix of its enclosure has an eigenvalue on or outside the unit circle (`excluded`); if
    it is not, it is halved across the parameter that does most to its bound, and given up when `work` is spent. A piece
    whose middle is unstable ends the search.
    Accuracy: every hand of the box, but for springs softer than SOFTEST of the stiffest where waves feed no position back
    and the box begins without a spring (they hold the scene ever more loosely; none at all is proved by itself). The
    bound leaves room for rounding.
    """
    proofs = []
    for part in _parts(values, box):
        loop = held_loop(values, part)
        proofs.append(_prove(loop, part, walls, work - sum(proof.work for proof in proofs)))
        if not proofs[-1].holds:
            break
    hands = (np.concatenate([getattr(proof, name) for proof in proofs]) for name in ("unstable", "hardest"))
    return Proof(all(proof.holds for proof in proofs), *hands, sum(proof.work for proof in proofs))


def _parts(values, box):
    """The box, or its hands with a spring and those without where the frame is another."""
    low, high = box.stiffness
    if low > 0 or high == 0:
        return [box]
    if held_loop(values, box).kind == "plain":
        return [box]
    return [HandBox(box.mass, box.damping, (SOFTEST * high, high)), HandBox(box.mass, box.damping, (0.0, 0.0))]


def _prove(loop: HeldLoop, box: HandBox, walls, work) -> Proof:
    ends = [loop.points(np.append(end, wall)) for end, wall in zip((box.low, box.high), walls, strict=True)]
    low, high = np.minimum(*ends)[None], np.maximum(*ends)[None]
    last, done, cost = low, 0, round(loop.order**1.5)
    if not loop.wall_is_regular(walls):
        return Proof(False, NOTHING, NOTHING, 0)
    while len(low) and done + len(low) * cost <= work:
        done += len(low) * cost
        found = [_judged(loop, low[i : i + CHUNK], high[i : i + CHUNK]) for i in range(0, len(low), CHUNK)]
        radius, proved, split = (np.concatenate(parts) for parts in zip(*found, strict=True))
        worst = np.argsort(-radius, kind="stable")
        if radius[worst[0]] > 1 + UNSTABLE:
            worst = worst[:TOLD][radius[worst[:TOLD]] > 1 + UNSTABLE]
            return Proof(False, _hands(loop, box, (low[worst] + high[worst]) / 2), NOTHING, done)
        ends = (low[worst, WALL] == low[:, WALL].min(), high[worst, WALL] == high[:, WALL].max(), slice(None))
        worst = np.concatenate([worst[end][:TOLD] for end in ends])
        last = (low[worst] + high[worst]) / 2
        low, high = _halved(low[~proved], high[~proved], split[~proved])
    return Proof(not len(low), NOTHING, _hands(loop, box, last), done)


def _hands(loop, box, points):
    return np.clip(loop.hands_and_walls(points)[0], box.low, box.high)


def _judged(loop, low, high):
    """Spectral radius in the middle, whether the piece is proved, and the parameter to cut it across."""
    with np.errstate(all="ignore"):  # what overflows is not proved
        frame, modes = frame_over(loop, low, high)
        proved, split = excluded(frame)
        bounded = np.isfinite(frame.rest).all((-1, -2))
        split = np.where(bounded, split, np.argmax(high / low, axis=-1))
    return np.where(np.isfinite(modes).all(-1), np.abs(1 + modes).max(-1), np.inf), proved, split


def _halved(low, high, split):
    """Both halves of every piece, even in the logarithm where it spans more than a factor of four."""
    at = np.arange(len(low))
    a, b = low[at, split], high[at, split]
    wide = np.where(a > 0, np.sqrt(np.maximum(a * b, 0)), b / 16)
    first, second = high.copy(), low.copy()
    first[at, split] = second[at, split] = np.where(b > 4 * np.maximum(a, 0), wide, (a + b) / 2)
    return np.concatenate([low, second]), np.concatenate([first, high])
