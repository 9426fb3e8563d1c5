"""The circle that eigenvalues have to be in: as [sweep] requires, in place of the unit circle."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.errors import UsageError
from wavesweep.spec import Require
from wavesweep.spec.require import SETTLED

LEAST = 1e-6  # of a radius: what is left of a smaller one's eigenvalues is rounding


@dataclass(frozen=True, slots=True)
class Bound:
    """The largest size of the eigenvalues of a drawing's frame: `radius`, and in `settling` (s) a mode is down to SETTLED."""

    radius: float = 1.0
    settling: float = np.inf

    @classmethod
    def of(cls, require: Require) -> "Bound":
        """What a spec requires of the frames of a drawing."""
        return cls(require.radius or 1.0, require.settling or np.inf)

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
