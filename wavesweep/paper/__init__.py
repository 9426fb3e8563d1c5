"""The paper: its figures from its specs, and its statements judged by the results of the specs."""

from wavesweep.paper.documents import counted
from wavesweep.paper.figures import tables
from wavesweep.paper.verdicts import VERDICTS

__all__ = ["VERDICTS", "counted", "tables"]
