"""The paper again: its figures from its specs, its statements judged by what the specs give."""

from wavesweep.paper.documents import counted
from wavesweep.paper.run import tables
from wavesweep.paper.tables import write_table

__all__ = ["counted", "tables", "write_table"]
