"""Where eigenvalues have to be: as [sweep] requires, in place of the unit circle."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.core.errors import UsageError
from wavesweep.core.spec import Require
from wavesweep.core.stability.spectrum import GONE
from wavesweep.require.keys import SETTLED

LEAST = 1e-6  # of a radius: what is left of a smaller one's eigenvalues is rounding


@dataclass(frozen=True, slots=True)
class Bound:
    """Bounds on the eigenvalues of a drawing's frame: their size `radius`, the time `settling` (s) in which a mode is down to
    SETTLED, and its damping ratio, 0 if none is required; or that a loop which conserves is `bounded`.
    """

    radius: float = 1.0
    settling: float = np.inf
    damping_ratio: float = 0.0
    bounded: bool = False

    @classmethod
    def of(cls, require: Require) -> "Bound":
        """What a spec requires of the frames of a drawing."""
        return cls(require.radius or 1.0, require.settling or np.inf, require.damping_ratio or 0.0, require.bounded)

    @property
    def of_size(self) -> "Bound | None":
        """The bounds on the size alone; None if there are none."""
        return replace(self, damping_ratio=0.0) if self.radius < 1 or self.settling < np.inf else None

    def over(self, frames: int) -> "Bound":
        """The same for so many frames in place of one."""
        return replace(self, radius=self.radius ** (1 / frames))

    def radius_of(self, period) -> np.ndarray:
        """The radius of loops with these periods of a frame, in s."""
        found = np.minimum(self.radius, SETTLED ** (np.asarray(period, float) / self.settling))
        if (found < LEAST).any():
            frame = np.max(period)
            expected = f"at least {np.log(SETTLED) / np.log(LEAST) * frame:.3g} s where a frame takes {frame:.3g} s"
            raise UsageError(f"sweep.require.settling: expected {expected}, found {self.settling:g}")
        return found

    def logarithms(self, period, omega) -> np.ndarray:
        """The logarithms of eigenvalues of that frequency (rad/s) that are just as large as they may be, `(..., 2)`."""
        spiral = -omega * period * self.damping_ratio / np.sqrt(1 - self.damping_ratio**2)
        return (
            np.stack([np.log(self.radius_of(period)), np.maximum(spiral, np.log(GONE))], -1) + 1j * (omega * period)[..., None]
        )
