"""Stable intervals along a number with their certificate: the search, its records, and what proves them."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._loops.resolution import Resolution, Side
    from wavesweep.engine._search.at_ends import AtPort
    from wavesweep.engine._search.interval_records import (
        FAILURES,
        blank_records,
        record_type,
        unanswered,
    )
    from wavesweep.engine._search.interval_search import Search, Searches
    from wavesweep.engine._search.question import Prover, Question
    from wavesweep.engine._stability.along_any import END_ROUNDING, stable_along_any
    from wavesweep.engine._stability.intervals import Intervals
    from wavesweep.engine._stability.positive import FunctionValues, positive
    from wavesweep.engine._stability.regions import SHARE_OF_SPAN
    from wavesweep.engine._stability.sampled_frames import ParametricFrames
else:
    __getattr__ = on_demand(
        {
            "_loops.resolution": ("Resolution", "Side"),
            "_search.at_ends": ("AtPort",),
            "_search.interval_records": ("FAILURES", "blank_records", "record_type", "unanswered"),
            "_search.interval_search": ("Search", "Searches"),
            "_search.question": ("Prover", "Question"),
            "_stability.along_any": ("END_ROUNDING", "stable_along_any"),
            "_stability.intervals": ("Intervals",),
            "_stability.positive": ("FunctionValues", "positive"),
            "_stability.regions": ("SHARE_OF_SPAN",),
            "_stability.sampled_frames": ("ParametricFrames",),
        }
    )
