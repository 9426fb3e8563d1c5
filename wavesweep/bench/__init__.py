"""Run time against error, this tool beside the methods that a user would write instead; and hard cases."""

from wavesweep.bench.measuring import FIELDS
from wavesweep.bench.report import lines, measure

__all__ = ["FIELDS", "lines", "measure"]
