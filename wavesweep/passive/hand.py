"""Hands in a box of masses, dampings and stiffnesses, and a search for the hand that destabilises a loop most."""

from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from wavesweep.given import real_numbers
from wavesweep.monodromy.drift import filled, without_drift
from wavesweep.monodromy.periodic import frame_of, ticks_of
from wavesweep.passive.held_loop import HAND, HeldLoop
from wavesweep.stability.spectrum import eigenvalues, excess


@dataclass(frozen=True, slots=True)
class HandBox:
    """Ranges (low, high) of the hand's mass (kg), damping (N*s/m) and stiffness (N/m), all at least 0."""

    mass: tuple[float, float]
    damping: tuple[float, float]
    stiffness: tuple[float, float]

    def __post_init__(self):
        for name in ("mass", "damping", "stiffness"):
            given = getattr(self, name)
            ends = real_numbers(given)
            if ends is None or ends.shape != (2,):
                raise ValueError(f"hand box: {name} expected (low, high), found {given!r:.60}")
            low, high = map(float, ends)
            if not 0 <= low <= high < np.inf:
                raise ValueError(f"hand box: {name} expected 0 <= low <= high, found ({low!r}, {high!r})")

    @property
    def low(self) -> np.ndarray:
        """The lower ends, `(3,)`."""
        return np.array([self.mass[0], self.damping[0], self.stiffness[0]], float)

    @property
    def high(self) -> np.ndarray:
        """The upper ends, `(3,)`."""
        return np.array([self.mass[1], self.damping[1], self.stiffness[1]], float)

    def points(self, share) -> np.ndarray:
        """Hands at `share` (`(..., 3)`, 0 to 1) of each range: evenly in the logarithm, from 0 on in the cube root."""
        log, start, ratio = self._log()
        hands = np.where(log, start * ratio**share, self.high * share**3)
        return np.clip(hands, self.low, self.high)

    def shares(self, hands) -> np.ndarray:
        """The shares at which `points` gives these hands, 0 if the range is a point."""
        hands, free = np.clip(hands, self.low, self.high), self.high > self.low
        log, start, ratio = self._log()
        evenly = np.log(np.where(log, hands, 1) / start) / np.log(np.where(free & log, ratio, 2))
        return np.where(log, evenly, np.cbrt(hands / np.where(free, self.high, 1))) * free

    def _log(self):
        """Whether each range begins above 0, and its lower end and the ratio of its ends, or 1."""
        log = self.low > 0
        start = np.where(log, self.low, 1)
        return log, start, np.where(log, self.high / start, 1)


HOLDING_A_DEVICE = HandBox(mass=(0.005, 0.6), damping=(2.0, 10.0), stiffness=(100.0, 1000.0))
"""From one finger to the whole arm.

Heavy, soft end: an arm at the handle of a HapticMaster, fitted with 0.554 kg, 6.45 N*s/m, 135 N/m (W. van Beek,
W. Bergmann Tiest, W. Mugge, A. Kappers, Haptic perception of force magnitude and its relation to postural arm dynamics
in 3D, Scientific Reports 5:18004, 2015, caption of Figure 3: one trial of one participant; authors and year quoted from
memory). Light, stiff end: a fingertip, of the order of 5 g, 2 to 10 N*s/m and 200 to 1000 N/m for forces of 2 to 20 N
(A. Hajian, R. Howe, Identification of the mechanical impedance at the human finger tip, J. Biomech. Eng. 119, 1997;
quoted from memory, not checked). The box is the hull of both, rounded outwards.
"""


def with_hands(loop: HeldLoop, hands) -> HeldLoop:
    """The loop with the hands `(n, 3)` at its device, as a batch `(n,)`; all of them or none must have a stiffness."""
    return loop.with_hand().changed(dict(zip(HAND, np.asarray(hands, float).T, strict=True)))


def worst_modes(loop: HeldLoop, hands, changes=MappingProxyType({})) -> tuple[np.ndarray, np.ndarray]:
    """Spectral radius and least damping ratio of the loop, drift aside, for each hand: two arrays `(n,)`.

    loop: a single one. hands: `(n, 3)`. changes: path -> other numbers of the loop, `(n,)`. The damping ratio of a mode z is
    `-Re log z / |log z|`: 1 for a mode that decays without swinging, 0 on the unit circle, negative outside. A slow
    but harmless decay has a spectral radius near 1; the damping ratio shows a growing oscillation beside it.
    """
    hands = np.asarray(hands, float)
    radius, damping = np.empty(len(hands)), np.empty(len(hands))
    for group in (hands[:, 2] > 0, hands[:, 2] == 0):  # a loop has a spring in the hand, or none
        if group.any():
            some = with_hands(loop, hands[group]).changed({path: np.asarray(v)[group] for path, v in changes.items()})
            radius[group], damping[group] = _measures(*_modes(some))
    return radius, damping


def _modes(loop) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues less 1 of the frames `(n, k)`, drift aside, and whether these are finite.

    A drift whose shift depends on the numbers is the eigenvalue 1 that rounding has left nearest to it: to eliminate it takes
    digits of the slow mode of a soft spring.
    """
    drift, ticks = loop.drift(), ticks_of(loop.drawn(), alone=True)
    folded = len(drift.folded) if not drift.unread else 0
    with np.errstate(all="ignore"):
        E = without_drift(frame_of(ticks), replace(drift, folded=()) if folded else drift)
    delta, finite = eigenvalues(filled(np.broadcast_to(E, (*loop.batch, *E.shape[-2:]))))
    first = np.argsort(np.abs(delta), axis=-1)[:, :folded]
    np.put_along_axis(delta, first, -1.0, axis=-1)
    return delta, finite


def swing_with_hand(loop: HeldLoop, hand) -> float:
    """Frequency (rad/s) of the mode that grows most, or decays slowest.

    loop: a single one. hand: `(3,)`.
    """
    held = with_hands(loop, np.reshape(hand, (1, 3)))
    drawn, delta = held.drawn(), _modes(held)[0][0]
    return float(np.abs(np.angle(1 + delta[np.argmax(np.abs(1 + delta))])) / np.ravel(drawn.period * drawn.ticks)[0])


def _measures(delta, finite):
    """Spectral radius and the least damping ratio; infinite and -1 if the frame overflowed."""
    # A mode at z = 0 decays at once, and any small number stands for it.
    growth = np.log1p(np.clip(excess(delta), -1 + 1e-15, 1e12)) / 2
    ratio = -growth / np.maximum(np.hypot(growth, np.angle(1 + delta)), 1e-300)
    radius = np.where(finite, np.exp(growth.max(-1, initial=-np.inf)), np.inf)
    return radius, np.where(finite, ratio.min(-1, initial=1.0), -1.0)


GRID = 6  # hands along each range of the first look
EDGE = 128  # hands along each edge of the box: the resonance of a light hand may pass any multiple of the rates
SPREAD = 500  # hands all over the box: a regular grid may miss the hands that a resonance singles out
SEEDS = 6  # of the grid, of the edges and of those all over, how many are improved
FINEST = 1e-9  # of a range, at which the search stops
STEPS = 60  # or after so many looks around, on a ridge that goes on and on
ROUNDING = 1e-13  # a measure that rises by no more than this has not risen
NEIGHBOURS = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


def worst_hands(loop: HeldLoop, box: HandBox, path: str, p, by: str = "radius", known=()):
    """The hand of the box with the largest spectral radius, or `by="damping"` with the least damping ratio, for each value p of
    the number `path`, such as a wall's stiffness.

    loop: a single one. p: `(walls,)`. known: hands `(n, 3)` to start from besides those of the grid. Returned:
    the hands `(walls, 3)` (kg, N*s/m, N/m), and the spectral radius and the damping ratio with each, `(walls,)`. The search:
    GRID hands along each range, EDGE along each edge and SPREAD all over the box, the SEEDS best of each improved together by
    trying all 26 neighbours at a distance that shrinks when none is worse and grows when one is, faces and corners of the box
    included.
    Accuracy: the place to 1e-9 of the ranges unless the search is caught in a lesser maximum or on a ridge; the tests hold it
    against 10,000 sampled hands.
    """
    measure = {"radius": 0, "damping": 1}[by]
    sign = (1, -1)[measure]

    def badness(share):
        walls = np.broadcast_to(p.reshape(-1, *[1] * (share.ndim - 2)), share.shape[:-1]).reshape(-1)
        found = worst_modes(loop, box.points(share).reshape(-1, 3), {path: walls})[measure]
        return sign * found.reshape(share.shape[:-1])

    share = _improved(*_seeds(box, badness, p.size, np.reshape(known, (-1, 3))), _free(box), badness)
    hands = box.points(share)
    return hands, *worst_modes(loop, hands, {path: p})


def _free(box):
    """Which of the ranges are more than a point."""
    return box.high > box.low


def _seeds(box, badness, walls, known):
    """The worst hands of a grid, known ones among them, and of the edges, as shares, and their badness.

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
