"""What other capabilities ask of switched systems: matrices in any order that a graph allows,
and norms in which all shrink."""

from wavesweep.for_all.claimed import scope_of
from wavesweep.for_all.graph import Graph
from wavesweep.for_all.loop_frames import LoopFrames, WrittenFrames
from wavesweep.for_all.norm_check import Norms, definite, in_its_units, shrink, shrink_along
from wavesweep.for_all.norms import Centre, acting, recentred
from wavesweep.for_all.patterns import is_refuted, refuted_beyond
from wavesweep.for_all.ring_search import opened, units_of_ring, walked
from wavesweep.for_all.rows import FOR_ALL_RECORD, Row, cases_of, recorded
from wavesweep.for_all.unknown import Part
from wavesweep.for_all.varying import Rules, bracketed, decided_over, text_of_pattern
from wavesweep.for_all.wall_frames import UnfitWallError, WallFrames, wall_frames

__all__ = [
    "FOR_ALL_RECORD",
    "Centre",
    "Graph",
    "LoopFrames",
    "Norms",
    "Part",
    "Row",
    "Rules",
    "UnfitWallError",
    "WallFrames",
    "WrittenFrames",
    "acting",
    "bracketed",
    "cases_of",
    "decided_over",
    "definite",
    "in_its_units",
    "is_refuted",
    "opened",
    "recentred",
    "recorded",
    "refuted_beyond",
    "scope_of",
    "shrink",
    "shrink_along",
    "text_of_pattern",
    "units_of_ring",
    "walked",
    "wall_frames",
]
