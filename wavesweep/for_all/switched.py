"""What other capabilities ask of switched systems: matrices in any order that a graph allows,
and norms in which all shrink."""

from wavesweep.for_all.graph import Graph
from wavesweep.for_all.loop_frames import LoopFrames
from wavesweep.for_all.norm_check import Norms, shrink, shrink_along
from wavesweep.for_all.norms import Centre, advanced, recentred, rough_basis
from wavesweep.for_all.patterns import is_refuted, refuted_beyond
from wavesweep.for_all.rows import FOR_ALL_RECORD, Row, recorded
from wavesweep.for_all.unknown import Part

__all__ = [
    "FOR_ALL_RECORD",
    "Centre",
    "Graph",
    "LoopFrames",
    "Norms",
    "Part",
    "Row",
    "advanced",
    "is_refuted",
    "recentred",
    "recorded",
    "refuted_beyond",
    "rough_basis",
    "shrink",
    "shrink_along",
]
