"""The paper: its figures from its specs, and its statements judged by the results of the specs."""

from reproduce.documents import counted
from reproduce.figures import tables
from reproduce.verdicts import VERDICTS

__all__ = ["VERDICTS", "counted", "tables"]
