"""What a hand may be: a box of operator impedances, and the loop with such hands on the device."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.spectrum import eigenvalues, excess
from wavesweep.diagram import draw
from wavesweep.lifted import Cut, close, cut_at_wall

OPERATOR = ("operator.mass", "operator.damping", "operator.stiffness")


@dataclass(frozen=True, slots=True)
class HandBox:
    """Ranges (low, high) of the hand's mass (kg), damping (N*s/m) and stiffness (N/m), all at least 0."""

    mass: tuple[float, float]
    damping: tuple[float, float]
    stiffness: tuple[float, float]

    def __post_init__(self):
        for name in ("mass", "damping", "stiffness"):
            low, high = getattr(self, name)
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
        """The shares that `points` makes these hands of, 0 where the range is a point."""
        hands, free = np.clip(hands, self.low, self.high), self.high > self.low
        log, start, ratio = self._log()
        evenly = np.log(np.where(log, hands, 1) / start) / np.log(np.where(free & log, ratio, 2))
        return np.where(log, evenly, np.cbrt(hands / np.where(free, self.high, 1))) * free

    def _log(self):
        """Which ranges do not begin at 0, their lower ends and the ratio of both, else 1."""
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


def with_hands(values, hands) -> dict:
    """The values with the hands `(n, 3)` in place of the operator, as arrays `(n,)`."""
    return dict(values) | dict(zip(OPERATOR, np.asarray(hands, float).T, strict=True))


def cut_with_hands(values, hands) -> Cut:
    """The loops with the hands `(n, 3)` cut at the wall; all of them or none must have a stiffness."""
    return cut_at_wall(draw(with_hands(values, hands)))


def worst_modes(values, hands, K_VE, B_VE) -> tuple[np.ndarray, np.ndarray]:
    """Spectral radius and least damping ratio of the loop, drift aside, for each hand: two arrays `(n,)`.

    hands: `(n, 3)`. K_VE (N/m), B_VE (N*s/m): numbers or arrays `(n,)`. The damping ratio of a mode z is
    `-Re log z / |log z|`: 1 for a mode that decays without swinging, 0 on the unit circle, negative outside. A slow
    decay of no harm has a spectral radius near 1; by the damping ratio it does not hide a mode that swings up.
    """
    hands = np.asarray(hands, float)
    K_VE, B_VE = (np.broadcast_to(np.asarray(a, float), hands.shape[:1]) for a in (K_VE, B_VE))
    radius, damping = np.empty(len(hands)), np.empty(len(hands))
    for group in (hands[:, 2] > 0, hands[:, 2] == 0):  # a drawing has a spring in the hand, or none
        if group.any():
            with np.errstate(over="ignore", invalid="ignore"):
                E = close(cut_with_hands(values, hands[group]), K_VE[group], B_VE[group])
            radius[group], damping[group] = _measures(E)
    return radius, damping


def swing_with_hand(values, hand, K_VE) -> float:
    """Frequency (rad/s) of the mode that grows most, or decays slowest, with the hand `(3,)` and the wall K_VE (N/m)."""
    cut = cut_with_hands(values, np.reshape(hand, (1, 3)))
    delta = np.linalg.eigvals(close(cut, K_VE, values["environment.B_VE"])[0]).astype(complex)
    return float(np.abs(np.angle(1 + delta[np.argmax(np.abs(1 + delta))])) / np.reshape(cut.period, -1)[0])


def _measures(E):
    """Spectral radius of I + E and the least damping ratio; infinite and -1 where the frame overflowed."""
    delta, finite = eigenvalues(E)
    # A mode at z = 0 decays at once, and any small number stands for it.
    growth = np.log1p(np.clip(excess(delta), -1 + 1e-15, 1e12)) / 2
    ratio = -growth / np.maximum(np.hypot(growth, np.angle(1 + delta)), 1e-300)
    radius = np.where(finite, np.exp(growth.max(-1, initial=-np.inf)), np.inf)
    return radius, np.where(finite, ratio.min(-1, initial=1.0), -1.0)
