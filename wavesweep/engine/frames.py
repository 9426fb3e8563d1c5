"""Frames: the ticks of a loop multiplied, what drifts in them, and loops cut at a number of their frame."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._monodromy.bounded import Bounded, sum_rounding
    from wavesweep.engine._monodromy.cut import (
        ADVANCE,
        OFFSET,
        VELOCITY,
        LinearFractional,
    )
    from wavesweep.engine._monodromy.drift import MarginalModes, relative_row
    from wavesweep.engine._monodromy.open_frame import OpenFrame
    from wavesweep.engine._monodromy.open_ticks import OpenTicks
    from wavesweep.engine._monodromy.periodic import Ticks, in_a_row, products_of_rows
    from wavesweep.engine._monodromy.product import blocks_of, pattern_of
    from wavesweep.engine._monodromy.rounding import (
        balance,
        both,
    )
    from wavesweep.engine._monodromy.unit_circle import inverse, on_circle, solve
    from wavesweep.engine._search.frames_along import frames_where_solvable
    from wavesweep.engine._search.open_loops import (
        REMEMBERED_LOOPS,
        Opened,
        by_zeros,
        open_loops,
    )
    from wavesweep.engine._stability.sampled_frames import Frames, level, pole_inside
else:
    __getattr__ = on_demand(
        {
            "_monodromy.bounded": ("Bounded", "sum_rounding"),
            "_monodromy.cut": (
                "ADVANCE",
                "LinearFractional",
                "OFFSET",
                "VELOCITY",
            ),
            "_monodromy.drift": ("MarginalModes", "relative_row"),
            "_monodromy.open_frame": ("OpenFrame",),
            "_monodromy.open_ticks": ("OpenTicks",),
            "_monodromy.periodic": ("Ticks", "in_a_row", "products_of_rows"),
            "_monodromy.product": ("blocks_of", "pattern_of"),
            "_monodromy.rounding": ("balance", "both"),
            "_monodromy.unit_circle": ("inverse", "on_circle", "solve"),
            "_search.frames_along": ("frames_where_solvable",),
            "_search.open_loops": (
                "REMEMBERED_LOOPS",
                "Opened",
                "by_zeros",
                "open_loops",
            ),
            "_stability.sampled_frames": ("Frames", "level", "pole_inside"),
        }
    )
