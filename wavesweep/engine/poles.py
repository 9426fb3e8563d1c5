"""Eigenvalues of frames: how many lie outside of the unit circle, damping ratios, and whose modes they are."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._search.lines_of_loops import lines_in_loops, lines_of_each
    from wavesweep.engine._stability.modes import certain_modes, named_modes
    from wavesweep.engine._stability.spectrum import (
        GONE,
        count_outside,
        damping_ratio,
        eigenvalues,
        excess,
        is_stable,
        least_damping,
        radius_of,
        size_gone,
    )
else:
    __getattr__ = on_demand(
        {
            "_search.lines_of_loops": ("lines_in_loops", "lines_of_each"),
            "_stability.modes": ("certain_modes", "named_modes"),
            "_stability.spectrum": (
                "GONE",
                "count_outside",
                "damping_ratio",
                "eigenvalues",
                "excess",
                "is_stable",
                "least_damping",
                "radius_of",
                "size_gone",
            ),
        }
    )
