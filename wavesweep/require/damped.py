"""The damping ratio that some modes of a loop need."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from wavesweep.program.reading.keys import ALL_MODES, OSCILLATING

if TYPE_CHECKING:
    import numpy as np

    from wavesweep.require.discs import Spiral


class Damped(NamedTuple):
    """The least damping ratio of some modes: those with the word `modes`, without those that fall
    to 1/e in `slower_than` s.

    clocks: of the spec in a frame.
    """

    ratio: float
    modes: str = ALL_MODES
    slower_than: float = 0.0
    clocks: float = 1.0

    def gone(self, period: np.ndarray) -> np.ndarray:
        """The size of an eigenvalue below which a mode needs no damping ratio, by the frame's
        period (s)."""
        from wavesweep.engine.poles import size_gone

        return size_gone(period, self.slower_than, self.clocks)

    def spiral(self, period: np.ndarray, ticks: int) -> Spiral:
        """Where the eigenvalues have to be; period: of the frame of each column (s), of so many
        ticks."""
        from wavesweep.require.discs import Spiral

        return Spiral(
            self.ratio, self.gone(period).reshape(-1, 1), self.modes == OSCILLATING, ticks
        )

    def words(self) -> str:
        """What is required, in words."""
        if self.modes == ALL_MODES:
            which = "every mode"
        else:
            which = "every pair of modes that oscillates"
        if self.slower_than:
            slow = f" that takes {self.slower_than:.15g} s or more to fall to 1/e"
        else:
            slow = ""
        return f"{which}{slow} of a damping ratio of at least {self.ratio:.15g}"
