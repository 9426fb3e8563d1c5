"""The hand in a box that a loop bears least."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity.hand import HandBox, worst_modes

GRID = 6  # hands along each range of the first look
EDGE = 128  # hands along each edge of the box, where a light hand's resonance may pass any multiple of the rates
SPREAD = 500  # hands all over the box: of those that a resonance singles out a regular grid may have none
SEEDS = 6  # of the grid, of the edges and of those all over, how many are improved
FINEST = 1e-9  # of a range, where the search stops
STEPS = 60  # or after so many looks around, on a ridge that goes on and on
ROUNDING = 1e-13  # a measure that rises by no more than this has not risen
NEIGHBOURS = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
METHOD = "searched: grid, edges, spread and pattern search, verified by eigenvalues; no proof that no hand is worse"


@dataclass(frozen=True, slots=True)
class WorstHand:
    """A hand (kg, N*s/m, N/m), the loop's spectral radius and least damping ratio with it, and how it was found."""

    mass: float
    damping: float
    stiffness: float
    spectral_radius: float
    damping_ratio: float
    evaluations: int
    method: str = METHOD

    @property
    def stable(self) -> bool:
        """Whether the loop is stable with this hand, drift aside."""
        return self.spectral_radius < 1


def worst_hand(values, box: HandBox, by: str = "radius") -> WorstHand:
    """The hand of the box with the largest spectral radius, or `by="damping"` with the least damping ratio.

    values: flat keys, numbers. The search: GRID hands along each range, EDGE along each edge and SPREAD all over the box, the
    SEEDS best of each improved together by looking at all 26 neighbours at a distance that shrinks when none is worse and
    grows when one is, faces and corners of the box included.
    Accuracy: the place to 1e-9 of the ranges unless the search is caught in a lesser maximum or on a ridge; the tests
    hold it against 10,000 sampled hands.
    """
    K, B = values["environment.K_VE"], values["environment.B_VE"]
    hands, radius, damping, count = worst_hands(values, box, np.array([K], float), B, by)
    return WorstHand(*hands[0].tolist(), float(radius[0]), float(damping[0]), count)


def worst_hands(values, box: HandBox, K_VE, B_VE, by: str = "radius", known=()):
    """The same for several walls `K_VE` `(walls,)` at once: (hands `(walls, 3)`, radius, damping, evaluations).

    known: hands `(n, 3)` to start from besides those of the grid.
    """
    measure = {"radius": 0, "damping": 1}[by]
    sign = (1, -1)[measure]
    count = 0

    def badness(share):
        nonlocal count
        count += share[..., 0].size
        walls = np.broadcast_to(K_VE.reshape(-1, *[1] * (share.ndim - 2)), share.shape[:-1]).reshape(-1)
        found = worst_modes(values, box.points(share).reshape(-1, 3), walls, B_VE)[measure]
        return sign * found.reshape(share.shape[:-1])

    share = _improved(*_seeds(box, badness, K_VE.size, np.reshape(known, (-1, 3))), _free(box), badness)
    hands = box.points(share)
    return hands, *worst_modes(values, hands, K_VE, B_VE), count


def _free(box):
    """Which of the ranges are more than a point."""
    return box.high > box.low


def _seeds(box, badness, walls, known):
    """The worst hands of a grid, known ones among them, and of the edges, as shares, and how bad they are.

    Both have the axes (walls, up to 3 SEEDS), the shares one more.
    """
    free = _free(box)
    found = []
    for hands in (np.concatenate([_grid(free, [GRID] * 3), box.shares(known)]), _edges(free), _spread(free)):
        bad = badness(np.broadcast_to(hands, (walls, *hands.shape)))
        best = np.argsort(-bad, axis=-1, kind="stable")[:, :SEEDS]
        found.append((hands[best], np.take_along_axis(bad, best, -1)))
    return tuple(np.concatenate(parts, axis=1) for parts in zip(*found, strict=True))


def _grid(free, counts):
    axes = [np.linspace(0, 1, count) if some else np.zeros(1) for some, count in zip(free, counts, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _edges(free):
    """Hands along the edges of the box."""
    along = [_grid(free, np.where(np.arange(3) == k, EDGE, 2)) for k in np.flatnonzero(free)]
    return np.concatenate(along) if along else np.zeros((1, 3))


def _spread(free):
    """Hands evenly all over, by an additive recurrence with the powers of 1/g, g^4 = g + 1 (M. Roberts, 2018)."""
    steps = 1.2207440846057596 ** -np.arange(1.0, 4.0)
    return np.outer(np.arange(1, SPREAD + 1), steps) % 1 * free


def _improved(share, bad, free, badness):
    """The worst hand of each wall after a pattern search from all the seeds, `(walls, 3)`."""
    around = np.unique(NEIGHBOURS * free, axis=0)
    step = np.full(bad.shape, 0.5 / (GRID - 1))
    for _ in range(STEPS):
        if step.max() <= FINEST:
            break
        trial = np.clip(share[..., None, :] + step[..., None, None] * around, 0, 1)
        found = badness(trial)
        best = found.argmax(-1)[..., None]
        value = np.take_along_axis(found, best, -1)[..., 0]
        better = value > bad + ROUNDING
        moved = np.take_along_axis(trial, best[..., None], -2)[..., 0, :]
        share, bad = np.where(better[..., None], moved, share), np.where(better, value, bad)
        step = np.where(better, np.minimum(2 * step, 0.1), step / 4)
        if step.shape[1] > 2:  # the seeds that have fallen behind are dropped
            kept = np.argsort(-bad, axis=-1)[:, : step.shape[1] - 1]
            share = np.take_along_axis(share, kept[..., None], 1)
            bad, step = (np.take_along_axis(part, kept, 1) for part in (bad, step))
    return np.take_along_axis(share, bad.argmax(-1)[:, None, None], 1)[:, 0]
