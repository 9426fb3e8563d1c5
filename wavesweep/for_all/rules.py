"""What a spec's [for_all] asks for, and rows that answer it: for capabilities that read a key of it."""

from wavesweep.for_all.claimed import scope_of
from wavesweep.for_all.rows import (
    Row,
    cases_of,
    felt_for_all,
    numbers_in_words,
    recorded,
    rows_of,
)
from wavesweep.for_all.unknown import Part
from wavesweep.for_all.varying import Rules, decided_over, text_of_pattern
from wavesweep.for_all.wall_frames import UnfitWallError, WallFrames, wall_frames

__all__ = [
    "Part",
    "Row",
    "Rules",
    "UnfitWallError",
    "WallFrames",
    "cases_of",
    "decided_over",
    "felt_for_all",
    "numbers_in_words",
    "recorded",
    "rows_of",
    "scope_of",
    "text_of_pattern",
    "wall_frames",
]
