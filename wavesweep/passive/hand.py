"""Hands in a box of masses, dampings and stiffnesses."""

from dataclasses import dataclass

import numpy as np

from wavesweep.core.arguments import real_numbers
from wavesweep.core.energy.held_loop import HAND


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

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Low and high of each number, by its path."""
        return dict(
            zip(HAND, [(float(low), float(high)) for low, high in (self.mass, self.damping, self.stiffness)], strict=True)
        )


HOLDING_A_DEVICE = HandBox(mass=(0.005, 0.6), damping=(2.0, 10.0), stiffness=(100.0, 1000.0))
"""From one finger to the whole arm.

Heavy, soft end: an arm at the handle of a HapticMaster, fitted with 0.554 kg, 6.45 N*s/m, 135 N/m (W. van Beek,
W. Bergmann Tiest, W. Mugge, A. Kappers, Haptic perception of force magnitude and its relation to postural arm dynamics
in 3D, Scientific Reports 5:18004, 2015, caption of Figure 3: one trial of one participant; authors and year quoted from
memory). Light, stiff end: a fingertip, of the order of 5 g, 2 to 10 N*s/m and 200 to 1000 N/m for forces of 2 to 20 N
(A. Hajian, R. Howe, Identification of the mechanical impedance at the human finger tip, J. Biomech. Eng. 119, 1997;
quoted from memory, not checked). The box is the hull of both, rounded outwards.
"""
