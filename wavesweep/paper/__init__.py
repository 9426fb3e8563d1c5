"""The paper again: its figures from its specs, its statements judged by the results of the specs."""

from wavesweep.paper.documents import counted
from wavesweep.paper.figures import tables

__all__ = ["counted", "tables"]
