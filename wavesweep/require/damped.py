"""The damping ratio that some modes of a loop need."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np

    from wavesweep.require.discs import Spiral

EVERY = "all"
OSCILLATING = "oscillating"


class Damped(NamedTuple):
    """The least damping ratio of some modes: those with the word `modes`, without those that fall to 1/e in `slower_than` s."""

    ratio: float
    modes: str = EVERY
    slower_than: float = 0.0

    def gone(self, period: np.ndarray) -> np.ndarray:
        """The size of an eigenvalue below which a mode needs no damping ratio, by the frame's period (s)."""
        import numpy as np

        from wavesweep.engine.stability.spectrum import GONE

        if not self.slower_than:
            return np.full(np.shape(period), GONE)
        return np.maximum(GONE, np.exp(-np.asarray(period, float) / self.slower_than))

    def spiral(self, period: np.ndarray) -> Spiral:
        """Where the eigenvalues have to be; period: of the frame of each column (s)."""
        from wavesweep.require.discs import Spiral

        return Spiral(self.ratio, self.gone(period).reshape(-1, 1), self.modes == OSCILLATING)

    def words(self) -> str:
        """What is required, in words."""
        which = "every mode" if self.modes == EVERY else "every pair of modes that oscillates"
        slow = f" that takes {self.slower_than:g} s or more to fall to 1/e" if self.slower_than else ""
        return f"{which}{slow} of a damping ratio of at least {self.ratio:g}"
